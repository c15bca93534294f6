"""`powerdown` and the settings that are only kept, or only reported."""

import pytest
from box_support import Bench

from protocol.ur_types import RobotMode
from ur_emulator.controller.safety.limit_checks import MAX_POSITION_DEVIATION
from ur_emulator.controller.settings import ErrorSettings


@pytest.mark.parametrize("kind", ["def", "sec"])
def test_powerdown_ends_the_program_and_cuts_the_power(kind):
    bench = Bench()
    bench.start("def other():\n  while True:\n    sync()\n  end\nend\n")
    bench.start(f'{kind} p():\n  powerdown()\n  textmsg("never")\nend\n')
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    assert not bench.controller.programs.is_running
    assert not [event for event in bench.events if type(event).__name__ in ("TextPrinted", "ScriptFailed")]


def test_powerdown_in_motion_holds_the_arm_where_it_is():
    bench = Bench()
    bench.start(
        "def p():\n  thread t():\n    sleep(0.4)\n    powerdown()\n  end\n  run t()\n"
        "  q = get_actual_joint_positions()\n  movej([q[0] + 1, q[1], q[2], q[3], q[4], q[5]])\nend\n"
    )
    start = bench.now.actual_q[0]
    bench.tick(100)
    assert bench.now.robot_mode == RobotMode.POWER_OFF
    assert start < bench.now.actual_q[0] < start + 0.5
    assert bench.tick(10).actual_q[0] == pytest.approx(bench.snapshots[-20].actual_q[0], abs=1e-4)


def test_settings_are_kept():
    bench = Bench()
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


def test_a_script_switches_the_warning_on_and_off():
    bench = Bench()
    start = (
        "def p():\n  position_deviation_warning({})\n  q = get_actual_joint_positions()\n"
        "  movej([q[0] + 0.3, q[1], q[2], q[3], q[4], q[5]])\nend\n"
    )
    bench.run(start.format("True, 0.0001"))
    found = [event for event in bench.events if getattr(event, "code", None) == 174]
    assert found
    bench.run(start.format("False"))
    assert found == [event for event in bench.events if getattr(event, "code", None) == 174]
