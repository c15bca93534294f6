"""Lines, registers and encoders: the robot's Modbus map, outputs that follow the program, counts.

What each builtin does to them is shown by the chunks `io_*`, `ioconfiguration`, `encoders` and `registers`.
"""

import pytest
from box_support import Bench
from hypothesis import given
from hypothesis import strategies as st

from ur_emulator.machine.commands.programs import StopProgram
from ur_emulator.machine.controller import modbus_map as port_map
from ur_emulator.machine.controller.io.encoders import RANGES, Encoder
from ur_emulator.machine.controller.modbus_map import COILS, REGISTERS


@pytest.fixture
def bench():
    return Bench()


def test_all_actions_to_default(bench):
    actions = bench.controller.state.io_configuration.input_actions
    bench.run('set_tool_digital_input_action(0, "freedrive")\n')
    assert actions == {("tool_digital", 0): "freedrive"}
    bench.run("set_input_actions_to_default()\n")
    assert actions == {}


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


def test_tcp_pose_and_modes(bench):
    pose = bench.now.actual_tcp_pose
    for i in range(3):
        assert signed(read(bench, 400 + i)) == pytest.approx(pose[i] * 1e4, abs=0.6)
        assert signed(read(bench, 403 + i)) == pytest.approx(pose[3 + i] * 1e3, abs=0.6)
    assert [read(bench, 256), read(bench, 257), read(bench, 258), read(bench, 310)] == [3, 15, 7, 253]


def test_outputs_by_word_mask_and_bit(bench):
    state = bench.controller.state
    port_map.write(state, False, 1, 0b10_0000_0001)
    assert state.io.digital_out == 1 | 1 << 17
    port_map.write(state, False, 2, 0b110)
    port_map.write(state, False, 3, 0b001)
    port_map.write(state, False, 31, 0x80)
    assert state.io.digital_out == 0b110 | 1 << 15 | 1 << 17
    port_map.write(state, False, 33, 0x80)
    port_map.write(state, True, 48 + 9, True)
    port_map.write(state, True, 32 + 1, False)
    port_map.write(state, True, 136, True)
    assert state.io.digital_out == 0b110 | 1 << 8
    assert read(bench, 1) == 0b110
    assert [port_map.read_coil(state, 16 + i) for i in range(4)] == [False, True, True, False]


def test_analogue_levels_are_parts_of_the_range(bench):
    texts(bench, "set_analog_outputdomain(0, 1)", "set_standard_analog_out(0, 1)")
    assert [read(bench, 16), read(bench, 17)] == [65535, 1]
    port_map.write(bench.controller.state, False, 18, 0x8000)
    port_map.write(bench.controller.state, False, 19, 0)
    assert bench.controller.state.io.analog_out[1].value == pytest.approx(0.012, abs=1e-6)


def test_the_clock_stands_until_it_is_latched_again(bench):
    assert [read(bench, address) for address in range(2049, 2054)] == [0, 0, 0, 0, 0]
    bench.tick(200)
    port_map.write(bench.controller.state, False, 2048, 1)
    milliseconds = round(bench.now.timestamp * 1e3)
    bench.tick(5)
    ms, s, minutes, hours, days = (read(bench, address) for address in range(2049, 2054))
    assert (((days * 24 + hours) * 60 + minutes) * 60 + s) * 1000 + ms == milliseconds


# Kind of output: number, setter, low and high, how to read it.
BITS, PARTS, NUMBERS = ("False", "True"), ("0.0", "1.0"), ("0", "1")
OUTPUTS = {
    "standard_digital": (3, "set_standard_digital_out", BITS, lambda s: s.io.read_digital_out(3)),
    "configurable_digital": (2, "set_configurable_digital_out", BITS, lambda s: s.io.read_digital_out(10)),
    "tool_digital": (1, "set_tool_digital_out", BITS, lambda s: s.io.read_digital_out(17)),
    "standard_analog": (0, "set_standard_analog_out", PARTS, lambda s: s.io.analog_out[0].ratio),
    "gp_boolean": (99, "write_output_boolean_register", BITS, lambda s: s.registers.outputs.booleans[99]),
    "gp_integer": (7, "write_output_integer_register", NUMBERS, lambda s: s.registers.outputs.integers[7]),
    "gp_float": (47, "write_output_float_register", PARTS, lambda s: s.registers.outputs.floats[47]),
}
# Code: what a low and a high output become after the start, and after the stop; None: they stay.
CODES = {0: (None, None), 1: (None, False), 2: (None, True), 3: (True, False)}
IDLE = "def idle():\n  while True:\n    sync()\n  end\nend\n"


@pytest.mark.parametrize("output", OUTPUTS)
def test_every_code_on_every_kind_of_output(output):
    index, setter, levels, read_output = OUTPUTS[output]
    bench = Bench()

    def level():
        return levels.index(str(read_output(bench.controller.state)))

    for code, (started, stopped) in CODES.items():
        bench.run(f"def setup():\n  set_runstate_{output}_output_to_value({index}, {code})\nend\n")
        for is_high in (False, True):
            bench.run(f"sec put():\n  {setter}({index}, {levels[is_high]})\nend\n")
            assert level() == is_high
            bench.start(IDLE)
            expected = is_high if started is None else started
            assert level() == expected, code
            bench.tick(1, StopProgram())
            assert level() == (expected if stopped is None else stopped), code


def test_a_secondary_program_is_no_program_start(bench):
    bench.run("def setup():\n  set_runstate_standard_digital_output_to_value(0, 3)\nend\n")
    bench.run("sec nothing():\n  textmsg(1)\nend\n")
    assert bench.now.actual_digital_output_bits == 0


@given(st.sampled_from(sorted(RANGES)), st.data())
def test_unwind_finds_the_difference_of_two_counts(range_id, data):
    low, size = RANGES[range_id]
    encoder = Encoder()
    encoder.feed(range_id)
    start = data.draw(st.integers(low, low + size - 1))
    way = data.draw(st.integers(-(size // 2) + 1, size // 2 - 1))
    end = (start + way - low) % size + low
    assert encoder.unwind(end - start) == way
