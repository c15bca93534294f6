"""A force sensor whose readings come through RTDE."""

import math

import numpy as np
import pytest
from box_support import Bench

from protocol.pose import rotvec_to_matrix
from ur_emulator.commands.client_writes import WriteInputs

READING = (1.0, -2.0, 3.0, 0.1, 0.2, -0.3)


def write(reading):
    return WriteInputs((("external_force_torque", reading),))


def run(bench, call):
    bench.start(f"def p():\n  {call}\n  while True:\n    sync()\n  end\nend\n")
    return bench.tick(1, write(READING))


def rotation(bench):
    return rotvec_to_matrix(bench.now.actual_tcp_pose[3:])


def test_the_reading_is_turned_from_the_flange_to_the_base():
    bench = Bench()
    snap = run(bench, "ft_rtde_input_enable(True)")
    turned = rotation(bench)
    expected = [*(turned @ READING[:3]), *(turned @ READING[3:])]
    assert snap.actual_tcp_force == pytest.approx(expected, abs=1e-3)
    assert bench.now.tcp_force_scalar == pytest.approx(math.sqrt(14.0))


@pytest.mark.parametrize(
    ("builtin", "sign"), [("ft_rtde_input_enable", 1.0), ("enable_external_ft_sensor", -1.0)]
)
def test_the_lever_of_the_sensor(builtin, sign):
    bench = Bench()
    snap = run(bench, f"{builtin}(True, 0.5, [0.01, 0.02, 0.05], [0, 0, 0.02])")
    moment = np.add(READING[3:], sign * np.cross((0.01, 0.02, 0.05), READING[:3]))
    assert snap.actual_tcp_force[3:] == pytest.approx(list(rotation(bench) @ moment), abs=1e-3)
    assert bench.controller.state.force_sense.sensor.mass == 0.5


def test_the_moment_is_given_at_the_tcp():
    bench = Bench()
    snap = run(bench, "ft_rtde_input_enable(True)\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])")
    moment = np.subtract(READING[3:], np.cross((0, 0, 0.1), READING[:3]))
    assert snap.actual_tcp_force[3:] == pytest.approx(list(rotation(bench) @ moment), abs=1e-3)


def test_scripts_read_it():
    bench = Bench()
    bench.tick(1, write(READING))
    (text,) = bench.run("def p():\n  ft_rtde_input_enable(True)\n  sync()\n  textmsg(force())\nend\n")
    assert float(text) == pytest.approx(math.sqrt(14.0))


def test_without_sensor_the_input_changes_nothing():
    bench = Bench()
    bench.tick(1, write((500.0, 0, 0, 0, 0, 0)))
    assert bench.now.tcp_force_scalar < 100.0
    bench.run("def p():\n  ft_rtde_input_enable(True)\n  ft_rtde_input_enable(False)\nend\n")
    assert bench.now.tcp_force_scalar < 100.0


def test_nonsense_is_no_force():
    bench = Bench()
    run(bench, "ft_rtde_input_enable(True)")
    assert bench.tick(1, write((math.nan,) * 6)).actual_tcp_force == pytest.approx((0.0,) * 6)


def test_an_enabled_sensor_must_speak_ten_times_a_second():
    bench = Bench()
    run(bench, "ft_rtde_input_enable(True)")
    for _ in range(5):
        bench.tick(12)
        bench.tick(1, write(READING))
    assert bench.controller.programs.is_running
    bench.tick(14)
    assert bench.controller.programs.is_paused


def test_the_program_may_choose_another_watchdog():
    bench = Bench()
    run(bench, 'ft_rtde_input_enable(True)\n  rtde_set_watchdog("external_force_torque", 1, "stop")')
    bench.tick(100)
    assert bench.controller.programs.is_running
    bench.tick(30)
    assert not bench.controller.programs.is_running
