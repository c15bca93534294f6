"""Modbus signals as programs see them: a controller without ports, units that answer at once."""

import pytest
from box_support import Bench, FakeModbusUnit

from ur_emulator.controller.io.modbus_signals import MAX_SIGNALS

ADD = 'modbus_add_signal("10.0.0.2", 255, {address}, {kind}, "{name}")'


@pytest.fixture
def bench():
    return Bench()


def unit(bench, address="10.0.0.2:502"):
    return bench.network.modbus_units.setdefault(address, FakeModbusUnit())


def add(name, kind, address=5):
    return ADD.format(name=name, kind=kind, address=address)


def run(bench, *lines):
    return bench.run("def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n")


def error(bench, *lines):
    """Run a program that fails and return the text of its error."""
    first = len(bench.events)
    run(bench, *lines)
    failures = [event for event in bench.events[first:] if type(event).__name__ == "ScriptFailed"]
    assert len(failures) == 1
    assert "\n" not in failures[0].text
    return failures[0].text


# --- values


@pytest.mark.parametrize(
    ("kind", "stored", "text"), [(0, 1, "True"), (1, 0, "False"), (2, 65535, "65535"), (3, 32768, "32768")]
)
def test_each_type_of_signal_is_read(bench, kind, stored, text):
    unit(bench).memory[kind, 5] = stored
    texts = run(bench, add("s", kind), "sync()", 'textmsg(modbus_get_signal_status("s", False))')
    assert texts == [text]


def test_a_signal_that_was_not_read_yet_is_0(bench):
    unit(bench).memory[2, 5] = 7
    texts = run(
        bench,
        add("word", 2),
        add("bit", 0),
        'textmsg(modbus_get_signal_status("word", False))',
        'textmsg(modbus_get_signal_status("bit", False))',
    )
    assert texts == ["0", "False"]


def test_outputs_are_written_at_once_and_have_their_value_at_once(bench):
    texts = run(
        bench,
        add("o", 1),
        add("r", 3, 6),
        'modbus_set_output_signal("o", True, False)',
        'modbus_set_output_register("r", 65535, False)',
        'textmsg(modbus_get_signal_status("o", False))',
        'textmsg(modbus_get_signal_status("r", False))',
    )
    assert texts == ["True", "65535"]
    assert unit(bench).memory == {(1, 5): 1, (3, 6): 65535}


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
    asked = [what for name, what in unit(bench).log]
    assert asked[: asked.index((4,))] == ["read"] * 3
    assert set(asked[asked.index((4,)) :]) == {(4,)}


def test_setting_the_same_value_again_asks_for_nothing_more(bench):
    bench.start(
        f'def p():\n  {add("o", 1)}\n  while True:\n    modbus_set_output_signal("o", True, False)\n    sync()\n  end\nend\n'
    )
    bench.tick(124)
    assert unit(bench).log.count(("o", (1,))) == pytest.approx(11, abs=1)


# --- time


@pytest.mark.parametrize("frequency", [125, 60, 10, 1.5])
def test_a_signal_is_refreshed_at_its_frequency(bench, frequency):
    run(bench, add("s", 0), f'modbus_set_signal_update_frequency("s", {frequency})')
    unit(bench).log.clear()
    bench.tick(1250)  # 10 s
    assert len(unit(bench).log) == pytest.approx(10 * frequency, abs=1)


def test_without_a_frequency_it_is_10_hz(bench):
    run(bench, add("s", 0))
    unit(bench).log.clear()
    bench.tick(1250)
    assert len(unit(bench).log) == pytest.approx(100, abs=1)


