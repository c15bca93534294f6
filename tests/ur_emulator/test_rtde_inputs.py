"""What input variables do in the box, and what the snapshot publishes for RTDE. No sockets."""

import math

import numpy as np
import pytest
from box_support import Bench

from protocol.pose import rotvec_to_matrix
from protocol.rtde.codec import data_header
from protocol.rtde.fields import INPUTS, output_fields
from protocol.rtde.recipe import Recipe, snapshot_encoder
from protocol.rtde.types import RtdeType
from protocol.ur_types import SafetyMode, SoftwareVersion
from ur_emulator.machine.commands.client_writes import WriteInputs
from ur_emulator.machine.commands.safety import TriggerProtectiveStop
from ur_emulator.machine.controller.status_words import safety_status_bits

V3_15 = SoftwareVersion(3, 15, 8)


@pytest.fixture
def bench():
    return Bench(fidelity="ideal")


def write(bench, *recipes):
    """Write in one cycle; each recipe is a dictionary."""
    return bench.tick(1, *(WriteInputs(tuple(recipe.items())) for recipe in recipes))


def published(snapshot, *names):
    """Outputs of a snapshot as a client reads them."""
    fields = [output_fields(V3_15)[name] for name in names]
    recipe = Recipe(names, [field.type for field in fields])
    return recipe.decode(snapshot_encoder(fields, data_header(recipe.size, 1))(snapshot)[4:])


def test_every_input_of_the_table_can_be_written(bench):
    for field in INPUTS:
        value = (1.0,) * 6 if field.type is RtdeType.VECTOR6D else 1
        write(bench, {field.name: value})
    assert bench.now.registers.input_integers == (1,) * 48
    assert bench.now.registers.input_floats == (1,) * 48
    assert bench.now.registers.input_booleans[64:] == (True,) * 64


REGISTERS = {
    "input_bit_registers0_to_31": 0x80000001,
    "input_bit_registers32_to_63": 0xDEADBEEF,
    "input_bit_register_64": True,
    "input_bit_register_127": True,
    "input_int_register_0": -5,
    "input_int_register_47": 2**31 - 1,
    "input_double_register_0": 0.1,
    "input_double_register_47": -1e300,
}


def test_registers_are_read_back_in_the_cycle_they_are_written_and_copied_then_only(bench):
    first = bench.tick().registers
    assert bench.tick().registers is first
    now = write(bench, REGISTERS)
    assert published(now, *REGISTERS) == tuple(REGISTERS.values())
    assert published(now, "input_bit_register_65", "input_int_register_1") == (False, 0)
    assert now.registers.output_integers is first.output_integers
    assert first.input_integers[0] == 0


def test_integer_registers_hold_32_bits(bench):
    bench.controller.state.registers.outputs.integers[0] = 2**31
    assert published(bench.tick(), "output_int_register_0") == (-(2**31),)


@pytest.mark.parametrize(
    ("group", "shift", "n"), [("standard", 0, 8), ("configurable", 8, 8), ("tool", 16, 2)]
)
def test_digital_outputs_obey_their_mask(bench, group, shift, n):
    mask, value = f"{group}_digital_output_mask", f"{group}_digital_output"
    assert write(bench, {mask: 0b11, value: 0b10}).actual_digital_output_bits == 0b10 << shift
    assert write(bench, {mask: 0b01, value: 0b01}).actual_digital_output_bits == 0b11 << shift
    assert write(bench, {mask: 0b00, value: 0b00}).actual_digital_output_bits == 0b11 << shift
    assert write(bench, {mask: 0b10, value: 0b00}).actual_digital_output_bits == 0b01 << shift
    # Mask and value may come in different recipes.
    assert write(bench, {value: 0b10}, {mask: 0b10}).actual_digital_output_bits == 0b11 << shift
    assert write(bench, {value: 0b00}).actual_digital_output_bits == 0b01 << shift
    # Bits that a group does not have are left alone.
    assert write(bench, {mask: 0x3FF, value: 0x3FF}).actual_digital_output_bits == (2**n - 1) << shift


def test_outputs_set_by_a_script_stay_until_a_client_writes_again(bench):
    write(bench, {"standard_digital_output_mask": 1, "standard_digital_output": 1})
    bench.run("def d():\n  set_standard_digital_out(0, False)\nend\n")
    assert bench.tick(3).actual_digital_output_bits == 0
    assert write(bench, {"input_int_register_0": 1}).actual_digital_output_bits == 0


def test_analog_outputs_take_a_ratio_in_their_domain_and_obey_their_mask(bench):
    inputs = [f"standard_analog_output_{it}" for it in ("mask", "type", "0", "1")]
    names = ("standard_analog_output0", "standard_analog_output1", "analog_io_types")
    # ur_rtde leaves the other channel uninitialised.
    write(bench, dict(zip(inputs, (0b10, 0b10, math.nan, 0.25), strict=True)))
    assert published(bench.now, *names) == (0.004, 2.5, 0b1011)
    write(bench, dict(zip(inputs, (0b01, 0b00, 0.5, math.nan), strict=True)))
    assert published(bench.now, *names) == (pytest.approx(0.012), 2.5, 0b1011)


def test_the_speed_slider_obeys_its_mask(bench):
    for mask, value, expected in (
        (1, 0.5, 0.5),
        (0, 0.9, 0.5),
        (1, 7.0, 1.0),
        (1, math.nan, 1.0),
        (1, -1.0, 0.0),
    ):
        now = write(bench, {"speed_slider_mask": mask, "speed_slider_fraction": value})
        assert published(now, "target_speed_fraction") == (expected,)


