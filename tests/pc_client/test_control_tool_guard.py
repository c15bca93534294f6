"""The guard of the tool: trailing along the path is allowed, leaving it is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from control_loop import PERIOD, Ramp, recipe
from hypothesis import given
from hypothesis import strategies as st

from pc_client.control.identification import Excitation
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import AHEAD, BEHIND, ToolGuard
from pc_client.errors import DriverError
from pc_client.kinematics.model import robot_model, tcp_jacobian

UR3 = robot_model("ur3")
POSTURE = np.array([0.4, -1.77, -2.1, -0.1, 1.3, 1.86])
DISPLACEMENT = np.array([0.5, 0.3, -0.4, 0.2, -0.1, 0.3])
LEAD, SETTLE, DURATION = 0.2, 0.3, 2.0
ALLOWED, ALLOWED_ANGLE = 0.005, 0.035


class ThereAndBack:
    """A smooth way out and the same way back."""

    duration = DURATION

    def at(self, t):
        w = 2 * np.pi / self.duration
        t = min(max(t, 0.0), self.duration)
        return POSTURE + DISPLACEMENT * (0.5 - 0.5 * np.cos(w * t)), DISPLACEMENT * 0.5 * w * np.sin(w * t)


REFERENCES = {
    "there and back": ThereAndBack(),
    "a line": Ramp(DISPLACEMENT, DURATION, POSTURE),
    "excitation": Excitation(POSTURE.tolist()),
    "wrist 3 alone": Ramp([0, 0, 0, 0, 0, 1.0], DURATION, POSTURE),
}
TABLES = {name: ReferenceTable(reference, recipe()) for name, reference in REFERENCES.items()}
GUARDS = {name: ToolGuard(table, UR3, ALLOWED, ALLOWED_ANGLE) for name, table in TABLES.items()}

names = st.sampled_from(list(REFERENCES))
times = st.floats(-LEAD, DURATION + SETTLE)
directions = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).filter(lambda x: np.linalg.norm(x) > 0.1)


def moved_aside(name, t, direction, distance, angle=0.0):
    """Joints whose tool is so far off, square to the path, and turned about it."""
    q, qd = REFERENCES[name].at(t)
    jacobian = tcp_jacobian(UR3, q)
    along = jacobian[:3] @ qd
    aside = np.array(direction, dtype=float)
    if np.linalg.norm(along) > 1e-9:
        along /= np.linalg.norm(along)
        aside -= (aside @ along) * along
    aside /= np.linalg.norm(aside)
    return (q + np.linalg.solve(jacobian, np.concatenate([distance * aside, angle * aside]))).tolist()


@given(name=names, t=times, late=st.floats(-AHEAD, BEHIND - 0.01))
def test_an_arm_that_trails_along_its_path_is_on_it(name, t, late):
    q = REFERENCES[name].at(t - late)[0]
    distance, angle = GUARDS[name].deviation(t, q)
    assert distance < 1e-4
    assert angle < 1e-3
    GUARDS[name].check(t, list(q))


@given(t=st.floats(0.2, DURATION - 0.2), direction=directions, distance=st.floats(0.0, 0.02))
def test_the_distance_from_a_line_is_that_by_which_the_arm_was_moved_aside(t, direction, distance):
    measured, _ = GUARDS["a line"].deviation(t, moved_aside("a line", t, direction, distance))
    # the path of the tool is curved, and so are the joints
    assert measured == pytest.approx(distance, rel=0.05, abs=2e-4)


@given(name=names, t=times, direction=directions)
def test_within_the_tolerance_a_run_goes_on_and_beyond_it_ends(name, t, direction):
    guard = GUARDS[name]
    guard.check(t, moved_aside(name, t, direction, 0.8 * ALLOWED))
    with pytest.raises(DriverError, match="off its path"):
        # twice as far: the excitation's path is short and comes near to itself
        guard.check(t, moved_aside(name, t, direction, 2.5 * ALLOWED))


@given(name=st.sampled_from(["there and back", "a line", "excitation"]), t=times)
def test_a_turn_of_wrist_3_ends_a_run_although_the_flange_stays(name, t):
    q = np.array(REFERENCES[name].at(t)[0])
    turn = np.array([0, 0, 0, 0, 0, 1.0])
    guard = GUARDS[name]
    guard.check(t, (q + 0.8 * ALLOWED_ANGLE * turn).tolist())
    with pytest.raises(DriverError, match="off its path"):
        # the paths turn wrist 3 by up to one degree in the time around
        guard.check(t, (q + 6.0 * ALLOWED_ANGLE * turn).tolist())


@given(angle=st.floats(-3.1, 3.1))
def test_the_angle_is_that_by_which_the_tool_was_turned(angle):
    distance, measured = GUARDS["a line"].deviation(-LEAD, POSTURE + np.array([0, 0, 0, 0, 0, angle]))
    assert distance < 1e-9
    assert measured == pytest.approx(abs(angle), abs=1e-6)


@given(bad=st.integers(0, 5), value=st.sampled_from([math.nan, math.inf]))
def test_what_is_no_number_ends_a_run(bad, value):
    q = POSTURE.copy()
    q[bad] = value
    with pytest.raises(DriverError, match="off its path"):
        GUARDS["a line"].check(0.0, q.tolist())


def test_an_arm_that_stands_still_ends_a_run():
    guard = GUARDS["a line"]
    q = REFERENCES["a line"].at(0.5)[0].tolist()
    guard.check(0.5 + BEHIND, q)
    with pytest.raises(DriverError, match="off its path"):
        guard.check(0.5 + BEHIND + 0.1, q)


def test_the_message_is_one_line_with_how_far_where_when_and_what_is_allowed():
    with pytest.raises(DriverError) as caught:
        GUARDS["a line"].check(1.0, moved_aside("a line", 1.0, (0, 0, 1), 0.009, 0.02))
    text = str(caught.value)
    assert "\n" not in text
    for words in (
        "9.",
        " mm and 1.",
        "deg",
        "t = 1.000 s",
        " m; allowed is 5 mm (path_tolerance)",
        "2.0 deg",
    ):
        assert words in text


@given(
    st.lists(st.tuples(st.floats(-AHEAD, BEHIND), st.floats(0.0, 0.008), st.floats(0.0, 0.05)), max_size=40)
)
def test_where_the_tool_was_a_frame_ago_does_not_change_the_answer(frames):
    guard = ToolGuard(TABLES["there and back"], UR3, ALLOWED, ALLOWED_ANGLE)
    for k, (late, aside, turn) in enumerate(frames):
        t = 0.5 + 5 * k * PERIOD
        q = moved_aside("there and back", t - late, (0, 0, 1), aside, turn)
        distance, angle = guard.deviation(t, q)
        if distance <= ALLOWED and angle <= ALLOWED_ANGLE:
            guard.check(t, q)
        else:
            with pytest.raises(DriverError):
                guard.check(t, q)
