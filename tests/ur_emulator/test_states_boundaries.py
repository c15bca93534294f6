"""Safety planes and the cone of the tool beside what chunks show (`chunks/watched/boundaries.script`)."""

import math

import numpy as np
import pytest
from box_support import Bench
from hypothesis import given
from hypothesis import strategies as st
from states_support import modes

from protocol.pose import rotvec_to_matrix
from protocol.primary.messages import ReportLevel
from protocol.ur_types import SafetyMode
from ur_emulator.errors import ArgumentError, RefusedError
from ur_emulator.machine.commands.safety import LimitToolDirection, SetSafetyPlane
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.controller.safety.boundaries import (
    DIRECTION_TOLERANCE,
    MOST_PLANES,
    PLANE_TOLERANCE,
    TRIGGER_BAND,
    BoundaryMode,
    SafetyPlane,
    ToolDirection,
)
from ur_emulator.machine.kinematics.arm_model import ArmModel
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.models.robot_model import ZERO6
from ur_emulator.machine.models.robots import robot_by_name

GENERATIONS = pytest.mark.parametrize(
    "arm", [{}, {"robot": "ur5e", "generation": E_SERIES}], ids=["CB3", "e"]
)
TURN = "movej([q[0] {}, q[1], q[2], q[3], q[4], q[5]], a=3, v={})\n"


def turn(angle, speed=1.0):
    return "q = get_actual_joint_positions()\n" + TURN.format(f"+ {angle}", speed)


def codes(bench):
    return [(e.code, e.argument, e.level) for e in bench.events if isinstance(e, ErrorReported) and e.code]


def tcp(bench):
    return np.array(bench.now.actual_tcp_pose[:3])


def ahead(bench, distance):
    """A point so far from the TCP along its way when joint 1 turns in the positive sense, and the way back."""
    x, y, _ = tcp(bench)
    way = np.array([-y, x, 0.0]) / math.hypot(x, y)
    return (tcp(bench) + distance * way).tolist(), (-way).tolist()


def plane(position, normal, mode="normal", name="wall", **more):
    return SetSafetyPlane(name, position, normal, mode, **more)


def gap(command, snapshot, of="actual"):
    normal = np.array(command.normal) / np.linalg.norm(command.normal)
    return float(normal @ (np.array(getattr(snapshot, f"{of}_tcp_pose")[:3]) - command.position))


# --- strict limits


@pytest.mark.parametrize(
    ("robot", "seed", "kind"),
    [("ur10", 1, "movej"), ("ur10", 1, "servoj"), ("ur20", 2, "movej"), ("ur20", 2, "speedj"), ("ur20", 4, "servoj"), ("ur5e", 3, "speedj")],
)  # fmt: skip
def test_a_heavy_arm_on_a_curved_path_ends_before_a_plane(robot, seed, kind):
    draw = np.random.default_rng(seed)
    bench = Bench(robot=robot, generation=CB3 if robot == "ur10" else E_SERIES, seed=seed)
    q = np.array(bench.now.actual_q)
    way = draw.choice([-1.0, 1.0], 6) * draw.uniform(0.5, 1.0, 6)
    ahead_of = np.array(ArmModel(bench.controller.state.robot).fk((q + 0.3 * way).tolist())[:3])
    normal = tcp(bench) - ahead_of
    wall = plane((tcp(bench) - 0.6 * normal).tolist(), normal.tolist())
    bench.tick(1, wall)
    period, goal = bench.controller.period_s, (q + way).tolist()
    steps = ", ".join(f"{start} + {rate} * t" for start, rate in zip(q, 1.5 * way, strict=True))
    load = 0.3 * bench.controller.state.robot.payload_max
    bench.run(
        f"set_payload({load}, [0.05, 0.0, 0.15])\n"
        + {
            "movej": f"movej({goal}, a=8, v=2)\n",
            "speedj": f"speedj({(1.5 * way).tolist()}, 8, 0.6)\n",
            "servoj": f"t = 0.0\nwhile t < 0.6:\n  t = t + {period}\n  servoj([{steps}], t={period})\nend\n",
        }[kind]
    )
    assert codes(bench) == [(152, 0, ReportLevel.WARNING)]
    assert min(gap(wall, snapshot, "target") for snapshot in bench.snapshots) > 0.9 * PLANE_TOLERANCE
    assert min(gap(wall, snapshot) for snapshot in bench.snapshots) > 0.0


@pytest.mark.parametrize("restricts", [False, True])
def test_the_elbow_is_held_where_the_plane_restricts_it(restricts):
    bench = Bench(fidelity="exact")
    elbow = np.array(bench.now.space.actual.elbow_position)
    way = (elbow - tcp(bench)) * (1.0, 1.0, 0.0)  # the TCP is on the other side, and stays behind
    way /= np.linalg.norm(way)
    rate = ARM.state(bench.now.actual_q, (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)).elbow_velocity
    bench.tick(1, plane((elbow + 0.05 * way).tolist(), (-way).tolist(), restrict_elbow=restricts))
    move = TURN.replace("q[1]", f"q[1] + {math.copysign(0.4, way @ rate)}").format("", 1.0)
    bench.run("q = get_actual_joint_positions()\n" + move)
    texts = [e.text for e in bench.events if isinstance(e, ErrorReported) and e.code == 152]
    assert [("elbow" in text, "plane 'wall'" in text) for text in texts] == [(True, True)] * restricts