# --- outputs that only RTDE has


def test_status_bits_follow_the_modes(bench):
    names = ("robot_status_bits", "safety_status_bits")
    assert published(bench.now, *names) == (0b01, 1)
    bench.start("def p():\n  while True:\n    sync()\n  end\nend\n")
    assert published(bench.tick(), *names) == (0b11, 1)
    bench.tick(1, TriggerProtectiveStop())
    assert published(bench.tick(), *names) == (0b01, 1 << 2 | 1 << 10)


def test_every_safety_mode_that_stops_the_arm_has_a_bit_of_its_own():
    stopping = [mode for mode in SafetyMode if 3 <= mode <= 9 and mode is not SafetyMode.RECOVERY]
    words = [safety_status_bits(mode) for mode in stopping]
    assert all(word & 1 << 10 for word in words)
    assert len(set(words)) == len(words)
    emergency = (SafetyMode.SYSTEM_EMERGENCY_STOP, SafetyMode.ROBOT_EMERGENCY_STOP)
    assert [mode for mode in stopping if safety_status_bits(mode) & 1 << 7] == list(emergency)


def test_the_tool_says_what_a_script_sets(bench):
    bench.run("def t():\n  set_tool_voltage(24)\nend\n")
    names = ("tool_output_voltage", "tool_mode", "tool_analog_input_types")
    assert published(bench.now, *names) == (24, 253, 0b11)


def test_the_script_line_is_looked_up_only_when_somebody_wants_it(bench):
    program = "def p():\n  sync()\n  while True:\n    sync()\n  end\nend\n"
    bench.start(program)
    assert published(bench.tick(3), "script_control_line") == (0,)
    bench.controller.programs.reports_line = True
    assert published(bench.tick(), "script_control_line") == (4,)
    bench.run("def q():\n  sync()\nend\n")
    assert published(bench.tick(), "script_control_line") == (0,)


# --- watchdogs over inputs; `chunks/watchdogs.script` has what one program shows

REGISTER = "input_int_register_24"
WRITE = WriteInputs(((REGISTER, 5),))


def watching(call):
    bench = Bench()
    bench.start(f"def p():\n  {call}\n  while True:\n    sync()\n  end\nend\n")
    return bench


@pytest.mark.parametrize(("frequency", "cycles"), [(62.5, 2), (10, 13), (200, 1)])
def test_packages_at_the_minimum_frequency_are_enough_and_one_cycle_more_is_not(frequency, cycles):
    bench = watching(f'rtde_set_watchdog("{REGISTER}", {frequency}, "stop")')
    for _ in range(10):
        bench.tick(1, WRITE)
        bench.tick(cycles - 1)
    assert bench.controller.programs.is_running
    bench.tick(1, WRITE)
    bench.tick(cycles)
    assert bench.controller.programs.is_running
    bench.tick()
    assert not bench.controller.programs.is_running


# --- a force sensor whose readings come through RTDE

READING = (1.0, -2.0, 3.0, 0.1, 0.2, -0.3)


def sensed(call, reading=READING):
    """A program that enables the sensor, and a reading in its second cycle."""
    bench = watching(call)
    write(bench, {"external_force_torque": reading})
    return bench


ENABLE, PLACE = "ft_rtde_input_enable(True", "0.5, [0.01, 0.02, 0.05], [0, 0, 0.02]"


@pytest.mark.parametrize(
    ("call", "lever"),
    [
        (f"{ENABLE})", (0.0, 0.0, 0.0)),
        (f"{ENABLE}, {PLACE})", (0.01, 0.02, 0.05)),
        (f"enable_external_ft_sensor(True, {PLACE})", (-0.01, -0.02, -0.05)),
        (f"{ENABLE})\n  set_tcp(p[0, 0, 0.1, 0, 0, 0])", (0.0, 0.0, -0.1)),
    ],
    ids=["at the flange", "away from it", "as older software says it", "moment at the TCP"],
)
def test_the_reading_is_turned_from_the_flange_to_the_base_with_its_lever(call, lever):
    bench = sensed(call)
    turned = rotvec_to_matrix(bench.now.actual_tcp_pose[3:])
    moment = np.add(READING[3:], np.cross(lever, READING[:3]))
    expected = [*(turned @ READING[:3]), *(turned @ moment)]
    assert bench.now.actual_tcp_force == pytest.approx(expected, abs=1e-3)
    assert bench.now.tcp_force_scalar == pytest.approx(math.sqrt(14.0))
    assert bench.controller.state.force_sense.sensor.mass == (0.5 if PLACE in call else 0.0)


def test_the_zero_is_that_of_the_sensor_that_was_just_enabled():
    bench = watching("sleep(0.1)\n  ft_rtde_input_enable(True)\n  zero_ftsensor()")
    for _ in range(60):
        write(bench, {"external_force_torque": READING})
    assert bench.now.actual_tcp_force == pytest.approx((0.0,) * 6, abs=1e-3)


def test_without_a_sensor_the_input_changes_nothing_and_nonsense_is_no_force():
    assert sensed("sync()", (500.0, 0, 0, 0, 0, 0)).now.tcp_force_scalar < 100.0
    assert not any(sensed(f"{ENABLE})", (math.nan,) * 6).now.actual_tcp_force)
