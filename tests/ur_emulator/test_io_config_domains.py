"""Domains and ranges of analogue lines, actions of inputs, Euromap67 signals."""

import pytest
from box_support import Bench

from ur_emulator.controller.io.lines import CURRENT, VOLTAGE


def run(line):
    bench = Bench()
    bench.run(f"def p():\n  {line}\nend\n")
    return bench


def failure(bench):
    return [event.text for event in bench.events if type(event).__name__ == "ScriptFailed"]


@pytest.mark.parametrize(
    ("builtin", "lines"),
    [
        ("set_standard_analog_input_domain", "analog_in"),
        ("set_tool_analog_input_domain", "tool_analog_in"),
        ("set_analog_outputdomain", "analog_out"),
    ],
)
@pytest.mark.parametrize("port", [0, 1])
@pytest.mark.parametrize("domain", [CURRENT, VOLTAGE])
def test_domains(builtin, lines, port, domain):
    bench = run(f"{builtin}({port}, {domain})")
    assert getattr(bench.controller.state.io, lines)[port].domain == domain


def test_an_output_keeps_its_level_when_its_domain_changes():
    bench = Bench()
    texts = bench.run(
        "def p():\n  set_analog_outputdomain(1, 1)\n  set_standard_analog_out(1, 0.25)\n"
        "  textmsg(get_standard_analog_out(1))\n  set_analog_outputdomain(1, 0)\n"
        "  textmsg(get_standard_analog_out(1))\nend\n"
    )
    assert [float(text) for text in texts] == pytest.approx([2.5, 0.008])


@pytest.mark.parametrize(
    ("port", "code", "domain"),
    [(0, 0, VOLTAGE), (1, 2, VOLTAGE), (2, 0, VOLTAGE), (3, 1, VOLTAGE), (2, 2, CURRENT), (3, 2, CURRENT)],
)
def test_input_ranges(port, code, domain):
    bench = run(f"set_analog_inputrange({port}, {code})")
    io = bench.controller.state.io
    assert [*io.analog_in, *io.tool_analog_in][port].domain == domain
    assert not failure(bench)


@pytest.mark.parametrize(("port", "code"), [(0, 1), (1, 3), (2, 3)])
def test_ranges_that_ended_with_cb2(port, code):
    (text,) = failure(run(f"set_analog_inputrange({port}, {code})"))
    assert "is not supported" in text


@pytest.mark.parametrize(
    ("group", "last"),
    [("standard_digital", 7), ("configurable_digital", 7), ("tool_digital", 1), ("gp_boolean", 127)],
)
def test_actions_of_inputs_are_kept(group, last):
    bench = run(f'set_{group}_input_action({last}, "freedrive")')
    actions = bench.controller.state.io_configuration.input_actions
    assert actions == {(group, last): "freedrive"}
    bench.run(f'def p():\n  set_{group}_input_action({last}, "default")\nend\n')
    assert actions == {}


def test_all_actions_to_default():
    bench = run('set_tool_digital_input_action(0, "freedrive")\n  set_input_actions_to_default()')
    assert bench.controller.state.io_configuration.input_actions == {}


def test_euromap_signals():
    bench = Bench()
    bench.controller.state.io.euromap.inputs = 1 << 17
    texts = bench.run(
        "def p():\n  set_euromap_output(3, True)\n  textmsg(get_euromap_output(3), get_euromap_input(17))\n"
        "  set_euromap_output(3, False)\n  textmsg(get_euromap_output(3), get_euromap_input(16))\nend\n"
    )
    assert texts == ["TrueTrue", "FalseFalse"]


def test_a_euromap_port_that_does_not_exist():
    (text,) = failure(run("get_euromap_input(32)"))
    assert "allowed: 0 to 31" in text
