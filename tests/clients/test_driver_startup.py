"""A driver starts on boxes of 5.x as on a real arm: dashboard, RTDE, primary port, a first program."""

import struct

import pytest
from clients_support import connect, receive_exactly, served_box
from driver_startup import UR_TYPES, RefusedError, series, start
from primary_wire import KEY, TEXT, PrimaryWire
from strict_rtde import StrictRtde

from protocol.primary.layout import ConfigurationData
from protocol.rtde.fields import OUTPUTS
from protocol.ur_types import SoftwareVersion
from ur_emulator.controller.safety.safety_state import limits_of
from ur_emulator.models.generations import E_SERIES
from ur_emulator.models.robots import ROBOTS
from ur_emulator.ports.primary.robot_state import setup_records

# Software, and the size of its realtime frames.
SOFTWARE = {"5.3.0": 1108, "5.8.0": 1116, "5.9.4": 1140, "5.12.2": 1220, "5.15.0": 1220, "5.25.1": 1220}
# The drivers' library needs 5.9.4.
FOR_DRIVERS = [version for version in SOFTWARE if tuple(map(int, version.split("."))) >= (5, 9)]


@pytest.fixture(scope="module")
def box(tmp_path_factory, request):
    folder = tmp_path_factory.mktemp("e_series")
    with served_box(folder, "--robot", "ur5e", "--software", request.param) as served:
        served.software = request.param
        yield served


@pytest.mark.parametrize("box", FOR_DRIVERS, indirect=True)
def test_a_driver_for_this_arm_starts(box):
    started = start(box, "ur5e")
    assert ".".join(map(str, started.version[:3])) == box.software
    assert started.period == 0.002


@pytest.mark.parametrize("box", FOR_DRIVERS, indirect=True)
@pytest.mark.parametrize("ur_type", ["ur3e", "ur20"])
def test_a_driver_for_another_arm_does_not(box, ur_type):
    with pytest.raises(RefusedError):
        start(box, ur_type)


@pytest.mark.parametrize("box", SOFTWARE, indirect=True)
def test_frames_have_the_size_of_the_software(box):
    with connect(box, "realtime") as sock:
        frames = [receive_exactly(sock, SOFTWARE[box.software]) for _ in range(3)]
    assert [struct.unpack_from(">i", frame)[0] for frame in frames] == [SOFTWARE[box.software]] * 3


@pytest.mark.parametrize("box", FOR_DRIVERS, indirect=True)
def test_all_outputs_can_be_asked_for_at_once(box):
    """The library's list of all names, then the same without those that this software does not have."""
    software = SoftwareVersion.parse(box.software)
    absent = {field.name for field in OUTPUTS if not field.since.covers(software)}
    names = [field.name for field in OUTPUTS]
    with StrictRtde(box) as client:
        number, types = client.types_of_outputs(names, 500.0)
        assert {name for name, kind in zip(names, types, strict=True) if kind == "NOT_FOUND"} == absent
        assert number == (0 if absent else 1)
        client.want(*(name for name in names if name not in absent), frequency=500.0)
        assert client.start()
        assert client.data()["timestamp"] > 0.0


@pytest.mark.parametrize("box", FOR_DRIVERS, indirect=True)
def test_a_program_sent_at_once_runs_at_500_hz(box):
    with PrimaryWire(box) as wire:
        wire.write("stop program\ndef externalControl():\n\ttextmsg(get_steptime())\nend\n")
        said = [wire.message() for _ in range(5)]
    texts = [message.body.decode("latin-1") for message in said if message.kind in (KEY, TEXT)]
    assert [text[-15:] for text in texts] == ["externalControl", "0.002", "externalControl"]


@pytest.mark.parametrize("name", [name for name, robot in ROBOTS.items() if robot.generation is E_SERIES])
def test_every_arm_is_the_type_that_its_driver_expects(name):
    robot = ROBOTS[name]
    setup = setup_records(robot, robot.dh, limits_of(robot))
    (told,) = (record for record in setup if isinstance(record, ConfigurationData))
    assert (told.robot_type, series(told.robot_type, (5, 22))) == UR_TYPES[name]
