"""Values and the pure builtins as laws: against numpy, scipy and their own inverses.

The manual's examples and the texts of errors are in `chunks/builtins_*.script`.
"""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from program_texts import numbers
from scipy.spatial.transform import Rotation

from urscript.builtins import PURE, pure_builtins
from urscript.catalogue import catalogue_for
from urscript.errors import ScriptRuntimeError
from urscript.run import runtime
from urscript.values import Matrix, Pose, wrap_int

ROWS = catalogue_for("5.25")


def call(name: str, *args: Any) -> Any:
    return PURE[name](*ROWS.fittings[name](args))


def refusal(name: str, *args: Any) -> str:
    with pytest.raises(ScriptRuntimeError) as caught:
        call(name, *args)
    return caught.value.message


# --- values


def test_a_pose_has_six_elements() -> None:
    with pytest.raises(ScriptRuntimeError, match="6 elements, not 5"):
        Pose.of([1] * 5)


@given(st.integers(-(2**70), 2**70))
def test_wrapping_is_congruent_and_in_range(value: int) -> None:
    wrapped = wrap_int(value)
    assert -(2**31) <= wrapped < 2**31
    assert (wrapped - value) % 2**32 == 0


@given(numbers, numbers)
def test_remainder_and_quotient_belong_together(a: float, b: float) -> None:
    if b == 0:
        with pytest.raises(ScriptRuntimeError, match="modulo by zero"):
            runtime.mod(a, b)
        return
    rest = runtime.mod(a, b)
    assert rest == math.fmod(a, b)
    assert type(rest) is (int if type(a) is type(b) is int else float)


# --- numbers


REALS = st.floats(-1e6, 1e6)


def test_random_follows_from_the_seed() -> None:
    first, same, other = (pure_builtins(seed)["random"] for seed in (7, 7, 8))
    numbers = [first() for _ in range(200)]
    assert numbers == [same() for _ in range(200)]
    assert numbers != [other() for _ in range(200)]
    assert "random" not in PURE


# --- poses


LENGTHS = st.floats(-2, 2)
VECTORS = st.lists(st.floats(-3, 3), min_size=3, max_size=3)
POSES = st.builds(lambda p, r: Pose(*p, *r), st.lists(LENGTHS, min_size=3, max_size=3), VECTORS)
WRENCHES = st.lists(st.floats(-100, 100), min_size=6, max_size=6)


def transform(pose: Pose) -> NDArray[np.float64]:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(pose[3:]).as_matrix()
    T[:3, 3] = pose[:3]
    return T


@pytest.mark.parametrize("name", ["pose_add", "pose_sub", "pose_trans"])
@given(a=POSES, b=POSES)
def test_products_against_matrices(name: str, a: Pose, b: Pose) -> None:
    A, B = transform(a), transform(b)
    expected = A @ B
    if name != "pose_trans":
        turn, sign = (B[:3, :3], 1) if name == "pose_add" else (B[:3, :3].T, -1)
        expected[:3, :3], expected[:3, 3] = A[:3, :3] @ turn, A[:3, 3] + sign * B[:3, 3]
    result = call(name, a, b)
    assert isinstance(result, Pose)
    assert transform(result) == pytest.approx(expected, abs=1e-12)


@given(POSES)
def test_inverse_undoes(pose: Pose) -> None:
    assert transform(call("pose_inv", pose)) @ transform(pose) == pytest.approx(np.eye(4), abs=1e-12)
    assert np.linalg.norm(call("pose_inv", pose)[3:]) <= math.pi + 1e-12


@given(POSES, POSES)
def test_interpolation_ends_and_goes_on_beyond(a: Pose, b: Pose) -> None:
    assert transform(call("interpolate_pose", a, b, 0)) == pytest.approx(transform(a), abs=1e-9)
    assert transform(call("interpolate_pose", a, b, 1)) == pytest.approx(transform(b), abs=1e-9)
    middle = call("interpolate_pose", a, b, 0.5)
    turn = Rotation.from_rotvec(a[3:]).inv() * Rotation.from_rotvec(b[3:])
    half = Rotation.from_rotvec(a[3:]).inv() * Rotation.from_rotvec(middle[3:])
    if turn.magnitude() < 3:  # nearer pi the shortest turn is not unique
        assert half.as_rotvec() == pytest.approx(turn.as_rotvec() / 2, abs=1e-7)
    assert call("interpolate_pose", a, b, 2)[0] == pytest.approx(2 * b[0] - a[0], abs=1e-12)