def test_a_frequency_of_0_asks_on_demand_only(bench):
    unit(bench).memory[2, 5] = 3
    texts = run(
        bench,
        add("r", 2),
        'modbus_set_signal_update_frequency("r", 0)',
        "sleep(1)",
        'textmsg(modbus_get_signal_status("r", False))',
        add("o", 1, 6),
        'modbus_set_signal_update_frequency("o", 0)',
        'modbus_set_output_signal("o", True, False)',
        'modbus_set_output_signal("o", True, False)',
        "sleep(1)",
    )
    assert texts == ["3"]
    assert unit(bench).log == [("r", "read"), ("o", (1,)), ("o", (1,))]


def test_a_frequency_that_nobody_lives_to_see(bench):
    run(bench, add("s", 0), 'modbus_set_signal_update_frequency("s", 1e-320)', "sleep(1)")
    assert unit(bench).log == [("s", "read")]


# --- life


def test_signals_outlive_their_program(bench):
    run(bench, add("s", 2))
    unit(bench).memory[2, 5] = 12
    bench.tick(15)
    assert run(bench, 'textmsg(modbus_get_signal_status("s", False))') == ["12"]


def test_a_signal_of_the_same_name_replaces_the_old_one(bench):
    unit(bench).memory.update({(2, 5): 1, (2, 6): 2})
    texts = run(
        bench,
        add("s", 2),
        "sync()",
        add("s", 2, 6),
        'textmsg(modbus_get_signal_status("s", False))',
        "sync()",
        'textmsg(modbus_get_signal_status("s", False))',
    )
    assert texts == ["0", "2"]
    assert ("s", "forgotten") in unit(bench).log
    assert not unit(bench).is_released


def test_adding_the_same_signal_again_keeps_its_value_but_not_its_settings(bench):
    unit(bench).memory[0, 5] = 1
    texts = run(
        bench,
        add("s", 0),
        'modbus_set_digital_input_action("s", "freedrive")',
        'modbus_set_signal_update_frequency("s", 1)',
        "sync()",
        add("s", 0),
        'textmsg(modbus_get_signal_status("s", False))',
    )
    assert texts == ["True"]
    signal = bench.controller.state.modbus.signals["s"]
    assert (signal.action, signal.frequency) == ("default", 10.0)


def test_a_unit_is_released_with_its_last_signal(bench):
    run(bench, add("a", 0), add("b", 0))
    run(bench, 'modbus_delete_signal("a")')
    assert not unit(bench).is_released
    run(bench, 'modbus_delete_signal("b")')
    assert unit(bench).is_released
    assert not bench.controller.state.modbus.signals


def test_deleting_what_is_not_there_is_harmless(bench):
    assert run(bench, 'modbus_delete_signal("ghost")', 'textmsg("on")') == ["on"]


def test_units_are_distinguished_by_host_and_port(bench):
    run(
        bench,
        'modbus_add_signal("10.0.0.2", 255, 0, 0, "a")',
        'modbus_add_signal("10.0.0.2:1502", 255, 0, 0, "b")',
        'modbus_add_signal("plc-7.local", 255, 0, 0, "c", True)',
    )
    assert set(bench.network.modbus_units) == {"10.0.0.2:502", "10.0.0.2:1502", "plc-7.local:502"}
    assert bench.controller.state.modbus.signals["c"].sequential


def test_a_secondary_program_may_use_signals(bench):
    run(bench, add("o", 1))
    bench.start('sec s():\n  modbus_set_output_signal("o", True, True)\nend\n')
    assert unit(bench).memory == {(1, 5): 1}


# --- what follows the program, what follows an input


@pytest.mark.parametrize(("choice", "running", "stopped"), [(0, 1, 1), (1, 1, 0), (2, 1, 1), (3, 1, 0)])
def test_an_output_that_is_set_follows_the_program(bench, choice, running, stopped):
    seen = []
    run(bench, add("o", 1), f'modbus_set_runstate_dependent_choice("o", {choice})')
    bench.start('def p():\n  modbus_set_output_signal("o", True, False)\n  sync()\n  sync()\nend\n')
    seen.append(unit(bench).memory[1, 5])
    bench.tick(50)
    seen.append(unit(bench).memory[1, 5])
    assert seen == [running, stopped]


