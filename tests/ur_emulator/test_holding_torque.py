"""The high holding torque of a resting e-Series arm: it gives way further than a moving arm before it is stopped."""

import pytest
from e_series_support import ESeriesBench, program

from protocol.ur_types import SafetyMode

STRONG = (-80.0, 340.0, 0.0)  # more than the base joint can hold


def pushed(*lines, until=0.2, limit=600):
    """An arm that is pushed away until a joint is so far off, or it is stopped."""
    bench = ESeriesBench(fidelity="ideal")
    bench.start(program(*lines, "sleep(100)"))
    bench.tick(100)
    bench.controller.plant.push(STRONG)
    for _ in range(limit):
        bench.tick()
        if bench.errors or max(map(abs, bench.controller.plant.sense().position_error)) > until:
            return bench
    raise AssertionError("the push is too weak")


def test_a_resting_arm_gives_way_and_returns():
    bench = pushed()
    assert bench.errors == []
    bench.controller.plant.push((0.0, 0.0, 0.0))
    bench.tick(1000)
    assert bench.errors == []
    assert max(map(abs, bench.now.position_error)) < 1e-3


def test_it_is_stopped_in_the_end():
    bench = pushed(until=0.5)
    assert bench.errors[0][0] == 153
    assert bench.now.safety_mode == SafetyMode.PROTECTIVE_STOP


@pytest.mark.parametrize(
    "lines",
    [("high_holding_torque_disable()",), ("high_holding_torque_enable()", "high_holding_torque_disable()")],
)
def test_disabled_it_is_stopped_as_a_moving_arm(lines):
    bench = pushed(*lines, until=0.16)
    assert bench.errors[0][0] in (153, 157)


def test_it_stays_disabled_for_other_programs():
    bench = ESeriesBench(fidelity="ideal")
    bench.run(program("high_holding_torque_disable()"))
    assert not bench.controller.state.error_settings.holds_high
    bench.run(program("high_holding_torque_enable()"))
    assert bench.controller.state.error_settings.holds_high


def test_without_a_program_there_is_none():
    bench = ESeriesBench(fidelity="ideal")
    bench.tick(100)
    bench.controller.plant.push(STRONG)
    bench.tick(200)
    assert bench.errors[0][0] in (153, 157)