@given(POSES, POSES)
def test_the_distance_of_poses_is_that_of_points_and_turns(a: Pose, b: Pose) -> None:
    turn = (Rotation.from_rotvec(b[3:]) * Rotation.from_rotvec(a[3:]).inv()).magnitude()
    assert call("pose_dist", a, b) == pytest.approx(math.hypot(call("point_dist", a, b), turn), abs=1e-7)


@given(VECTORS)
def test_roll_pitch_yaw_against_scipy(vector: list[float]) -> None:
    rotation = Rotation.from_rotvec(vector)
    roll, pitch, yaw = call("rotvec2rpy", vector)
    assert Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix() == pytest.approx(
        rotation.as_matrix(), abs=1e-7
    )
    again = Rotation.from_rotvec(call("rpy2rotvec", [roll, pitch, yaw]))
    assert again.as_matrix() == pytest.approx(rotation.as_matrix(), abs=1e-7)


@given(POSES, POSES, WRENCHES)
def test_wrenches_chain_like_frames(a: Pose, b: Pose, wrench: list[float]) -> None:
    chained = call("wrench_trans", b, call("wrench_trans", a, wrench))
    assert chained == pytest.approx(call("wrench_trans", call("pose_trans", a, b), wrench), abs=1e-9)
    assert np.linalg.norm(chained[:3]) == pytest.approx(float(np.linalg.norm(wrench[:3])), abs=1e-9)


@given(POSES, WRENCHES, WRENCHES)
def test_wrenches_keep_power(pose: Pose, wrench: list[float], twist: list[float]) -> None:
    # A twist (v, w) at "from" seen from "to": w' = R^T w, v' = R^T (v + w x p). Power is the same in both.
    T = transform(pose)
    R, p = T[:3, :3], T[:3, 3]
    v, w = np.array(twist[:3]), np.array(twist[3:])
    moved = np.concatenate([R.T @ (v + np.cross(w, p)), R.T @ w])
    power = float(np.dot(wrench, twist))
    assert float(np.dot(call("wrench_trans", pose, wrench), moved)) == pytest.approx(power, abs=1e-6)


# --- lists and matrices


INTS = st.integers(-(2**31), 2**31 - 1)


@given(hnp.arrays(np.float64, (3, 3), elements=st.floats(-10, 10)))
def test_inv_against_the_definition(array: np.ndarray) -> None:
    array = array + 40 * np.eye(3)  # far from singular
    inverse = np.array(call("inv", Matrix(array.tolist())).rows)
    assert inverse @ array == pytest.approx(np.eye(3), abs=1e-12)


@given(INTS, st.lists(st.booleans(), max_size=9))
def test_bits_round_trip_and_only_32_count(value: int, more: list[bool]) -> None:
    bits = call("integer_to_binary_list", value)
    assert len(bits) == 32
    assert call("binary_list_to_integer", bits + more) == value


# --- strings


BYTES = st.text(st.characters(max_codepoint=255), max_size=60)


@given(BYTES, st.integers(0, 60), st.integers(0, 60))
def test_str_sub_is_a_slice(text: str, index: int, length: int) -> None:
    if index > len(text):
        assert "out of bounds" in refusal("str_sub", text, index, length)
    else:
        assert call("str_sub", text, index, length) == text[index:][:length]


@given(BYTES, st.text(st.characters(max_codepoint=255), max_size=2), st.integers(0, 70))
def test_str_find_gives_the_first_place(text: str, target: str, start: int) -> None:
    place = call("str_find", text, target, start)
    places = [i for i in range(start, len(text) + 1) if text[i : i + len(target)] == target]
    assert place == (places[0] if places else -1)


@pytest.mark.parametrize("spelt", [" ", "1 ", "0x", "+", ".", "0x1.8", "e5", "１"])
def test_to_num_refuses(spelt: str) -> None:
    assert refusal("to_num", spelt) == f'to_num: string doesn\'t contain a valid number: "{spelt}"'


@given(INTS)
def test_ints_survive_text(value: int) -> None:
    assert call("to_num", call("to_str", value)) == value


@given(REALS)
def test_floats_survive_text_to_six_decimals(value: float) -> None:
    assert call("to_num", call("to_str", value)) == pytest.approx(value, abs=5.1e-7)
