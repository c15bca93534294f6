"""Lines and registers as programs set them up: domains and ranges, actions of inputs, Euromap67 signals.

Also outputs that follow the program, the robot's Modbus map, and conveyor encoders.
"""

import math

import pytest
from box_support import Bench
from hypothesis import given
from hypothesis import strategies as st

from ur_emulator.commands.programs import StopProgram
from ur_emulator.commands.safety import TriggerProtectiveStop
from ur_emulator.controller import modbus_map as port_map
from ur_emulator.controller.io.encoders import RANGES, Decoder, Encoder
from ur_emulator.controller.io.lines import CURRENT, VOLTAGE
from ur_emulator.controller.modbus_map import COILS, REGISTERS, MapAddressError


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


BENCH = Bench()


def signed(word):
    return word - 0x10000 if word & 0x8000 else word


def read(bench, address):
    return port_map.read_register(bench.controller.state, address)


def texts(bench, *lines):
    return bench.run("def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n")


@pytest.mark.parametrize("rows", [REGISTERS, COILS])
def test_rows_do_not_overlap(rows):
    addresses = [address for row in rows for address in range(row.first, row.first + row.count)]
    assert len(addresses) == len(set(addresses))


@pytest.mark.parametrize(
    ("rows", "read_one", "largest"),
    [(REGISTERS, port_map.read_register, 0xFFFF), (COILS, port_map.read_coil, 1)],
)
def test_every_address_of_the_tables_can_be_read(rows, read_one, largest):
    for row in rows:
        for address in range(row.first, row.first + row.count):
            assert 0 <= read_one(BENCH.controller.state, address) <= largest


@pytest.mark.parametrize("address", [259, 267, 276, 1023, 65535])
def test_addresses_without_anything(address):
    with pytest.raises(MapAddressError):
        port_map.read_register(BENCH.controller.state, address)
    bench = Bench()
    texts(bench, f"write_port_register({address}, 1)")
    assert any(f"no register {address}" in getattr(event, "text", "") for event in bench.events)


@given(st.integers(128, 255), st.integers(-32768, 65535))
def test_general_purpose_words(address, value):
    state = BENCH.controller.state
    assert port_map.write_register(state, address, value)
    assert port_map.read_register(state, address) == value & 0xFFFF


def test_scripts_read_signed_words():
    assert texts(Bench(), "write_port_register(128, 65535)", "textmsg(read_port_register(128))") == ["-1"]


def test_joint_angles_count_up_from_zero_beside_their_turns():
    bench = Bench()
    q = bench.now.actual_q
    for joint in range(6):
        angle, turns = read(bench, 270 + joint) / 1e3, signed(read(bench, 320 + joint))
        assert 0.0 <= angle <= 6.284
        assert angle + turns * 2.0 * math.pi == pytest.approx(q[joint], abs=1e-3)
    assert any(x < 0.0 for x in q)


def test_tcp_pose_and_modes():
    bench = Bench()
    pose = bench.now.actual_tcp_pose
    for i in range(3):
        assert signed(read(bench, 400 + i)) == pytest.approx(pose[i] * 1e4, abs=0.6)
        assert signed(read(bench, 403 + i)) == pytest.approx(pose[3 + i] * 1e3, abs=0.6)
    assert [read(bench, 256), read(bench, 257), read(bench, 258), read(bench, 310)] == [3, 15, 7, 253]


def test_flags_of_a_protective_stop():
    bench = Bench()
    assert [read(bench, address) for address in range(260, 267)] == [1, 0, 0, 0, 0, 0, 1]
    bench.tick(1, TriggerProtectiveStop())
    assert [read(bench, address) for address in range(260, 267)] == [1, 1, 0, 0, 0, 1, 3]
    assert port_map.read_coil(bench.controller.state, 261)


def test_outputs_by_word_mask_and_bit():
    bench = Bench()
    state = bench.controller.state
    port_map.write_register(state, 1, 0b10_0000_0001)
    assert state.io.digital_out == 1 | 1 << 17
    port_map.write_register(state, 2, 0b110)
    port_map.write_register(state, 3, 0b001)
    port_map.write_register(state, 31, 0x80)
    assert state.io.digital_out == 0b110 | 1 << 15 | 1 << 17
    port_map.write_register(state, 33, 0x80)
    port_map.write_coil(state, 48 + 9, True)
    port_map.write_coil(state, 32 + 1, False)
    port_map.write_coil(state, 136, True)
    assert state.io.digital_out == 0b110 | 1 << 8
    assert read(bench, 1) == 0b110
    assert [port_map.read_coil(state, 16 + i) for i in range(4)] == [False, True, True, False]


def test_inputs_ignore_writes():
    bench = Bench()
    bench.controller.state.io.digital_in = 1 << 3 | 1 << 9 | 1 << 16
    assert texts(bench, "write_port_bit(3, False)", "textmsg(read_port_bit(3))") == ["True"]
    assert read(bench, 0) == 1 << 3 | 1 << 8
    assert [read(bench, 21), read(bench, 30)] == [1, 2]
    for address in (0, 4, 10):
        assert not port_map.write_register(bench.controller.state, address, 1)
    assert read(bench, 4) == 0


def test_analogue_levels_are_parts_of_the_range():
    bench = Bench()
    texts(bench, "set_analog_outputdomain(0, 1)", "set_standard_analog_out(0, 1)")
    assert [read(bench, 16), read(bench, 17)] == [65535, 1]
    port_map.write_register(bench.controller.state, 18, 0x8000)
    port_map.write_register(bench.controller.state, 19, 0)
    assert bench.controller.state.io.analog_out[1].value == pytest.approx(0.012, abs=1e-6)


