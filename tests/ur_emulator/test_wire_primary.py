"""Ports 30001, 30002 and their twins without sockets: greeting, rate, what is told again, what is ignored."""

from itertools import pairwise

import pytest
from box_support import Bench, FakeConnection

from protocol.frame_buffer import FrameBuffer
from protocol.primary import layout as L
from protocol.primary import messages as M
from protocol.primary.framing import MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE
from protocol.primary.packages import RobotState, SafetyTolerances, decode_package, state_size
from protocol.primary.values import ProgramStateMessage
from protocol.script_channel import CONTROLLER_WORDS
from protocol.ur_types import SIMULATED_MASTERBOARD, RobotMode, SafetyMode, SoftwareVersion
from ur_emulator.host.ports.primary.port import PrimaryPort, message_for
from ur_emulator.host.ports.primary.robot_state import StateEncoder, setup_records
from ur_emulator.host.ports.script_intake import SPEED_WORD, WORDS, Sender
from ur_emulator.machine.commands.power import PowerOff, ReleaseBrakes
from ur_emulator.machine.commands.safety import (
    PressEmergencyStop,
    ReducedMode,
    SafeguardStop,
    TriggerFault,
    TriggerProtectiveStop,
    TriggerViolation,
)
from ur_emulator.machine.controller import events
from ur_emulator.machine.controller.safety.limit_checks import most_loaded_joint
from ur_emulator.machine.controller.safety.safety_state import limits_of
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.models.robots import robot_by_name

V3_15 = SoftwareVersion(3, 15, 8)
# Those in which a part of the greeting changes, and those before.
VERSIONS = [
    SoftwareVersion.parse(text)
    for text in ("3.0", "3.2", "3.3", "3.9", "3.10", "3.15", "5.0.5", "5.9.4", "5.12", "5.26")
]


class Client(FakeConnection):
    """A client that reads packages."""

    def take(self, version):
        """All packages since the last call, with their sizes."""
        buffer = FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)
        buffer.feed(b"".join(self.sent))
        self.sent.clear()
        return [(decode_package(frame, version), len(frame)) for frame in iter(buffer.next_frame, None)]


class PortBench(Bench):
    """A controller with its four primary and secondary ports; `intake` notes what would be run."""

    def __init__(self, version=V3_15, **kwargs):
        robot, generation = ("ur3", CB3) if version.major == 3 else ("ur5e", E_SERIES)
        super().__init__(robot=robot, generation=generation, **kwargs)
        self.version = version
        self.taken = []
        software = generation.software(version)
        states = StateEncoder(software, self.controller.state.arm, self.controller.state.safety)
        self.primary, self.secondary, self.primary_ro, self.secondary_ro = self.ports = [
            PrimaryPort(software, self.controller, intake, states, all_messages=every)
            for intake in (self, None)
            for every in (True, False)
        ]

    def new_sender(self):
        return Sender()

    def closed(self, sender):
        pass

    def received(self, sender, data):
        self.taken.append(data)

    def tick(self, n=1, *commands):
        for _ in range(n):
            super().tick(1, *commands)
            commands = ()
            for port in self.ports:
                for event in self.events:
                    port.send_message(event)
                port.publish(self.now)
            self.events.clear()
        return self.now


def greeting_size(version):
    """The date has 20 characters from 3.10 on and 21 before; the build number came with 3.3."""
    return 55 if version >= SoftwareVersion(3, 10) else 56 if version >= SoftwareVersion(3, 3) else 52


@pytest.mark.parametrize("version", VERSIONS, ids=str)
def test_the_greeting_of_every_version(version):
    bench = PortBench(version)
    for port, is_primary in zip(bench.ports, (True, False) * 2, strict=True):
        client = Client(port)
        assert isinstance(decode_package(client.sent[0], version), M.VersionMessage)
        packages = client.take(version)
        expected = [
            (M.VersionMessage, greeting_size(version)),
            (M.StartupMessage, 24),
            *([(SafetyTolerances, 181)] if (3, 10) <= version < (5, 11) else []),
            *([(M.HardwareInfoMessage, 27)] if is_primary and version >= (5, 26) else []),
            (RobotState, state_size(version, first=True)),
        ]
        assert [(type(package), size) for package, size in packages[: len(expected)]] == expected
        setup = packages[len(expected) - 1][0].find(L.ConfigurationData)
        assert setup.masterboard_version == SIMULATED_MASTERBOARD
        rest = packages[len(expected) :]
        assert all(isinstance(package, ProgramStateMessage) for package, _ in rest)
        assert bool(rest) == is_primary
        assert state_size(version, first=True) < 2000  # python-urx holds no longer ones