def test_choice_3_raises_an_output_when_a_program_starts(bench):
    run(bench, add("o", 3), 'modbus_set_runstate_dependent_choice("o", 3)')
    assert unit(bench).memory[3, 5] == 0
    bench.start("def p():\n  sync()\n  sync()\nend\n")
    assert unit(bench).memory[3, 5] == 1


def test_keeping_the_state_leaves_an_output_to_its_unit(bench):
    run(bench, add("o", 1), 'modbus_set_runstate_dependent_choice("o", 0)')
    bench.tick(50)
    assert set(unit(bench).log) == {("o", "read")}


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


def test_an_own_request_needs_no_signal_and_leaves_no_unit_behind(bench):
    run(bench, 'modbus_send_custom_command("10.0.0.2", 103, 6, [17, 32, 2, 88])')
    assert unit(bench).log == [(103, 6, bytes([17, 32, 2, 88]))]
    assert unit(bench).is_released


def test_an_own_request_goes_through_the_connection_of_the_signals(bench):
    run(bench, add("s", 0), 'modbus_send_custom_command("10.0.0.2", 103, 6, [])')
    assert (103, 6, b"") in unit(bench).log
    assert not unit(bench).is_released


# --- errors


@pytest.mark.parametrize(
    ("line", "text"),
    [
        (
            'modbus_add_signal("10.0.0.2", 255, 0, 4, "s")',
            "modbus_add_signal: Parameter 'signal_type' must be in the range 0 to 3, got 4",
        ),
        (
            'modbus_add_signal("10.0.0.2", 256, 0, 0, "s")',
            "modbus_add_signal: Parameter 'slave_number' must be in the range 0 to 255, got 256",
        ),
        (
            'modbus_add_signal("10.0.0.2", 255, 65536, 0, "s")',
            "modbus_add_signal: Parameter 'signal_address' must be in the range 0 to 65535, got 65536",
        ),
        (
            'modbus_add_signal("10.0.0.2", 255, 0, 0, "a23456789012345678901")',
            'modbus_add_signal: "a23456789012345678901" is not a signal name; allowed: 1 to 20 characters',
        ),
        (
            'modbus_add_signal("10.0.0.2", 255, 0, 0, "")',
            'modbus_add_signal: "" is not a signal name; allowed: 1 to 20 characters',
        ),
        (
            'modbus_add_signal("", 255, 0, 0, "s")',
            'modbus_add_signal: "" is not an address; write "ip" or "ip:port", port 1 to 65535',
        ),
        (
            'modbus_add_signal("10.0.0.2:65536", 255, 0, 0, "s")',
            'modbus_add_signal: "10.0.0.2:65536" is not an address; write "ip" or "ip:port", port 1 to 65535',
        ),
        (
            'modbus_add_signal("10.0.0.2:0", 255, 0, 0, "s")',
            'modbus_add_signal: "10.0.0.2:0" is not an address; write "ip" or "ip:port", port 1 to 65535',
        ),
        (
            'modbus_get_signal_status("x", False)',
            'modbus_get_signal_status: there is no Modbus signal "x", add it with modbus_add_signal',
        ),
        (
            'modbus_set_output_signal("x", True, False)',
            'modbus_set_output_signal: there is no Modbus signal "x", add it with modbus_add_signal',
        ),
        (
            'modbus_set_signal_update_frequency("x", 1)',
            'modbus_set_signal_update_frequency: there is no Modbus signal "x", add it with modbus_add_signal',
        ),
        (
            'modbus_set_output_register("r", 65536, False)',
            "modbus_set_output_register: 65536 does not fit into a register; allowed: 0 to 65535",
        ),
        (
            'modbus_set_output_register("r", -1, False)',
            "modbus_set_output_register: -1 does not fit into a register; allowed: 0 to 65535",
        ),
        (
            'modbus_set_output_register("i", 1, False)',
            'modbus_set_output_register: signal "i" is a digital input, not a register output',
        ),
        (
            'modbus_set_output_signal("r", True, False)',
            'modbus_set_output_signal: signal "r" is a register output, not a digital output',
        ),
        (
            'modbus_set_signal_update_frequency("r", 126)',
            "modbus_set_signal_update_frequency: Parameter 'update_frequency' must be in the range 0 to 125, got 126",
        ),
        (
            'modbus_set_signal_update_frequency("r", -1)',
            "modbus_set_signal_update_frequency: Parameter 'update_frequency' must be in the range 0 to 125, got -1",
        ),
        (
            'modbus_set_signal_update_frequency("r", 1e308 * 10 - 1e308 * 10)',
            "modbus_set_signal_update_frequency: Parameter 'update_frequency' must be finite, got nan",
        ),
        (
            'modbus_set_digital_input_action("r", "freedrive")',
            'modbus_set_digital_input_action: signal "r" is a register output, not a digital input',
        ),
        (
            'modbus_set_digital_input_action("i", "dance")',
            "modbus_set_digital_input_action: Parameter 'action' must be one of default, freedrive, got dance",
        ),
        (
            'modbus_set_runstate_dependent_choice("i", 1)',
            'modbus_set_runstate_dependent_choice: signal "i" is a digital input, not an output',
        ),
        (
            'modbus_set_runstate_dependent_choice("r", 4)',
            "modbus_set_runstate_dependent_choice: Parameter 'runstate_choice' must be in the range 0 to 3, got 4",
        ),
        (
            'modbus_send_custom_command("10.0.0.2", 1, 6, [256])',
            "modbus_send_custom_command: data must be a list of up to 252 integers from 0 to 255",
        ),
        (
            'modbus_send_custom_command("10.0.0.2", 1, 6, [True])',
            "modbus_send_custom_command: data must be a list of up to 252 integers from 0 to 255",
        ),
        (
            'modbus_send_custom_command("10.0.0.2 ", 1, 6, [1])',
            'modbus_send_custom_command: "10.0.0.2 " is not an address; write "ip" or "ip:port", port 1 to 65535',
        ),
    ],
)
def test_wrong_arguments_are_run_time_errors_of_one_line(bench, line, text):
    run(bench, add("r", 3), add("i", 0))
    assert error(bench, line) == text
    assert set(bench.controller.state.modbus.signals) == {"r", "i"}


