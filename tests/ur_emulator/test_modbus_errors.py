"""What a program learns of errors of Modbus signals, and how it waits for a new connection."""

import pytest
from e_series_support import DT, ESeriesBench, program

SIGNAL = 'modbus_add_signal("10.0.0.9", 255, 6, 2, "level")'


def unit_of(bench):
    return bench.network.modbus_units["10.0.0.9:502"]


def test_an_error_has_a_code_and_a_duration():
    bench = ESeriesBench(fidelity="exact")
    bench.start(
        program(
            SIGNAL,
            'modbus_set_signal_update_frequency("level", 500)',
            "while True:",
            '  global both = modbus_get_error("level")',
            '  global device = modbus_get_error("level", 1)',
            '  global connection = modbus_get_error("level", 2)',
            '  global since = modbus_get_time_since_signal_invalid("level")',
            "  sync()",
            "end",
        )
    )
    bench.tick(5)
    assert [bench[name] for name in ("both", "device", "connection", "since")] == [0, 0, 0, 0.0]
    unit_of(bench).trouble = "is away"
    bench.tick(100)
    signal = bench.controller.state.modbus.signals["level"]
    signal.device_error = 4
    bench.tick(1)
    # The example of the manual: disconnected, and before that a failure of the server.
    assert bench["both"] == -131068
    assert [bench["device"], bench["connection"]] == [4, -2]
    assert bench["since"] == pytest.approx(100 * DT, abs=2 * DT)


def test_a_reset_waits_for_the_answer():
    bench = ESeriesBench(fidelity="exact")
    bench.start(program(SIGNAL, "sync()", 'modbus_reset_connection("10.0.0.9")', "global there = True"))
    unit_of(bench).trouble = "is away"
    bench.tick(20)
    assert unit_of(bench).log.count("reset") == 1
    assert bench.controller.programs.is_running
    assert bench.controller.waits_outside
    unit_of(bench).trouble = ""
    bench.tick(60)
    assert bench["there"] is True
    assert not bench.controller.programs.is_running
