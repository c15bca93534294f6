"""The start-up of a driver that is built on the maker's client library, with its strict parsers, on a 5.x box.

It refuses what the library refuses when it is built for its own tests: sub-packages that are shorter or longer
than the software announces, another arm than the one it was started for, recipes with unknown names.
"""

import re
import struct
from dataclasses import dataclass
from itertools import pairwise

from clients_support import TIMEOUT, connect
from primary_wire import CONFIGURATION, KINEMATICS, MASTERBOARD, MODE, VERSION_MESSAGE, PrimaryWire
from strict_rtde import StrictRtde

# What a driver is started for: type code and series of the arm.
E_SERIES, UR_SERIES = "E", "UR"
UR_TYPES = {
    "ur3e": (3, E_SERIES),
    "ur5e": (1, E_SERIES),
    "ur7e": (1, E_SERIES),
    "ur10e": (2, E_SERIES),
    "ur12e": (2, E_SERIES),
    "ur16e": (4, E_SERIES),
    "ur8long": (6, UR_SERIES),
    "ur15": (9, UR_SERIES),
    "ur18": (5, UR_SERIES),
    "ur20": (7, UR_SERIES),
    "ur30": (8, UR_SERIES),
}
# Types of the arms that came after the e-Series.
_LATER_TYPES = {5, 6, 7, 8, 9}
# The output recipe of the ROS 2 driver.
OUTPUTS = (
    "timestamp", "actual_q", "actual_qd", "speed_scaling", "target_speed_fraction", "runtime_state",
    "actual_TCP_force", "actual_TCP_pose", "target_TCP_pose", "actual_digital_input_bits",
    "actual_digital_output_bits", "standard_analog_input0", "standard_analog_input1",
    "standard_analog_output0", "standard_analog_output1", "analog_io_types", "tool_mode",
    "tool_analog_input_types", "tool_analog_input0", "tool_analog_input1", "tool_output_voltage",
    "tool_output_current", "tool_temperature", "robot_mode", "safety_mode", "robot_status_bits",
    "safety_status_bits", "actual_current", "tcp_offset", "payload", "payload_cog", "payload_inertia",
)  # fmt: skip
INPUTS = (
    "speed_slider_mask", "speed_slider_fraction", "standard_digital_output_mask", "standard_digital_output",
    "configurable_digital_output_mask", "configurable_digital_output", "tool_digital_output_mask",
    "tool_digital_output", "standard_analog_output_mask", "standard_analog_output_type",
    "standard_analog_output_0", "standard_analog_output_1",
)  # fmt: skip
# First software of outputs that the driver leaves out where the robot does not have them.
_SINCE = {"payload_inertia": (5, 11)}
# What the reader holds at most of a package.
_READER_SIZE = 4096


class RefusedError(Exception):
    """The driver does not start."""


@dataclass(frozen=True)
class Started:
    """What a driver knows when it has started.

    Attributes:
        version: four numbers of the dashboard.
        period: between two data packages [s].
        robot_type: of the configuration data.
    """

    version: tuple[int, ...]
    period: float
    robot_type: int


def start(box, ur_type):
    """Start a driver for a type of arm; return what it has found out, or raise RefusedError."""
    version = ask_version(box)
    period = start_rtde(box, version)
    robot_type = read_setup(box, version)
    if (robot_type, series(robot_type, version)) != UR_TYPES[ur_type]:
        raise RefusedError(f"the robot is of type {robot_type}, software {version}: not a {ur_type}")
    return Started(version, period, robot_type)


def series(robot_type, version):
    """Return the series of an arm by type and software."""
    if version[0] < 5:
        return "CB3"
    return UR_SERIES if robot_type in _LATER_TYPES else E_SERIES


def ask_version(box):
    """Read the greeting of the dashboard, and ask it for the software: the four numbers before the bracket."""
    with connect(box, "dashboard") as sock, sock.makefile("rb") as lines:
        assert lines.readline() == b"Connected: Universal Robots Dashboard Server\n"
        sock.sendall(b"PolyscopeVersion\n")
        reply = lines.readline().decode()
    numbers = re.fullmatch(r"URSoftware (\d+\.\d+\.\d+\.\d+) \(\w{3} \d{2} \d{4}\)\n", reply)
    assert numbers, reply
    return tuple(map(int, numbers[1].split(".")))


def start_rtde(box, version):
    """Set up outputs, read data, set up inputs; return the time between two packages at the full rate [s]."""
    names = [name for name in OUTPUTS if version >= _SINCE.get(name, (0,))]
    with StrictRtde(box) as client:
        assert client.controller() == version
        rate = 500.0 if version[0] >= 5 else 125.0
        client.want(*names, frequency=rate)
        assert client.start()
        stamps = [client.data()["timestamp"] for _ in range(20)]
        client.pause()
        assert client.inputs(*INPUTS).number == 1
        assert client.start()
        assert client.data()["robot_mode"] == 7
    return round(min(after - before for before, after in pairwise(stamps)), 6)


def read_setup(box, version):
    """Read the primary port until the configuration data; return the robot type."""
    with PrimaryWire(box) as wire:
        wire.sock.settimeout(TIMEOUT)
        check_version(wire.message(VERSION_MESSAGE).body, version)
        parts = wire.state()
    sizes = {
        MODE: 42,
        MASTERBOARD: 70,
        KINEMATICS: 220,
        CONFIGURATION: 444 if version >= (5, 25, 1) else 440,
    }
    assert {part: len(parts[part]) for part in sizes} == sizes
    assert 5 + sum(5 + len(body) for body in parts.values()) < _READER_SIZE
    assert parts[MASTERBOARD][62] == 0  # no Euromap67 board, so its fields are absent
    *_, robot_type, sub_type = struct.unpack_from(">4i", parts[CONFIGURATION], 424)
    assert sub_type == 3
    return robot_type


def check_version(body, version):
    """Check the version message: the project's name, the three numbers, build 0 and a date of 20 characters."""
    name = body[1 : 1 + body[0]].decode()
    major, minor, bugfix, build = struct.unpack_from(">BBii", body, 1 + body[0])
    assert (name, major, minor, bugfix, build) == ("URControl", *version[:3], 0)
    assert re.fullmatch(r"\d\d-\d\d-\d{4}, \d\d:\d\d:\d\d", body[1 + body[0] + 10 :].decode())