def test_a_name_of_20_characters_is_a_name(bench):
    name = "a2345678901234567890"
    run(bench, add(name, 0))
    assert set(bench.controller.state.modbus.signals) == {name}


def test_signals_without_end_are_refused(bench):
    lines = (
        "i = 0",
        "while True:",
        'modbus_add_signal("10.0.0.2", 255, 0, 0, str_cat("s", i))',
        "i = i + 1",
        "end",
    )
    assert (
        error(bench, *lines)
        == f"modbus_add_signal: there are {MAX_SIGNALS} signals already, delete one first"
    )
    assert len(bench.controller.state.modbus.signals) == MAX_SIGNALS


def test_a_lost_signal_is_a_run_time_error_when_it_is_used(bench):
    run(bench, add("i", 0), add("o", 3))
    unit(bench).trouble = "10.0.0.2:502 refuses the connection"
    bench.tick(15)
    why = "is lost: 10.0.0.2:502 refuses the connection"
    assert (
        error(bench, 'modbus_get_signal_status("i", False)') == f'modbus_get_signal_status: signal "i" {why}'
    )
    set_output = 'modbus_set_output_register("o", 1, False)'
    assert error(bench, set_output) == f'modbus_set_output_register: signal "o" {why}'
    unit(bench).trouble = ""
    bench.tick(15)
    assert run(bench, 'textmsg(modbus_get_signal_status("i", False))') == ["False"]
