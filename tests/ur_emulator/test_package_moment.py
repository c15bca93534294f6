"""One package shows target and measurements of one moment, the beginning of its cycle, and the registers of its end."""

import pytest
from box_support import VERSION, Bench

from protocol.rtde.fields import output_fields
from protocol.rtde.recipe import Recipe, snapshot_encoder
from ur_emulator.machine.commands.power import PowerOff, PowerOn, ReleaseBrakes
from ur_emulator.machine.models.generations import CB3, E_SERIES

FIELDS = output_fields(VERSION)
NAMES = ("target_q", "output_double_register_1", "actual_q")
# A joint goes 1 rad from rest to rest in 0.6 s along a cubic: 2.5 rad/s at half time. As the drivers of arms do it,
# each step has the speed at its end, and the time that has been travelled then stands in a register.
TRAVEL, TIME = 1.0, 0.6
CUBIC = f"""
def follow():
  travelled = 0.0
  while travelled < {TIME} - 0.5 * get_steptime():
    travelled = travelled + get_steptime()
    u = travelled / {TIME}
    write_output_float_register(1, travelled)
    speedj([{6 * TRAVEL / TIME} * u * (1 - u), 0, 0, 0, 0, 0], 1000, get_steptime())
  end
end
follow()
"""


def packages(snapshots):
    fields = [FIELDS[name] for name in NAMES]
    encode, recipe = snapshot_encoder(tuple(fields), b""), Recipe(NAMES, [field.type for field in fields])
    return [dict(zip(NAMES, recipe.decode(encode(snapshot)), strict=True)) for snapshot in snapshots]


def cubic(s):
    u = min(max(s / TIME, 0.0), 1.0)
    return TRAVEL * (3 * u**2 - 2 * u**3)


@pytest.mark.parametrize(
    ("robot", "generation", "fidelity"), [("ur3", CB3, "exact"), ("ur5e", E_SERIES, "ideal")]
)
def test_the_target_of_a_package_is_one_step_behind_its_register(robot, generation, fidelity):
    bench = Bench(robot=robot, generation=generation, fidelity=fidelity)
    begin = bench.now.target_q[0]
    bench.run(CUBIC)
    on_the_way = [p for p in packages(bench.snapshots) if 0.0 < p["output_double_register_1"] < TIME]
    assert len(on_the_way) > 0.9 * TIME / generation.period_s
    for package in on_the_way:
        travelled = package["output_double_register_1"] - generation.period_s
        assert package["target_q"][0] - begin == pytest.approx(cubic(travelled), abs=2e-4)
    assert max(abs(s.target_qd[0]) for s in bench.snapshots) == pytest.approx(1.5 * TRAVEL / TIME, rel=1e-3)


def test_the_target_that_a_script_reads_is_that_of_its_package():
    bench = Bench(fidelity="typical")
    bench.start(
        "def p():\n  thread read():\n    while True:\n"
        "      write_output_float_register(1, get_target_joint_positions()[0])\n      sync()\n    end\n  end\n"
        "  run read()\n  movej([0, -1.5, -1.8, 0, 1.2, 1.5])\nend\n"
    )
    bench.snapshots.clear()
    bench.tick(60)
    seen = [(p["output_double_register_1"], p["target_q"][0]) for p in packages(bench.snapshots)]
    assert all(read == target for read, target in seen)
    assert len(set(seen)) > 50


def test_current_and_moment_of_a_package_are_those_of_its_target():
    slow, quick = (Bench(fidelity="typical", robot="ur3") for _ in range(2))
    for bench, cycles in ((slow, 40), (quick, 41)):
        bench.start("movej([0, -1.5, -1.8, 0, 1.2, 1.5])\n")
        bench.tick(cycles)
    motion, now = slow.controller.state.motion, quick.now
    slow.controller.plant.complete_cycle()
    slow.controller.plant.step(motion.target)  # only to ask what was computed for the one before
    sensed = slow.controller.plant.sense()
    assert (now.target_q, now.target_qd, now.target_qdd) == motion.target
    assert (now.target_current, now.target_moment) == (sensed.target_current, sensed.target_moment)
    assert any(now.target_qd)


@pytest.mark.parametrize("fidelity", ["exact", "ideal"])
def test_an_arm_that_was_set_somewhere_has_target_and_measurements_there_in_the_same_package(fidelity):
    bench = Bench(fidelity=fidelity)
    bench.run(
        "def p():\n  movej([0.4, -1.5, -1.8, 0, 1.2, 1.5])\n  set_pos([0.5, -1.6, -1.7, -0.1, 1.1, 1.4])\n  sleep(0.2)\nend\n"
    )
    there = [abs(s.target_q[0] - 0.5) < 1e-9 for s in bench.snapshots]
    assert there == [abs(s.actual_q[0] - 0.5) < 1e-4 for s in bench.snapshots]
    assert True in there


def test_power_that_is_cut_on_the_way_leaves_target_and_arm_of_fidelity_exact_together():
    bench = Bench(fidelity="exact")
    bench.start("movej([0, -1.5, -1.8, 0, 1.2, 1.5])\n")
    bench.tick(40)
    bench.tick(20, PowerOff())
    bench.tick(200, PowerOn())
    bench.tick(200, ReleaseBrakes())
    assert all(s.actual_q == s.target_q for s in bench.snapshots)
    assert bench.snapshots[42].actual_q[0] != bench.snapshots[35].actual_q[0]
