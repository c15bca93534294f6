"""Fidelity exact: what is measured is what was asked for, to the last bit; what is not modelled says so."""

from __future__ import annotations

import math

import pytest
from box_support import Bench

from ur_emulator.errors import PlantError, RefusedError
from ur_emulator.machine.commands.programs import SetSpeedSlider
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.fidelity import EXACT
from ur_emulator.machine.models.things import Thing
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.exact import ExactPlant

MOVES = """
def p():
  q = get_target_joint_positions()
  movej([q[0] + 0.5, q[1] + 0.2, q[2], q[3], q[4], q[5]])
  movel(pose_add(get_target_tcp_pose(), p[0, 0, 0.08, 0, 0, 0]))
  thread s():
    while True:
      speedj([0.3, -0.1, 0.1, 0.4, 0, -1], 2, 0.008)
    end
  end
  t = run s()
  sleep(0.4)
  kill t
  stopl(1)
  movec(pose_add(get_target_tcp_pose(), p[0.02, 0.01, 0, 0, 0, 0]), pose_add(get_target_tcp_pose(), p[0.03, 0, 0, 0, 0, 0]))
end
"""


def run(bench, program, n, command=None):
    bench.start(program)
    for cycle in range(n):
        bench.tick(1, *([command] if command is not None and cycle == n // 3 else []))
        yield bench.now


def test_measured_equals_asked_in_every_cycle_of_every_kind_of_motion():
    bench = Bench(fidelity="exact")
    seen = set()
    for now in run(bench, MOVES, 900, SetSpeedSlider(0.6)):
        assert now.actual_q == now.target_q
        assert now.actual_qd == now.target_qd
        assert now.actual_tcp_pose == now.target_tcp_pose
        assert now.actual_tcp_speed == now.target_tcp_speed
        assert now.actual_current == now.target_current == now.joint_control_output
        assert now.actual_tcp_force == (0.0,) * 6
        seen.add(now.actual_q)
    assert len(seen) > 200
    assert not bench.controller.programs.is_running


def test_moments_are_those_of_the_model_and_know_the_payload():
    bench, other = Bench(fidelity="exact"), Bench(fidelity="ideal")
    for one in (bench, other):
        one.start("def p():\n  set_payload(2.0, [0, 0, 0.05])\n  sleep(0.1)\nend\n")
        one.tick(5)
    assert bench.now.target_moment == pytest.approx(other.now.target_moment, abs=1e-9)
    assert bench.now.actual_tool_accelerometer == pytest.approx(other.now.actual_tool_accelerometer, abs=0.3)


@pytest.mark.parametrize(
    "act",
    [
        lambda plant: plant.push((50.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0),
        lambda plant: plant.attach_load(3.0),
        lambda plant: plant.put(Thing("box", "sphere", (0.1,), 0.0, 0.3, (0.4, 0.0, 0.3, 0.0, 0.0, 0.0))),
    ],
)
def test_what_would_act_on_the_arm_is_refused_in_one_line(act):
    plant = ExactPlant(UR3, EXACT, 0)
    with pytest.raises(RefusedError, match="nothing acts on an arm of fidelity exact"):
        act(plant)
    assert not plant.push_left
    plant.push((0.0, 0.0, 0.0))  # a zero force ends it


def test_two_seeds_are_the_same_arm():
    def frames(seed):
        return list(run(Bench(fidelity="exact", seed=seed), MOVES, 150))

    for one, other in zip(frames(1), frames(2), strict=True):
        assert one.actual_q == other.actual_q
        assert one.actual_tcp_pose == other.actual_tcp_pose
        assert one.actual_current == other.actual_current


def test_braked_arm_stands_where_it_is_and_takes_no_current():
    plant = ExactPlant(UR3, EXACT, 0)
    plant.step(None)
    state = plant.sense()
    assert state.actual_q == UR3.home_q
    assert state.actual_current == (0.0,) * 6


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e7])
def test_absurd_targets_are_refused(bad):
    plant = ExactPlant(UR3, EXACT, 0)
    with pytest.raises(PlantError, match="finite numbers"):
        plant.step(JointTarget((bad, 0.0, 0.0, 0.0, 0.0, 0.0)))
