"""Outputs that follow the program: what each code does when programs start and stop."""

import pytest
from box_support import Bench

from ur_emulator.commands.programs import StopProgram

# Builtin, number of the output, how to read it, (low, high).
OUTPUTS = {
    "standard_digital_output": (3, lambda c: c.state.io.read_digital_out(3), (False, True)),
    "configurable_digital_output": (2, lambda c: c.state.io.read_digital_out(10), (False, True)),
    "tool_digital_output": (1, lambda c: c.state.io.read_digital_out(17), (False, True)),
    "standard_analog_output": (0, lambda c: c.state.io.analog_out[0].ratio, (0.0, 1.0)),
    "gp_boolean_output": (99, lambda c: c.state.registers.outputs.booleans[99], (False, True)),
    "gp_integer_output": (7, lambda c: c.state.registers.outputs.integers[7], (0, 1)),
    "gp_float_output": (47, lambda c: c.state.registers.outputs.floats[47], (0.0, 1.0)),
}
SETTERS = {
    "standard_digital_output": "set_standard_digital_out(3, {})",
    "configurable_digital_output": "set_configurable_digital_out(2, {})",
    "tool_digital_output": "set_tool_digital_out(1, {})",
    "standard_analog_output": "set_standard_analog_out(0, {})",
    "gp_boolean_output": "write_output_boolean_register(99, {})",
    "gp_integer_output": "write_output_integer_register(7, {})",
    "gp_float_output": "write_output_float_register(47, {})",
}
# Code: what a low and a high output become after the start, and after the stop; None: they stay.
CODES = {0: (None, None), 1: (None, False), 2: (None, True), 3: (True, False)}
IDLE = "def idle():\n  while True:\n    sync()\n  end\nend\n"


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("is_high", [False, True])
def test_every_code_on_every_kind_of_output(output, code, is_high):
    index, read, levels = OUTPUTS[output]
    bench = Bench()
    bench.run(f"def setup():\n  set_runstate_{output}_to_value({index}, {code})\nend\n")
    number = "analog" in output or "integer" in output or "float" in output
    value = int(is_high) if number else is_high
    bench.run(f"sec put():\n  {SETTERS[output].format(value)}\nend\n")
    assert read(bench.controller) == levels[is_high]
    started, stopped = CODES[code]
    bench.start(IDLE)
    expected = is_high if started is None else started
    assert read(bench.controller) == levels[expected]
    bench.tick(1, StopProgram())
    expected = expected if stopped is None else stopped
    assert read(bench.controller) == levels[expected]


def test_code_3_acts_at_once_in_the_program_that_sets_it():
    bench = Bench()
    bench.start(
        "def p():\n  set_runstate_standard_digital_output_to_value(0, 3)\n  while True:\n    sync()\n  end\nend\n"
    )
    assert bench.now.actual_digital_output_bits == 1
    bench.tick(1, StopProgram())
    assert bench.now.actual_digital_output_bits == 0


def test_a_program_that_dies_stops_like_any_other():
    bench = Bench()
    bench.run("def p():\n  set_runstate_standard_digital_output_to_value(0, 2)\n  sync()\n  x = 1 / 0\nend\n")
    assert bench.now.actual_digital_output_bits == 1


def test_a_secondary_program_is_no_program_start():
    bench = Bench()
    bench.run("def setup():\n  set_runstate_standard_digital_output_to_value(0, 3)\nend\n")
    bench.run("sec nothing():\n  textmsg(1)\nend\n")
    assert bench.now.actual_digital_output_bits == 0


@pytest.mark.parametrize("kind", ["integer", "float"])
def test_a_code_that_does_not_exist_is_an_error(kind):
    bench = Bench()
    bench.run(f"def p():\n  set_runstate_gp_{kind}_output_to_value(0, 4)\nend\n")
    assert any("allowed: 0 to 3" in getattr(event, "text", "") for event in bench.events)


def test_euromap_outputs_follow_the_program_too():
    bench = Bench()
    bench.run(
        "def p():\n  set_euromap_runstate_dependent_choice(31, 2)\n  set_euromap_output(31, False)\nend\n"
    )
    assert bench.run(
        "def p():\n  textmsg(get_euromap_output(31))\n  textmsg(get_euromap_output(30))\nend\n"
    ) == [
        "True",
        "False",
    ]


def test_listed_outputs_are_low_while_no_program_runs():
    bench = Bench()
    both = "  set_standard_digital_out(1, True)\n  set_tool_digital_out(1, True)\n"
    bench.start(f"def p():\n  set_runstate_outputs([1, 9])\n{both}  while True:\n    sync()\n  end\nend\n")
    assert bench.now.actual_digital_output_bits == 1 << 1 | 1 << 17
    bench.tick(1, StopProgram())
    assert bench.now.actual_digital_output_bits == 0
    bench.run("sec p():\n  set_runstate_outputs([])\nend\n")
    bench.run(f"def p():\n{both}end\n")
    assert bench.now.actual_digital_output_bits == 1 << 1 | 1 << 17
