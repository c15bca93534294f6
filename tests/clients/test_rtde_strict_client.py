"""The RTDE protocol as its public clients use it, by a client that forgives nothing."""

import socket
import struct

import numpy as np
import pytest
from clients_support import PERIOD
from strict_rtde import DATA, INPUTS, MESSAGE, OUTPUTS, StrictRtde

COMMON = (
    "timestamp", "actual_q", "actual_qd", "speed_scaling", "target_speed_fraction", "runtime_state",
    "actual_TCP_force", "actual_TCP_pose", "actual_digital_input_bits", "actual_digital_output_bits",
    "standard_analog_input0", "standard_analog_input1", "standard_analog_output0", "standard_analog_output1",
    "analog_io_types", "tool_mode", "tool_analog_input_types", "tool_analog_input0", "tool_analog_input1",
    "tool_output_voltage", "tool_output_current", "tool_temperature", "robot_mode", "safety_mode",
    "robot_status_bits", "safety_status_bits", "actual_current", "tcp_offset",
)  # fmt: skip
ROBOT_INPUTS = (
    "speed_slider_mask", "speed_slider_fraction", "standard_digital_output_mask", "standard_digital_output",
    "configurable_digital_output_mask", "configurable_digital_output", "tool_digital_output_mask",
    "tool_digital_output", "standard_analog_output_mask", "standard_analog_output_type",
    "standard_analog_output_0", "standard_analog_output_1",
)  # fmt: skip


def test_the_order_of_a_driver(box):
    """Version, controller, outputs, START, some data, PAUSE, inputs, START."""
    with StrictRtde(box) as client:
        assert client.controller()[:2] == (3, 15)
        client.want(*COMMON)
        assert client.start()
        assert client.data()["timestamp"] >= 40.0
        client.pause()
        recipe = client.inputs(*ROBOT_INPUTS)
        assert recipe.number == 1
        assert client.start()
        values = client.data()
        assert values["robot_mode"] == 7
        assert values["safety_mode"] == 1


def test_no_cycle_is_lost_at_the_full_rate(box):
    with StrictRtde(box) as client:
        client.want("timestamp", "target_q")
        client.start()
        stamps = [client.data()["timestamp"] for _ in range(125)]
    assert np.allclose(np.diff(stamps), PERIOD, atol=1e-9)


@pytest.mark.parametrize(
    ("frequency", "cycles"), [(125, 1), (100, 1), (60, 2), (50, 2), (25, 5), (10, 12), (1, 125)]
)
def test_the_rate_is_a_whole_share_of_the_full_rate(box, frequency, cycles):
    with StrictRtde(box) as client:
        client.want("timestamp", frequency=frequency)
        client.start()
        stamps = [client.data()["timestamp"] for _ in range(3 if cycles > 20 else 6)]
    assert np.allclose(np.diff(stamps), cycles * PERIOD, atol=1e-9)


def test_protocol_version_one(box):
    """No frequency, no recipe ids for outputs, the full rate."""
    with StrictRtde(box, protocol=1) as client:
        client.want("timestamp", "actual_q", "output_int_register_3")
        assert client.inputs("input_int_register_9").number == 1
        assert client.start()
        stamps = [client.data()["timestamp"] for _ in range(10)]
        assert np.allclose(np.diff(stamps), PERIOD, atol=1e-9)
        client.pause()


def test_a_version_that_is_none_is_refused_and_the_connection_lives(box):
    with StrictRtde(box) as client:
        assert client.ask(ord("V"), struct.pack(">H", 7)) == b"\0"
        assert client.controller()[0] == 3


def test_unknown_outputs_are_named_and_give_no_data(box):
    with StrictRtde(box) as client:
        _, types = client.types_of_outputs(("timestamp", "actual_nothing", "joint_position_deviation_ratio"))
        assert types == ["DOUBLE", "NOT_FOUND", "NOT_FOUND"]
        client.want("timestamp")
        assert client.start()
        assert client.data()["timestamp"] > 0


