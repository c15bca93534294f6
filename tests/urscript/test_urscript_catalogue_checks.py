"""Run-time checks of arguments: what passes, what does not, and with which words."""

from __future__ import annotations

import math
from typing import Any

import pytest
from binding_support import bind

from urscript.catalogue import CB3_3_15
from urscript.errors import ScriptRuntimeError
from urscript.values import Matrix, Pose

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
