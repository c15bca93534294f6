"""The controller: what a frame says agrees with everything else it says; what programs do, ask and set."""

import math

import numpy as np
import pytest
from box_support import Bench
from plant_support import dh_frames

from protocol.pose import pose_to_T
from protocol.realtime.layout import SNAPSHOT_FIELDS
from ur_emulator.errors import ArgumentError
from ur_emulator.machine.commands.programs import AnswerRequest
from ur_emulator.machine.controller.safety.limit_checks import MAX_POSITION_DEVIATION
from ur_emulator.machine.controller.settings import ErrorSettings
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.arm_plant import PlantState
from ur_emulator.machine.plant.sensors import Reading

MOVE = "def move():\n  movej([0.6,-1.2,-1.9,-0.5,1.0,1.2], a=1.4, v=1.05)\nend\n"


@pytest.fixture(scope="module")
def moved():
    bench = Bench()
    bench.run(MOVE)
    return bench


def test_the_snapshot_has_every_column_of_the_realtime_interface():
    assert all(hasattr(Snapshot, name) for name in SNAPSHOT_FIELDS)
    assert set(SNAPSHOT_FIELDS) <= set(Bench().now.as_dict())


def test_what_the_sensors_say_keeps_its_names_to_the_snapshot():
    """Records follow each other by position: their names and order must agree."""
    assert Snapshot._fields[2:5] == tuple(f"target_{name}" for name in JointTarget._fields)
    assert Snapshot._fields[5 : 5 + len(PlantState._fields)] == PlantState._fields
    assert PlantState._fields[: len(Reading._fields)] == Reading._fields


def test_every_value_is_finite_in_motion(moved):
    for snapshot in moved.snapshots:
        for name, value in snapshot.as_dict().items():
            if name not in ("program_name", "registers"):
                assert np.isfinite(value).all(), name


def test_tcp_and_elbow_are_the_forward_kinematics_of_the_same_frame(moved):
    arm = moved.controller.state.arm
    rows = arm.dh
    for snapshot in moved.snapshots[::20]:
        for q, pose in (
            (snapshot.actual_q, snapshot.actual_tcp_pose),
            (snapshot.target_q, snapshot.target_tcp_pose),
        ):
            assert np.allclose(pose_to_T(pose), dh_frames(rows, q)[-1], atol=1e-9)
        assert np.allclose(snapshot.elbow_position, dh_frames(rows, snapshot.actual_q)[1, :3, 3], atol=1e-9)
        assert snapshot.timestamp == snapshot.tick * 8 / 1000


def test_tcp_speed_is_the_derivative_of_the_tcp_pose(moved):
    dt = moved.controller.period_s
    targets = moved.snapshots
    for k in range(40, 120, 10):
        difference = np.subtract(targets[k + 1].target_tcp_pose[:3], targets[k - 1].target_tcp_pose[:3]) / (
            2 * dt
        )
        assert np.allclose(difference, targets[k].target_tcp_speed[:3], atol=2e-3)


def test_target_velocity_is_the_derivative_of_the_target_position(moved):
    dt = moved.controller.period_s
    for before, after in zip(moved.snapshots[:-1], moved.snapshots[1:], strict=True):
        mean = np.add(before.target_qd, after.target_qd) / 2
        step = np.subtract(after.target_q, before.target_q) / dt
        assert np.allclose(step, mean, atol=1.4 * dt)


def test_tcp_offset_moves_the_pose_and_the_speed(bench):
    flange = pose_to_T(bench.now.actual_tcp_pose)
    bench.run("def t():\n  set_tcp(p[0,0,0.1,0,0,0])\n  sync()\nend\n")
    tcp = pose_to_T(bench.now.actual_tcp_pose)
    assert np.allclose(tcp[:3, 3], flange[:3, 3] + 0.1 * flange[:3, 2], atol=1e-4)
    assert bench.now.tcp_offset == (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)


def test_same_seed_same_numbers_other_seed_other_numbers():
    def run(seed):
        bench = Bench(seed=seed)
        bench.run(MOVE)
        return bench.snapshots

    first, again, other = run(3), run(3), run(4)
    assert first == again
    assert len(other) == len(first)
    assert all(a.actual_q != b.actual_q for a, b in zip(first[50:100], other[50:100], strict=True))


def test_momentum_is_mass_times_the_velocity_of_the_centres_of_mass(moved):
    arm = moved.controller.state.arm
    rows = arm.dh
    links = arm.robot.links
    snapshot = moved.snapshots[60]
    step = 1e-6

    def centres(q):
        return [(frame @ [*link.com, 1.0])[:3] for frame, link in zip(dh_frames(rows, q), links, strict=True)]

    q, qd = np.array(snapshot.actual_q), np.array(snapshot.actual_qd)
    before, after = centres(q - step * qd), centres(q + step * qd)
    momentum = sum(link.mass * (b - a) / (2 * step) for link, a, b in zip(links, before, after, strict=True))
    assert snapshot.actual_momentum == pytest.approx(np.linalg.norm(momentum), rel=1e-6)


@pytest.fixture
def bench():
    return Bench(fidelity="exact")


def test_a_program_reads_whatever_comes_at_once_without_using_too_much_time(bench):
    n = 20_000
    bench.start(f"""def prog():
      socket_open("127.0.0.1", 5000)
      sync()
      i = 0
      while i < {n}:
        v = socket_read_binary_integer(1)
        if v[1] != i:
          textmsg("wrong ", i)
          halt
        end
        i = i + 1
      end
      textmsg("all")
    end""")
    bench.network.sockets[0].inbox += b"".join(i.to_bytes(4, "big") for i in range(n))
    cycles = 0
    while bench.controller.is_active and cycles < 100:
        bench.tick()
        cycles += 1
    assert bench.texts == ["all"]
    assert not [event for event in bench.events if type(event).__name__ == "ScriptFailed"]


@pytest.mark.parametrize("answer", ["\ud800", "x" * 1001, math.nan, None])
def test_what_is_no_answer_at_all_cannot_be_given(answer):
    with pytest.raises(ArgumentError, match=r"^value .* given: allowed is true, false, number or text$"):
        AnswerRequest(answer)


def test_settings_are_kept(bench):
    bench.start(
        "def p():\n  pause_on_error_code(153)\n  pause_on_error_code(204, 3)\n  set_safety_mode_transition_hardness(1)\n"
        "  reset_revolution_counter([0, 0, 0, 0, 0, 1])\n  while True:\n    sync()\n  end\nend\n"
    )
    settings = bench.controller.state.error_settings
    assert settings.pause_codes == {(153, None), (204, 3)}
    assert settings.transition_hardness == 1
    assert settings.revolution_reference == (0, 0, 0, 0, 0, 1)
    bench.start("def q():\n  reset_revolution_counter()\nend\n")
    assert settings.pause_codes == set()
    assert settings.revolution_reference == bench.snapshots[-2].actual_q


def test_a_deviation_is_reported_once_until_it_is_over():
    settings = ErrorSettings(warns_of_deviation=True, deviation_threshold=0.5)
    small, large = (0.0,) * 6, (0.0, 0.0, -0.6 * MAX_POSITION_DEVIATION, 0.0, 0.0, 0.0)
    reports = [settings.deviation_warning(error) for error in (small, large, large, small, large)]
    assert [report is not None for report in reports] == [False, True, False, False, True]
    assert reports[1].argument == 2
