import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urscript import Matrix, Pose, RecordingHost, ScriptRuntimeError, compile_program
from urscript.run import runtime
from urscript.values import log_form, str_form, type_name, wrap_int

numbers = st.one_of(
    st.integers(-(2**31), 2**31 - 1),
    st.floats(allow_nan=False, allow_infinity=False, width=32),
    st.sampled_from([0, 1, -1, 0.0, 2**31 - 1, -(2**31)]),
)


def test_pose_is_six_floats_that_never_change():
    pose = Pose(1, 2, 3, 4, 5, 6)
    changed = pose.with_item(0, 9)
    assert (pose[0], changed[0], type(changed)) == (1.0, 9.0, Pose)
    assert all(type(item) is float for item in pose)
    assert Pose.of([1, 2, 3, 4, 5, 6]) == pose
    with pytest.raises(ScriptRuntimeError, match="6 elements, not 5"):
        Pose.of([1] * 5)


def test_matrix_is_rectangular():
    matrix = Matrix([[1, 2, 3], [4, 5, 6]])
    assert (matrix.shape, matrix[1, 2]) == ((2, 3), 6)
    assert matrix.with_item(0, 0, 9) == Matrix([[9, 2, 3], [4, 5, 6]])
    assert matrix[0, 0] == 1
    with pytest.raises(ScriptRuntimeError, match="equal length"):
        Matrix([[1], [1, 2]])
    with pytest.raises(ScriptRuntimeError, match="numbers only, got a bool"):
        Matrix([[True]])


@pytest.mark.parametrize(
    ("value", "as_text", "in_log"),
    [
        (1.0, "1", "1"),
        (2.123456123456, "2.123456", "2.12346"),
        (-0.01113684999, "-0.011137", "-0.0111368"),
        (100.0, "100", "100"),
        (1e-9, "0", "1e-09"),
        (1234567.0, "1234567", "1.23457e+06"),
        (True, "True", "True"),
        (None, "None", "None"),
        ("as it is", "as it is", "as it is"),
        ([1, 2.5], "[1, 2.5]", "[1,2.5]"),
        ([True, False, True], "[True, False, True]", "[True,False,True]"),
        (Pose(1, 2, 3, 4, 5, 6), "p[1, 2, 3, 4, 5, 6]", "p[1,2,3,4,5,6]"),
        (Matrix([[1, 2], [3, 4]]), "[[1, 2], [3, 4]]", "[[1,2],[3,4]]"),
        ([], "[]", "[]"),
    ],
)
def test_text_forms(value, as_text, in_log):
    assert (str_form(value), log_form(value)) == (as_text, in_log)


def test_types_have_the_names_of_the_language():
    values = [None, True, 1, 1.0, "", [], Matrix([[1]]), Pose(0, 0, 0, 0, 0, 0)]
    names = ["none", "bool", "int", "float", "string", "list", "matrix", "pose"]
    assert [type_name(value) for value in values] == names


@given(st.integers(-(2**70), 2**70))
def test_wrapping_is_congruent_and_in_range(value):
    wrapped = wrap_int(value)
    assert -(2**31) <= wrapped < 2**31
    assert (wrapped - value) % 2**32 == 0


@given(numbers, numbers)
def test_remainder_and_quotient_belong_together(a, b):
    if b == 0:
        with pytest.raises(ScriptRuntimeError, match="modulo by zero"):
            runtime.mod(a, b)
        return
    rest = runtime.mod(a, b)
    assert rest == math.fmod(a, b)
    assert type(rest) is (int if type(a) is type(b) is int else float)


OPERATORS = ["+", "-", "*", "/", "%", "==", "!=", "<", "<=", ">", ">="]


@given(numbers, numbers)
def test_evident_types_and_unknown_types_compute_the_same(a, b):
    """The compiler's shortcuts for known types must not differ from the general operators."""
    left, right = (f"({value!r})" for value in (a, b))
    text = ["def hidden(x):", "  return x", "end", "if False:", '  hidden("")', "end"]
    for operator in OPERATORS:
        if b == 0 and operator in "/%":
            continue
        text += [
            f"x = {left}\ny = {right}" if operator == "+" else "",
            f"textmsg(to_str(x {operator} y))",
            f"textmsg(to_str(hidden(x) {operator} hidden(y)))",
            f"textmsg(to_str(x {operator} hidden(y)))",
        ]
    text += ["textmsg(to_str(-x))", "textmsg(to_str(-hidden(x)))", "textmsg(to_str(-hidden(x)))"]
    host = RecordingHost()
    running = host.run(compile_program("\n".join(text)))
    assert running.error is None, running.error.render()
    for n in range(0, len(host.messages), 3):
        assert len(set(host.messages[n : n + 3])) == 1, (a, b, n, host.messages[n : n + 3])
