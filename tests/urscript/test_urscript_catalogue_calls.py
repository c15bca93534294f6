"""Which argument of a call is which, and what run-time checks of arguments say."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urscript.catalogue import ALL_ROWS, CB3_3_15, Builtin, catalogue_for
from urscript.catalogue.calls import static_bind
from urscript.errors import ScriptRuntimeError, ScriptTypeError
from urscript.values import Matrix, Pose


def bind(name: str, args: Sequence[Any], named: Mapping[str, Any] | None = None) -> tuple[Any, ...]:
    """The bound arguments; raises ScriptTypeError if the call does not fit the signature."""
    named = named or {}
    sources = {
        "arg": lambda index: args[index],
        "kw": lambda name: named[name],
        "default": lambda value: value,
    }
    return tuple(sources[kind](key) for kind, key in CB3_3_15.static_bind(name, len(args), tuple(named)))


# --- binding


def test_slots_name_the_source_of_each_parameter() -> None:
    assert CB3_3_15.static_bind("movej", 1, ["r", "a"]) == [
        ("arg", 0),
        ("kw", "a"),
        ("default", 1.05),
        ("default", 0),
        ("kw", "r"),
    ]


def test_full_positional_call_is_the_identity() -> None:
    assert CB3_3_15.static_bind("speedj", 3) == [("arg", 0), ("arg", 1), ("arg", 2)]


def test_servoj_may_leave_out_its_ignored_arguments() -> None:
    assert bind("servoj", ([0] * 6,), {"t": 0.016, "gain": 200}) == ([0] * 6, 0, 0, 0.016, 0.1, 200)


def test_bind_orders_and_fills_in() -> None:
    assert bind("socket_open", ("192.0.2.1", 50001)) == ("192.0.2.1", 50001, "socket_0")
    assert bind("socket_read_binary_integer", (7,), {"timeout": 0.1}) == (7, "socket_0", 0.1)
    assert bind("sync", ()) == ()


@pytest.mark.parametrize(
    ("version", "name", "n_positional", "keywords", "text"),
    [
        ("3.15", "speedl", 2, ["t_min"], "speedl() got an unexpected keyword argument 't_min'"),
        ("3.15", "str_at", 1, [], "str_at takes exactly 2 arguments (1 given)"),
        ("3.15", "sync", 1, [], "sync takes exactly 0 arguments (1 given)"),
        ("3.15", "set_tcp", 0, [], "set_tcp takes exactly 1 argument (0 given)"),
        ("3.15", "movej", 0, [], "movej takes exactly 1 to 5 arguments (0 given)"),
        ("3.15", "movej", 6, [], "movej takes exactly 1 to 5 arguments (6 given)"),
        ("3.15", "str_sub", 1, [], "str_sub takes exactly 2 or 3 arguments (1 given)"),
        ("3.15", "socket_open", 1, ["socket_name"], "socket_open() missing required argument 'port'"),
        ("3.15", "movej", 1, ["q"], "movej() got multiple values for keyword argument 'q'"),
        ("3.15", "movej", 1, ["a", "a"], "movej() got multiple values for keyword argument 'a'"),
    ],
)
def test_wrong_calls(version: str, name: str, n_positional: int, keywords: list[str], text: str) -> None:
    catalogue = catalogue_for(version)
    with pytest.raises(ScriptTypeError) as caught:
        catalogue.static_bind(name, n_positional, keywords)
    assert caught.value.message == text
    assert caught.value.hint == f"use {catalogue[name].signature}"
    assert caught.value.wire_text == f"Type error: {text}"


@pytest.mark.parametrize(
    ("version", "name", "n_positional", "keywords", "hint"),
    [
        ("3.15", "modbus_add_signal", 7, [], "5.15, PolyScope X 10.0; this is CB3 3.15"),
        ("5.12", "modbus_add_signal", 5, ["register_count"], "5.15, PolyScope X 10.0; this is e-Series 5.12"),
        ("3.15", "freedrive_mode", 1, [], "5.10, PolyScope X 10.0; this is CB3 3.15"),
    ],
)
def test_a_call_that_other_software_knows_names_it(
    version: str, name: str, n_positional: int, keywords: list[str], hint: str
) -> None:
    with pytest.raises(ScriptTypeError) as caught:
        catalogue_for(version).static_bind(name, n_positional, keywords)
    assert caught.value.hint == f"with these arguments it is known since e-Series {hint}"


@pytest.mark.parametrize(
    "row", [row for row in ALL_ROWS if not row.any_names], ids=lambda row: f"{row.name}-{row.since}"
)
def test_every_row_binds_its_shortest_and_longest_call(row: Builtin) -> None:
    required = [param for param in row.params if param.is_required]
    shortest = static_bind(row, len(required))
    assert [slot[0] for slot in shortest] == ["arg"] * len(required) + ["default"] * (
        len(row.params) - len(required)
    )
    assert static_bind(row, len(row.params)) == [("arg", i) for i in range(len(row.params))]


def test_a_struct_takes_named_arguments_of_any_name() -> None:
    rows = catalogue_for("5.15")
    assert rows.static_bind("struct", 0, ["x", "y"]) == [("kw", "x"), ("kw", "y")]
    for form in ((0, []), (1, ["x"])):
        with pytest.raises(ScriptTypeError, match="takes one or more named arguments"):
            rows.static_bind("struct", *form)
    with pytest.raises(ScriptTypeError, match="multiple values for keyword argument 'x'"):
        rows.static_bind("struct", 0, ["x", "y", "x"])


@given(data=st.data(), row=st.sampled_from(sorted(CB3_3_15, key=lambda row: row.name)))
def test_any_split_into_positional_and_named_binds_the_same(data: st.DataObject, row: Builtin) -> None:
    values: dict[str, Any] = {param.name: object() for param in row.params}
    n_positional = data.draw(st.integers(0, len(values)))
    named = data.draw(st.permutations(list(values)[n_positional:]))
    positional = list(values.values())[:n_positional]
    bound = bind(row.name, positional, {name: values[name] for name in named})
    assert bound == tuple(values.values())


# --- values


Q = [0.0, -1.57, 1.57, -1.57, -1.57, 0]
POSE = Pose(0.1, 0.2, 0.3, 0, 3.14, 0)


def check(name: str, *args: Any) -> None:
    CB3_3_15.check_of(name)(bind(name, args))


def refusal(name: str, *args: Any) -> str:
    with pytest.raises(ScriptRuntimeError) as caught:
        check(name, *args)
    return caught.value.message


@pytest.mark.parametrize(
    "call",
    [
        ("movej", Q),
        ("movej", POSE, 1, 2.5, 0, 0),
        ("movel", Q),
        ("movel", POSE),
        ("speedj", Q, 0.5),
        ("speedj", Q, 1, 0.008),
        ("speedj", Q, 1, None),
        ("speedl", POSE, 1, 1, None),
        ("speedl", [0, 0, 0.1, 0, 0, 0], 1),
        ("get_inverse_kin", POSE),
        ("get_inverse_kin", POSE, Q),
        ("get_forward_kin",),
        ("set_payload", 1, [0, 0, 0.1]),
        ("set_standard_digital_out", 7, True),
        ("set_standard_digital_out", 4.0, True),
        ("write_output_float_register", 24, math.nan),
        ("write_output_integer_register", 24, 2.5),
        ("textmsg", Matrix([[1]]), None),
        ("socket_send_string", 0.5),
        ("socket_read_binary_integer", 30, "s", -1),
        ("popup", 3),
    ],
)
def test_accepted(call: tuple[Any, ...]) -> None:
    check(*call)


@pytest.mark.parametrize(
    "call",
    [
        ("get_inverse_kin", Q),
        ("get_inverse_kin_has_solution", 1),
        ("get_forward_kin", Q, Q),
        ("set_tcp", [0, 0, 0, 0, 0, 0]),
        ("pose_trans", POSE, Q),
    ],
)
def test_pose_text_is_the_controllers(call: tuple[Any, ...]) -> None:
    assert refusal(*call) == f"{call[0]}: Parameter must be a Pose on the form p[x,y,z,a,b,c]"


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (
            ("movej", [0, 0, 0]),
            "movej: Parameter 'q' must be a Pose on the form p[x,y,z,a,b,c] or a list of 6 joint positions, "
            "got a list of 3",
        ),
        (("speedj", POSE, 1), "speedj: Parameter 'qd' must be a list of 6 numbers, got a pose"),
        (
            ("speedj", [0, 0, 0, True, 0, 0], 1),
            "speedj: Parameter 'qd' must be a list of 6 numbers, got a list of 6 with a bool in it",
        ),
        (("speedj", Q, "fast"), "speedj: Parameter 'a' must be a number, got the string \"fast\""),
        (("stopj", True), "stopj: Parameter 'a' must be a number, got the bool True"),
        (("stopj", None), "stopj: Parameter 'a' must be a number, got None"),
        (("sleep", Matrix([[1]])), "sleep: Parameter 't' must be a number, got a matrix"),
        (
            ("set_standard_digital_out", 1, 1),
            "set_standard_digital_out: Parameter 'b' must be True or False, got the int 1",
        ),
        (("get_flag", 1.5), "get_flag: Parameter 'n' must be an integer, got the float 1.5"),
        (("socket_open", 1, 2), "socket_open: Parameter 'address' must be a string, got the int 1"),
        (("set_gravity", [0, 0]), "set_gravity: Parameter 'd' must be a list of 3 numbers, got a list of 2"),
    ],
)
def test_wrong_types(call: tuple[Any, ...], text: str) -> None:
    assert refusal(*call) == text


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (
            ("speedj", [0, 0, math.nan, 0, 0, 0], 1),
            "speedj: Parameter 'qd' must be finite, got [0, 0, nan, 0, 0, 0]",
        ),
        (("speedj", Q, math.inf), "speedj: Parameter 'a' must be finite, got inf"),
        (
            ("movej", Pose(0, 0, -math.inf, 0, 0, 0)),
            "movej: Parameter 'q' must be finite, got [0.0, 0.0, -inf, 0.0, 0.0, 0.0]",
        ),
        (("sleep", math.nan), "sleep: Parameter 't' must be finite, got nan"),
        (
            ("write_output_integer_register", 1, math.nan),
            "write_output_integer_register: Parameter 'value' must be finite, got nan",
        ),
    ],
)
def test_not_finite(call: tuple[Any, ...], text: str) -> None:
    assert refusal(*call) == text


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (("get_flag", 32), "get_flag: Parameter 'n' must be in the range 0 to 31, got 32"),
        (
            ("get_tool_digital_in", -1),
            "get_tool_digital_in: Parameter 'n' must be in the range 0 to 1, got -1",
        ),
        (
            ("read_input_float_register", 48),
            "read_input_float_register: Parameter 'address' must be in the range 0 to 47, got 48",
        ),
        (
            ("read_input_boolean_register", 128),
            "read_input_boolean_register: Parameter 'address' must be in the range 0 to 127, got 128",
        ),
        (("set_payload_mass", -1), "set_payload_mass: Parameter 'm' must be at least 0, got -1"),
        (("set_tool_voltage", 5), "set_tool_voltage: Parameter 'voltage' must be one of 0, 12, 24, got 5"),
        (
            ("set_standard_digital_input_action", 0, "stop"),
            "set_standard_digital_input_action: Parameter 'action' must be one of default, freedrive, "
            "got stop",
        ),
    ],
)
def test_out_of_range(call: tuple[Any, ...], text: str) -> None:
    assert refusal(*call) == text


def test_long_strings_are_cut_in_messages() -> None:
    assert refusal("stopj", "x" * 200).endswith('got the string "' + "x" * 40 + '..."')
