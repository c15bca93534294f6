"""Binding of arguments to parameters, statically and at run time."""

from __future__ import annotations

from typing import Any

import pytest
from binding_support import bind
from hypothesis import given
from hypothesis import strategies as st

from urscript.catalogue import ALL_ROWS, CB3_3_15, Builtin, catalogue_for
from urscript.catalogue.calls import static_bind
from urscript.errors import ScriptTypeError


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
