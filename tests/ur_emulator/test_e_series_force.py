"""The force sensor of e-Series arms: its zero, its channels, and what programs do with it."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest
from box_support import Bench
from compliance_support import push, reported, said, truth

from ur_emulator.models.generations import E_SERIES
from ur_emulator.models.mjcf import GRAVITY

DOWN = "p[{x},0,{z},3.14159265,0,0]"
WAIT = "def p():\n  sleep(100)\nend\n"


def bench_of(robot="ur5e", fidelity="typical", x=0.4, z=0.3, seed=7):
    """A bench whose arm rests with its flange down; no program runs."""
    bench = Bench(robot=robot, generation=E_SERIES, fidelity=fidelity, seed=seed)
    bench.run(f"movej({DOWN.format(x=x, z=z)}, a=3, v=2)", limit=20_000)
    bench.events.clear()
    return bench


def force(bench, n=100):
    """Mean and standard deviation of the reported wrench over n cycles, (6,) each."""
    seen = []
    for _ in range(n):
        seen.append(bench.tick().actual_tcp_force)
    return np.mean(seen, axis=0), np.std(seen, axis=0)


def test_a_program_zeroes_the_sensor_which_shows_newtons_before_and_keeps_a_raw_channel():
    offsets = []
    for seed in range(6):
        bench = Bench(robot="ur5e", generation=E_SERIES, fidelity="typical", seed=seed)
        bench.tick(100)
        before, _ = force(bench)
        offsets.append(hypot(*before[:3]))
        bench.start(WAIT)
        after, noise = force(bench)
        assert hypot(*after[:3]) < 0.2
        assert noise[:3] == pytest.approx([0.15] * 3, rel=0.4)
        assert (noise[3:] < 0.01).all()
        assert hypot(*bench.now.ft_raw_wrench[:3]) == pytest.approx(hypot(*before[:3]), abs=0.6)
    assert max(offsets) > 2.0
    assert max(offsets) < 15.0


def test_the_sensor_drifts_by_newtons_within_minutes():
    changes = []
    for seed in range(4):
        bench = Bench(robot="ur5e", generation=E_SERIES, fidelity="typical", seed=seed)
        plant = bench.controller.plant
        early = plant._feedback._sensors._drift.next_block(1)[0]
        late = [plant._feedback._sensors._drift.next_block(1)[0] for _ in range(round(300 / (256 * 0.002)))][
            -1
        ]
        changes.append(np.abs(late - early)[:3].max())
    assert 1.0 < max(changes) < 9.0


def test_zeroing_takes_away_whatever_pushes():
    bench = bench_of()
    bench.start("def p():\n  sleep(0.2)\n  zero_ftsensor()\n  sleep(100)\nend\n")
    push(bench, 0.0, 20.0, 0.0)
    bench.tick(80)
    assert bench.now.actual_tcp_force[1] == pytest.approx(20.0, abs=1.0)
    bench.tick(100)
    assert bench.now.actual_tcp_force[1] == pytest.approx(0.0, abs=1.0)
    push(bench, 0.0, 0.0, 0.0)
    bench.tick(50)
    assert bench.now.actual_tcp_force[1] == pytest.approx(-20.0, abs=1.0)


@pytest.mark.parametrize("declared", ["set_payload(2.0, [0, 0, 0])", "set_payload(0.5, [0, 0, 0])"])
def test_declaring_a_payload_zeroes_the_sensor_too(declared):
    bench = bench_of(fidelity="ideal")
    bench.start(f"def p():\n  sleep(0.2)\n  {declared}\n  sleep(100)\nend\n")
    bench.controller.plant.attach_load(2.0)
    bench.tick(80)
    assert bench.now.actual_tcp_force[2] == pytest.approx(-2.0 * GRAVITY, abs=0.2)
    bench.tick(100)
    assert bench.now.actual_tcp_force == pytest.approx((0.0,) * 6, abs=0.1)


def test_the_wrench_is_that_at_the_flange_and_force_mode_still_takes_the_one_at_the_tcp():
    bench = bench_of(fidelity="ideal")
    bench.start("def p():\n  set_tcp(p[0, 0, 0.2, 0, 0, 0])\n  sleep(100)\nend\n")
    # Of a force at the TCP the flange feels a moment; the tool points down.
    bench.controller.plant.push((10.0, 0.0, 0.0), (0.0, 0.0, 0.2))
    bench.tick(100)
    assert bench.now.actual_tcp_force == pytest.approx((10, 0, 0, 0, -2.0, 0), abs=0.2)
    assert bench.now.space.tcp_force == pytest.approx((10, 0, 0, 0, 0, 0), abs=0.2)
    bench.controller.plant.push((0.0, 0.0, 0.0))


def test_the_raw_channel_has_the_payload_and_the_axes_of_the_flange():
    bench = bench_of(fidelity="ideal")
    bench.start("def p():\n  set_payload(1.5, [0.1, 0, 0.05])\n  sleep(100)\nend\n")
    bench.tick(100)
    # The flange looks down: what pulls down the base's z axis pulls along its own.
    weight = 1.5 * 9.82
    x_of_flange = bench.controller.plant._physics.flange_rotation[:, 0]
    assert bench.now.ft_raw_wrench == pytest.approx((0, 0, weight, 0, -0.1 * weight, 0), abs=0.15)
    push(bench, *(5.0 * x_of_flange))
    bench.tick(50)
    assert bench.now.ft_raw_wrench[0] == pytest.approx(5.0, abs=0.15)
    assert bench.now.actual_tcp_force[:3] == pytest.approx(5.0 * x_of_flange, abs=0.15)


@pytest.mark.parametrize("robot", ["ur3e", "ur5e", "ur10e"])
@pytest.mark.parametrize("fidelity", ["ideal", "typical", "poor"])
def test_force_mode_holds_ten_newtons_on_the_table(robot, fidelity):
    """A real UR5e asked for 10 N held 8.95 to 13.26 N over its work space (doi 10.3390/s26051709)."""
    bench = bench_of(robot, fidelity, x=0.3 if robot == "ur3e" else 0.5, z=0.0)
    bench.start(
        "def p():\n  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-10,0,0,0], 2, [.1,.1,.02,.2,.2,.2])\n"
        "  sleep(100)\nend\n"
    )
    forces, _ = truth(bench, 2000)
    assert reported(bench) == []
    assert forces[-500:, 2].mean() == pytest.approx(10.0, abs=1.5)
    assert forces[-500:, 2].std() < 1.0


def test_a_contact_is_found_that_a_cb3_would_not_notice():
    bench = bench_of("ur5e", z=0.0)
    bench.start(
        "def p():\n  while tool_contact(p[0,0,0,0,0,0]) == 0:\n"
        "    speedl([0,0,-0.01,0,0,0], 0.5, get_steptime())\n  end\n"
        '  textmsg("found")\n  stopl(3)\n  sleep(100)\nend\n'
    )
    forces, places = truth(bench, 3000)
    assert said(bench) == ["found"]
    assert 4.0 < forces[:, 2].max() < 60.0
    assert places[-1, 2] < 0.0


def test_noise_of_a_cb3_is_another():
    bench = Bench(robot="ur3", fidelity="typical")
    bench.start(WAIT)
    _, noise = force(bench)
    assert noise[:3].min() > 2.0