@pytest.mark.parametrize("version", [SoftwareVersion(3, 0), V3_15, SoftwareVersion(5, 12)], ids=str)
def test_ten_states_a_second_without_the_setup(version):
    bench = PortBench(version)
    client = Client(bench.secondary)
    client.take(version)
    bench.tick(bench.controller.generation.cycle_rate)
    states = client.take(version)
    assert len(states) == 10
    assert {size for _, size in states} == {state_size(version, first=False)}
    stamps = [state.find(L.RobotModeData).timestamp for state, _ in states]
    assert all(95_000 <= b - a <= 105_000 for a, b in pairwise(stamps))


def test_setup_comes_again_when_the_brakes_open():
    bench = PortBench(mode=RobotMode.POWER_OFF)
    client = Client(bench.secondary)
    client.take(V3_15)
    bench.tick(1, ReleaseBrakes())
    bench.tick(300)
    states = [state for state, _ in client.take(V3_15)]
    running = [state.find(L.RobotModeData).robot_mode == RobotMode.RUNNING for state in states]
    has_setup = [state.find(L.ConfigurationData) is not None for state in states]
    assert has_setup.count(True) == 1
    assert has_setup.index(True) == running.index(True)


@pytest.mark.parametrize(
    ("command", "shown"),
    [
        (TriggerProtectiveStop(), lambda mode: mode.is_protective_stopped),
        (PressEmergencyStop("robot"), lambda mode: mode.is_emergency_stopped),
        (PowerOff(), lambda mode: not mode.is_robot_power_on),
    ],
)
@pytest.mark.parametrize("cycles", range(3))
def test_a_change_of_mode_and_a_state_that_shows_it_are_one_write(command, shown, cycles):
    bench = PortBench()
    clients = [Client(port) for port in bench.ports]
    bench.tick(13 + cycles)  # wherever the next of the ten states a second lies
    for client in clients:
        client.sent.clear()
    bench.tick(1, command)
    for client, has_messages in zip(clients, (True, False) * 2, strict=True):
        client.sent[:] = [next(segment for segment in client.sent if len(segment) > 400)]
        *messages, state = (package for package, _ in client.take(V3_15))
        assert shown(state.find(L.RobotModeData))
        told = has_messages and not isinstance(command, PowerOff)  # no client knows a message of robot modes
        assert [type(message) for message in messages] == [M.SafetyModeMessage] * told


def test_messages_go_to_the_primary_ports_and_the_same_states_to_all():
    bench = PortBench()
    clients = [Client(port) for port in bench.ports]
    for client in clients:
        client.take(V3_15)
    bench.start('def p():\n  textmsg("hello")\n  popup("text", "title", blocking=False)\nend\n')
    bench.tick(50)
    taken = [[package for package, _ in client.take(V3_15)] for client in clients]
    told = [[type(package) for package in one if isinstance(package, M.RobotMessage)] for one in taken]
    assert told[0] == told[2] == [M.KeyMessage, M.TextMessage, M.PopupMessage, M.KeyMessage]
    assert told[1] == told[3] == []
    states = [[package for package in one if isinstance(package, RobotState)] for one in taken]
    assert len(states[0]) == 4
    assert all(other == states[0] for other in states)


def test_read_only_ports_take_no_script():
    bench = PortBench()
    for port in bench.ports:
        client = Client(port)
        port.received(client, b"stop program\ntextmsg(1)\n")
        client.close()
    assert len(bench.taken) == 2  # on 30001 and 30002