def test_register_booleans_are_shared():
    bench = Bench()
    assert texts(
        bench,
        "write_port_bit(300, True)",
        "textmsg(read_input_boolean_register(0))",
        "write_output_boolean_register(127, True)",
        "textmsg(read_port_bit(627))",
    ) == ["True", "True"]


def test_the_clock_stands_until_it_is_latched_again():
    bench = Bench()
    assert [read(bench, address) for address in range(2049, 2054)] == [0, 0, 0, 0, 0]
    bench.tick(200)
    port_map.write_register(bench.controller.state, 2048, 1)
    milliseconds = round(bench.now.timestamp * 1e3)
    bench.tick(5)
    ms, s, minutes, hours, days = (read(bench, address) for address in range(2049, 2054))
    assert (((days * 24 + hours) * 60 + minutes) * 60 + s) * 1000 + ms == milliseconds


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


QUADRATURE = ((0, 0), (1, 0), (1, 1), (0, 1))


def printed(*lines):
    bench = Bench()
    result = bench.run("def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n")
    return result + [event.text for event in bench.events if type(event).__name__ == "ScriptFailed"]


def test_a_program_feeds_an_encoder():
    assert printed(
        "encoder_enable_set_tick_count(1, 0)",
        "encoder_set_tick_count(1, -123)",
        "textmsg(encoder_get_tick_count(1) == -123)",
        "textmsg(encoder_get_tick_count(0) == 0)",
    ) == ["True", "True"]


@pytest.mark.parametrize(("range_id", "low", "high"), [(0, -(2**31), 2**31 - 1), (1, 0, 255), (2, 0, 65535)])
def test_counts_outside_the_range(range_id, low, high):
    for count in (low - 1.0, high + 1.0):
        (text,) = printed(
            f"encoder_enable_set_tick_count(0, {range_id})", f"encoder_set_tick_count(0, {count})"
        )
        assert f"allowed: {low} to {high}" in text
    for count in (low, high):
        assert not printed(
            f"encoder_enable_set_tick_count(0, {range_id})", f"encoder_set_tick_count(0, {count:.1f})"
        )


def test_an_encoder_that_is_not_fed_takes_no_count():
    (text,) = printed("encoder_set_tick_count(0, 1)")
    assert "encoder_enable_set_tick_count" in text


def test_unwind_in_a_script():
    assert printed("textmsg(encoder_unwind_delta_tick_count(0, 250))") == ["None"]
    assert printed(
        "encoder_enable_set_tick_count(0, 1)",
        "textmsg(encoder_unwind_delta_tick_count(0, 250) == -6)",
        "textmsg(encoder_unwind_delta_tick_count(0, -250) == 6)",
        "textmsg(encoder_unwind_delta_tick_count(0, 100) == 100)",
    ) == ["True", "True", "True"]


@given(st.sampled_from(sorted(RANGES)), st.data())
def test_unwind_finds_the_difference_of_two_counts(range_id, data):
    low, size = RANGES[range_id]
    encoder = Encoder()
    encoder.feed(range_id)
    start = data.draw(st.integers(low, low + size - 1))
    way = data.draw(st.integers(-(size // 2) + 1, size // 2 - 1))
    end = (start + way - low) % size + low
    assert encoder.unwind(end - start) == way


def pulses(decoder, steps, pins=(0, 1)):
    bench = Bench()
    bench.run(f"def p():\n  encoder_enable_pulse_decode(0, {decoder}, {pins[0]}, {pins[1]})\nend\n")
    for a, b in steps:
        bench.controller.state.io.digital_in = a << (pins[0] % 8) | b << (pins[1] % 8)
        bench.tick()
    return bench.controller.state.encoders.encoders[0].count


def test_quadrature_counts_in_both_directions():
    assert pulses(1, QUADRATURE[1:] + QUADRATURE) == 7
    assert pulses(1, (QUADRATURE[1], QUADRATURE[2], QUADRATURE[1])) == 1
    assert pulses(1, QUADRATURE[:0:-1]) == 65536 - 3
    assert pulses(1, (QUADRATURE[2], QUADRATURE[0])) == 0


@pytest.mark.parametrize(("decoder", "count"), [(0, 0), (2, 5), (3, 3), (4, 2)])
def test_single_line_decoders(decoder, count):
    assert pulses(decoder, [(a, 0) for a in (1, 0, 1, 0, 1)]) == count


def test_other_pins_and_their_later_numbers():
    assert pulses(3, [(1, 0), (0, 0), (1, 0)], pins=(3, 2)) == 2
    assert pulses(3, [(1, 0), (0, 0), (1, 0)], pins=(11, 10)) == 2
    (text,) = printed("encoder_enable_pulse_decode(0, 1, 4, 5)")
    assert "digital input 4 cannot take encoder pulses" in text


def test_feeding_ends_decoding():
    encoder = Encoder()
    encoder.decode(Decoder.RISING, 0, 1, 0)
    encoder.feed(4)
    assert encoder.decoder is Decoder.OFF
    assert encoder.is_enabled


def test_old_forms_speak_of_the_first_encoder():
    assert printed(
        "set_conveyor_tick_count(200, 1)",
        "textmsg(get_conveyor_tick_count() == 200)",
        "textmsg(encoder_get_tick_count(0) == 200)",
        "conveyor_pulse_decode(1, 0, 1)",
        "textmsg(get_conveyor_tick_count() == 0)",
    ) == ["True", "True", "True"]
    (text,) = printed("set_conveyor_tick_count(300, 1)")
    assert "allowed: 0 to 255" in text