def test_a_list_that_ends_in_a_comma_is_answered_without_one(box):
    with StrictRtde(box) as client:
        reply = client.ask(OUTPUTS, struct.pack(">d", 125.0) + b"timestamp,robot_mode,")
        assert reply[1:] == b"DOUBLE,INT32"
        assert client.ask(INPUTS, b"input_int_register_9,")[1:] == b"INT32"


def test_inputs_belong_to_the_first_and_are_free_when_it_has_gone(box):
    first, second = StrictRtde(box), StrictRtde(box)
    names = ("input_int_register_30", "input_double_register_30")
    with first, second:
        assert first.inputs(*names).number == 1
        assert first.inputs(names[0]).number == 2, "one connection may name a variable again"
        assert second.inputs("input_int_register_31", *names) == ["INT32", "IN_USE", "IN_USE"]
        assert second.inputs("input_int_register_31").number == 1
        first.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        first.sock.close()  # by a reset, as a client that dies
        for _ in range(100):
            if not isinstance(recipe := second.inputs(*names), list):
                break
        assert recipe.number == 2


def test_pause_and_input_without_any_start(box):
    with StrictRtde(box) as writer, StrictRtde(box) as reader:
        reader.want("timestamp", "input_int_register_32")
        reader.start()
        recipe = writer.inputs("input_int_register_32")
        writer.write(recipe, input_int_register_32=77)
        reader.until(lambda v: v["input_int_register_32"] == 77)
        writer.pause()
        writer.write(recipe, input_int_register_32=0)
        reader.until(lambda v: v["input_int_register_32"] == 0)


def test_data_of_the_wrong_length_is_survived(box):
    with StrictRtde(box) as client:
        client.want("timestamp", "input_int_register_33", "input_double_register_33")
        recipe = client.inputs("input_int_register_33", "input_double_register_33")
        client.start()
        exact = recipe.pack(input_int_register_33=5, input_double_register_33=2.5)
        for wrong in (exact[:-4], exact[:1], exact + bytes(48), b"", b"\x09" + exact[1:]):
            client.send(DATA, wrong)
        client.write(recipe, input_int_register_33=6, input_double_register_33=3.5)
        values = client.until(lambda v: v["input_int_register_33"] == 6)
        assert values["input_double_register_33"] == 3.5


def test_packages_in_pieces_and_in_one(box):
    with StrictRtde(box) as client:
        request = struct.pack(">HBd", 3 + 8 + 9, OUTPUTS, 125.0) + b"timestamp"
        for byte in request:
            client.sock.sendall(bytes([byte]))
        assert client.receive() == (OUTPUTS, b"\1DOUBLE")
        client.sock.sendall(struct.pack(">HB", 3, ord("v")) * 3 + struct.pack(">HB", 3, ord("P")))
        assert [client.receive()[0] for _ in range(4)] == [ord("v")] * 3 + [ord("P")]


def test_a_text_reaches_the_log(box):
    with StrictRtde(box) as client:
        text, source = b"written by a client", b"strict"
        client.send(MESSAGE, bytes([len(text)]) + text + bytes([len(source)]) + source + b"\3")
        # A thread of the box writes the log; it may be late, so a limit for hangs.
        for _ in range(1000):
            client.controller()
            if "INFO strict: written by a client" in box.log.read_text():
                return
    raise AssertionError("the text did not reach the log")


def test_outputs_set_over_rtde_are_seen_at_once(box):
    with StrictRtde(box) as client:
        client.want("timestamp", "actual_digital_output_bits")
        recipe = client.inputs("standard_digital_output_mask", "standard_digital_output")
        client.start()
        for level in (1, 0):
            client.data()
            client.write(recipe, standard_digital_output_mask=1, standard_digital_output=level)
            seen = [client.data()["actual_digital_output_bits"] & 1 for _ in range(100)]
            assert seen[-1] == level
            assert seen == sorted(seen, reverse=not level)
