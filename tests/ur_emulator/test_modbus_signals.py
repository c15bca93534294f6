"""Modbus signals as programs see them: a controller without ports, units that answer at once.

Values, names and errors are in `chunks/modbus.script`; here is what takes many cycles and what a unit is asked.
"""

import pytest
from box_support import Bench, FakeModbusUnit, program
from e_series_support import DT, ESeriesBench

UNIT = "10.0.0.2:502"


@pytest.fixture
def bench():
    return Bench()


def unit(bench):
    return bench.network.modbus_units.setdefault(UNIT, FakeModbusUnit())


def add(name, kind, address=5):
    return f'modbus_add_signal("10.0.0.2", 255, {address}, {kind}, "{name}")'


def run(bench, *lines):
    return bench.run(program(*lines))


def error(bench, line):
    """Run a program that fails and return the text of its error."""
    first = len(bench.events)
    run(bench, line)
    (text,) = [event.text for event in bench.events[first:] if type(event).__name__ == "ScriptFailed"]
    assert "\n" not in text
    return text


# --- values


def test_an_output_is_read_until_it_is_set_and_written_from_then_on(bench):
    unit(bench).memory[3, 5] = 9
    texts = run(
        bench,
        add("r", 3),
        "sleep(0.25)",
        'textmsg(modbus_get_signal_status("r", False))',
        'modbus_set_output_register("r", 4, False)',
        "sleep(0.25)",
    )
    assert texts == ["9"]
    asked = [what for address, what in unit(bench).log]
    assert asked[: asked.index((4,))] == ["read"] * 3
    assert set(asked[asked.index((4,)) :]) == {(4,)}


def test_setting_the_same_value_again_asks_for_nothing_more(bench):
    bench.start(
        program(add("o", 1), "while True:", '  modbus_set_output_signal("o", True, False)', "  sync()", "end")
    )
    bench.tick(124)
    assert unit(bench).log.count((5, (1,))) == pytest.approx(11, abs=1)


# --- time


@pytest.mark.parametrize("frequency", [60, 1.5, None])
def test_a_signal_is_refreshed_at_its_frequency_or_10_times_a_second(bench, frequency):
    choose = [f'modbus_set_signal_update_frequency("s", {frequency})'] if frequency else []
    run(bench, add("s", 0), *choose)
    unit(bench).log.clear()
    bench.tick(250)  # 2 s
    assert len(unit(bench).log) == pytest.approx(2 * (frequency or 10), abs=1)


def test_a_frequency_of_0_asks_on_demand_only(bench):
    unit(bench).memory[2, 5] = 3
    texts = run(
        bench,
        add("r", 2),
        'modbus_set_signal_update_frequency("r", 0)',
        "sleep(1)",
        'modbus_get_signal_status("r", False)',
        "sync()",
        'textmsg(modbus_get_signal_status("r", False))',
        add("o", 1, 6),
        'modbus_set_signal_update_frequency("o", 0)',
        'modbus_set_output_signal("o", True, False)',
        'modbus_set_output_signal("o", True, False)',
        "sleep(1)",
    )
    assert texts == ["3"]
    assert unit(bench).log == [(5, "read"), (5, "read"), (6, (1,)), (6, (1,))]


def test_a_frequency_that_nobody_lives_to_see(bench):
    run(bench, add("s", 0), 'modbus_set_signal_update_frequency("s", 1e-320)', "sleep(1)")
    assert unit(bench).log == [(5, "read")]


# --- life


def test_adding_the_same_signal_again_keeps_its_value_but_not_its_settings(bench):
    unit(bench).memory[0, 5] = 1
    texts = run(
        bench,
        add("s", 0),
        'modbus_set_digital_input_action("s", "freedrive")',
        'modbus_set_signal_update_frequency("s", 1)',
        "sync()",
        "sync()",
        add("s", 0),
        'textmsg(modbus_get_signal_status("s", False))',
    )
    assert texts == ["True"]
    signal = bench.controller.state.modbus.signals["s"]
    assert (signal.action, signal.frequency) == ("default", 10.0)


def test_a_signal_that_is_replaced_is_forgotten_and_a_unit_released_with_its_last_one(bench):
    run(bench, add("a", 2), "sync()", add("a", 2, 6), add("b", 0))
    assert (5, "forgotten") in unit(bench).log
    run(bench, 'modbus_delete_signal("a")')
    assert not unit(bench).is_released
    run(bench, 'modbus_delete_signal("b")')
    assert unit(bench).is_released
    assert not bench.controller.state.modbus.signals