@pytest.mark.parametrize(
    ("command", "mode", "level"),
    [
        (PressEmergencyStop("robot"), SafetyMode.ROBOT_EMERGENCY_STOP, None),
        (PressEmergencyStop("system"), SafetyMode.SYSTEM_EMERGENCY_STOP, None),
        (SafeguardStop(True), SafetyMode.SAFEGUARD_STOP, None),
        (ReducedMode(True), SafetyMode.REDUCED, None),
        (TriggerProtectiveStop(), SafetyMode.PROTECTIVE_STOP, M.ReportLevel.WARNING),
        (TriggerViolation(), SafetyMode.VIOLATION, M.ReportLevel.VIOLATION),
        (TriggerFault(), SafetyMode.FAULT, M.ReportLevel.FAULT),
    ],
)
def test_every_safety_mode_has_its_message_and_level(command, mode, level):
    bench = PortBench()
    client = Client(bench.primary)
    client.take(V3_15)
    bench.tick(2, command)
    bench.tick(13)
    packages = [package for package, _ in client.take(V3_15)]
    messages = [p for p in packages if isinstance(p, M.SafetyModeMessage)]
    assert [message.safety_mode for message in messages] == [mode]
    assert all(message.timestamp % 8000 == 0 for message in messages)
    levels = [p.report_level for p in packages if isinstance(p, M.ErrorCodeMessage)]
    assert levels == ([] if level is None else [level])
    state = next(p for p in reversed(packages) if isinstance(p, RobotState))
    assert state.find(L.MasterboardData).safety_mode == mode
    assert state.find(L.MasterboardData).in_reduced_mode == (mode is SafetyMode.REDUCED)


@pytest.mark.parametrize("kind", list(M.RequestedType)[:-1])
def test_a_question_says_what_it_wants(kind):
    message = message_for(events.ValueRequested(7, kind, "How many?"), 8000)
    assert (message.request_id, message.requested_type, message.text) == (7, kind, "How many?")


def test_a_collision_names_the_joint_that_strains():
    robot = robot_by_name("ur3")
    currents = [
        0.5 * limit / constant for limit, constant in zip(robot.tau_max, robot.torque_constant, strict=True)
    ]
    for joint in range(6):
        strained = list(currents)
        strained[joint] *= -1.1
        assert most_loaded_joint(robot, tuple(strained)) == joint


def test_every_word_of_the_table_is_known_to_the_box():
    assert {word.text for word in CONTROLLER_WORDS} == {*WORDS, SPEED_WORD}


# --- what states say of the arm


@pytest.mark.parametrize(("name", "robot_type", "box_type"), [("ur3", 3, 6), ("ur10", 2, 5), ("ur5e", 1, 4)])
def test_configuration_is_that_of_the_model(name, robot_type, box_type):
    robot = robot_by_name(name)
    configuration = next(
        record
        for record in setup_records(robot, robot.dh, limits_of(robot))
        if isinstance(record, L.ConfigurationData)
    )
    assert configuration.robot_type == robot_type
    assert configuration.controller_box_type == box_type
    assert configuration.robot_sub_type == robot.generation.robot_subtype == (3 if name.endswith("e") else 2)
    assert configuration.joint_max_speed == robot.qd_safety
    assert configuration.dh_a == tuple(row.a for row in robot.dh)
    assert configuration.dh_d == tuple(row.d for row in robot.dh)


def test_configuration_of_a_ur5e_is_that_of_the_capture():
    """The first state of the maker's 5.8 simulator, but for the mark of this box."""
    bench = PortBench(SoftwareVersion(5, 8))
    (state,) = (p for p, _ in Client(bench.primary).take(bench.version) if isinstance(p, RobotState))
    assert len(state.sub_packages) == 13
    assert state_size(bench.version, first=True) == 1386
    told = state.find(L.ConfigurationData)
    assert told.joint_max_limit == pytest.approx((6.3355451848,) * 6)
    assert told.joint_min_limit == pytest.approx((-6.3355451848,) * 6)
    assert told.joint_max_speed == pytest.approx((3.341592653589793,) * 6, rel=1e-15)
    assert told.joint_max_acceleration == (40.0,) * 6
    assert (told.v_joint_default, told.a_joint_default) == (1.0471975511965976, 1.3962634015954636)
    assert (told.v_tool_default, told.a_tool_default, told.eq_radius) == (0.25, 1.2, 0.25)
    assert told.dh_a == (0.0, -0.425, -0.3922, 0.0, 0.0, 0.0)
    assert told.dh_d == (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996)
    assert told.dh_alpha == pytest.approx((1.570796327, 0.0, 0.0, 1.570796327, -1.570796327, 0.0))
    assert told.dh_theta == (0.0,) * 6
    assert (told.masterboard_version, told.controller_box_type) == (SIMULATED_MASTERBOARD, 4)
    assert (told.robot_type, told.robot_sub_type) == (1, 3)