# --- the trigger


@GENERATIONS
def test_a_plane_triggers_reduced_mode_and_gives_it_back_20_mm_behind_it(arm):
    bench = Bench(**arm)
    wall = plane(*ahead(bench, 0.1), "trigger reduced mode")
    bench.tick(1, wall)
    bench.run(turn(0.5, 0.4))
    assert modes(bench) == ["REDUCED"]
    entered = next(s for s in bench.snapshots if s.safety_mode == SafetyMode.REDUCED)
    assert -0.02 < gap(wall, entered) <= 0.001
    first = len(bench.snapshots)
    bench.run(turn(-0.5, 0.4))
    assert modes(bench) == ["REDUCED", "NORMAL"]
    left = next(s for s in bench.snapshots[first:] if s.safety_mode == SafetyMode.NORMAL)
    assert TRIGGER_BAND - 0.001 < gap(wall, left) < TRIGGER_BAND + 0.02


# --- the tool's direction


def axis_of(bench):
    return rotvec_to_matrix(bench.now.actual_tcp_pose[3:])[:, 2]


@GENERATIONS
def test_a_program_ends_before_the_tool_leaves_its_cone(arm):
    bench = Bench(**arm)
    axis = axis_of(bench)
    bench.tick(1, LimitToolDirection(axis.tolist(), 0.5))
    bench.run(
        "q = get_actual_joint_positions()\nmovej([q[0], q[1], q[2], q[3] + 1.0, q[4], q[5]], a=3, v=1)\n"
    )
    assert codes(bench) == [(151, 0, ReportLevel.WARNING)]
    angles = [
        math.acos(min(1.0, axis @ rotvec_to_matrix(s.actual_tcp_pose[3:])[:, 2])) for s in bench.snapshots
    ]
    assert 0.5 - 2.0 * DIRECTION_TOLERANCE < max(angles) < 0.5


# --- programs, costs, arguments


def test_a_box_without_boundaries_computes_nothing_for_them(monkeypatch):
    bench = Bench()
    calls = []
    state = ArmModel.state
    monkeypatch.setattr(ArmModel, "state", lambda *args: calls.append(1) or state(*args))
    bench.run(turn(0.3))
    none = len(calls)
    bench.tick(1, plane(*ahead(bench, 2.0)))
    bench.run(turn(-0.3))
    assert len(calls) - none > 0.9 * (len(bench.snapshots) - 2) / 2
    assert none == 0


def test_a_box_has_eight_planes_by_name():
    bench = Bench()
    far = ahead(bench, 2.0)
    bench.tick(1, *(plane(*far, name=f"p{n}") for n in range(MOST_PLANES)))
    limits = bench.controller.state.safety.limits
    assert [row.name for row in limits.boundaries.planes] == [f"p{n}" for n in range(MOST_PLANES)]
    with pytest.raises(RefusedError, match="there are 8 planes, no more are possible: give the name of one"):
        plane(*far, name="one more").apply(bench.controller)
    plane(*far, "disabled", name="p3").apply(bench.controller)
    named = {row.name: row.mode for row in bench.controller.state.safety.limits.boundaries.planes}
    assert (len(named), named["p3"]) == (MOST_PLANES, BoundaryMode.DISABLED)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: plane((0, 0, 0), (0, 0, 0)), r"direction \[.*\] given: its length must be at least 1e-06"),
        (lambda: plane((0, 0, 0), (0, 0, 1), name=""), "safety plane without a name"),
        (lambda: plane((0, 0), (0, 0, 1)), "three"),
        (lambda: plane((0, 0, 0), (0, 0, 1), "sometimes"), "trigger reduced mode"),
        (lambda: LimitToolDirection((0, 0, 1), 0.01), "deviation"),
        (lambda: LimitToolDirection((0, 0, 0), 1.0), "its length must be"),
        (lambda: LimitToolDirection((0, 0, 1), 1.0, "trigger reduced mode"), "mode"),
    ],
)
def test_what_makes_no_boundary_is_refused(make, words):
    with pytest.raises(ArgumentError, match=words):
        make()


UR3 = robot_by_name("ur3")
ARM = ArmModel(UR3)
angles = st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6)
units = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(lambda v: math.hypot(*v) > 0.1)


@given(q=angles, direction=units, point=units)
def test_gaps_are_distances_along_the_normal_and_angles_from_the_axis(q, direction, point):
    length = math.hypot(*direction)
    unit = tuple(part / length for part in direction)
    arm = ARM.state(q, ZERO6)
    wall = SafetyPlane("w", point, unit, BoundaryMode.NORMAL, restricts_elbow=True)
    places = {"TCP": arm.tcp_pose[:3], "elbow": arm.elbow_position}
    assert dict(wall.gaps(arm)) == {
        name: pytest.approx(np.dot(unit, np.subtract(place, point)), abs=1e-12)
        for name, place in places.items()
    }
    cosine = float(np.dot(unit, rotvec_to_matrix(arm.tcp_pose[3:])[:, 2]))
    left = ToolDirection(unit, 1.0, BoundaryMode.NORMAL).gap(arm)
    assert left == pytest.approx(1.0 - math.acos(max(-1.0, min(1.0, cosine))), abs=1e-6)