def test_units_are_distinguished_by_host_and_port(bench):
    run(
        bench,
        'modbus_add_signal("10.0.0.2", 255, 0, 0, "a")',
        'modbus_add_signal("10.0.0.2:1502", 255, 0, 0, "b")',
        'modbus_add_signal("plc-7.local", 255, 0, 0, "c", True)',
    )
    assert set(bench.network.modbus_units) == {UNIT, "10.0.0.2:1502", "plc-7.local:502"}
    assert bench.controller.state.modbus.signals["c"].sequential


# --- what follows the program, what follows an input


@pytest.mark.parametrize(("choice", "stopped"), [(0, 1), (2, 1), (3, 0)])
def test_an_output_that_is_set_follows_the_program(bench, choice, stopped):
    run(bench, add("o", 1), f'modbus_set_runstate_dependent_choice("o", {choice})')
    bench.tick(20)
    assert choice or set(unit(bench).log) == {(5, "read")}  # it is left to its unit
    bench.start(program('modbus_set_output_signal("o", True, False)', "sync()", "sync()"))
    assert unit(bench).memory[1, 5] == 1
    bench.tick(50)
    assert unit(bench).memory[1, 5] == stopped


def test_a_high_input_with_the_action_freedrive_asks_for_it(bench):
    modbus = bench.controller.state.modbus
    run(bench, add("s", 0), 'modbus_set_digital_input_action("s", "freedrive")')
    bench.tick(15)
    assert not modbus.requests_freedrive
    unit(bench).memory[0, 5] = 1
    bench.tick(15)
    assert modbus.requests_freedrive
    unit(bench).trouble = "gone"  # nobody knows any more what the input is
    bench.tick(15)
    assert not modbus.requests_freedrive
    unit(bench).trouble = ""
    run(bench, 'modbus_set_digital_input_action("s", "default")')
    bench.tick(15)
    assert not modbus.requests_freedrive


# --- own requests


def test_an_own_request_needs_no_signal_and_goes_through_the_connection_of_those_there_are(bench):
    send = 'modbus_send_custom_command("10.0.0.2", 103, 6, [17, 32, 2, 88])'
    run(bench, send)
    assert unit(bench).log == [(103, 6, bytes([17, 32, 2, 88]))]
    assert unit(bench).is_released
    run(bench, add("s", 0), send)
    assert unit(bench).log.count((103, 6, bytes([17, 32, 2, 88]))) == 2
    assert not unit(bench).is_released


# --- errors


def test_a_lost_signal_is_a_run_time_error_when_it_is_set_until_its_unit_answers(bench):
    run(bench, add("o", 3), add("i", 0))
    unit(bench).trouble = "10.0.0.2:502 refuses the connection"
    bench.tick(15)
    assert error(bench, 'modbus_set_output_register("o", 1, False)') == (
        'modbus_set_output_register: signal "o" is lost: 10.0.0.2:502 refuses the connection'
    )
    unit(bench).trouble = ""
    bench.tick(15)
    assert run(bench, 'textmsg(modbus_get_signal_status("i", False))') == ["False"]


def test_an_error_has_a_code_and_a_duration():
    bench = ESeriesBench(fidelity="exact")
    bench.start(
        program(
            add("level", 2),
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
    unit(bench).trouble = "is away"
    bench.tick(100)
    unit(bench).device_error = 4
    bench.tick(2)
    # The example of the manual: disconnected, and before that a failure of the server.
    assert bench["both"] == -131068
    assert [bench["device"], bench["connection"]] == [4, -2]
    assert bench["since"] == pytest.approx(100 * DT, abs=2 * DT)


def test_a_reset_waits_for_the_answer():
    bench = ESeriesBench(fidelity="exact")
    bench.start(
        program(add("level", 2), "sync()", 'modbus_reset_connection("10.0.0.2")', "global there = True")
    )
    unit(bench).trouble = "is away"
    bench.tick(20)
    assert unit(bench).log.count("reset") == 1
    assert bench.controller.programs.is_running
    assert bench.controller.waits_outside
    unit(bench).trouble = ""
    bench.tick(60)
    assert bench["there"] is True
    assert not bench.controller.programs.is_running
