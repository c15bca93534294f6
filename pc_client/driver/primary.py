"""Ports 30001 and 30002: the robot's messages come in, our programs go out.

Of the robot states the newest sub-package of each type is kept, for what the realtime port does not report:
the speed slider, the TCP offset, the type of the arm. Both connections must be read now and then, or the
robot has to hold back its packages.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

from pc_client.driver.transport import MOST_WAITING, TcpNetwork, TcpTransport
from pc_client.driver.watchdog import require, software
from pc_client.errors import DriverError, RobotStoppedError
from protocol.errors import RemoteProtocolError
from protocol.frame_buffer import FrameBuffer
from protocol.primary.framing import SubPackage
from protocol.primary.layout import CartesianInfo, ConfigurationData, KinematicsInfo, RobotModeData
from protocol.primary.messages import (
    ErrorCodeMessage,
    KeyMessage,
    ReportLevel,
    RobotMessage,
    RuntimeExceptionMessage,
    VersionMessage,
    decode_message,
)
from protocol.primary.packages import decode_sub_package, split_state
from protocol.primary.values import (
    GlobalVariablesSetup,
    GlobalVariablesUpdate,
    TypedValue,
    decode_program_state,
)
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import OLDEST
from ur_hil.patience import LONGEST_STEP, Patience

S = TypeVar("S", bound=SubPackage)

_VERSION_TIMEOUT = 5.0
"""The version message is the first package of a connection; a box sends it at once."""

_HEADER_SIZE = 5
_ROBOT_STATE = 16
_ROBOT_MESSAGE = 20
_PROGRAM_STATE = 25
_MOST_VARIABLES, _LONGEST_VARIABLES = 1000, 4096
"""Variables that are kept, and bytes of a package of them: robots send no longer ones."""
_LONGEST_PACKAGE = 1 << 20
_KEPT = {record.SUB_TYPE for record in (RobotModeData, CartesianInfo, ConfigurationData, KinematicsInfo)}
"""Sub-packages of a state that somebody asks for."""

_OLDEST = SoftwareVersion(3, 3)
"""Form of messages before the version is known."""


class PackageStream:
    """One connection to a primary or secondary port.

    Attributes:
        version: software of the controller, once its version message came.
        variables: globals of the program that runs or was the last, by name; for people.
    """

    def __init__(self, transport: TcpTransport, network: TcpNetwork, name: str) -> None:
        self._transport = transport
        self._network = network
        self._name = name
        self._buffer = FrameBuffer(_LONGEST_PACKAGE, _HEADER_SIZE)
        self._early: list[RobotMessage] = []
        self.version: SoftwareVersion | None = None
        self.variables: dict[str, TypedValue] = {}
        self._variable_names: dict[int, str] = {}
        self._newest: dict[int, bytes] = {}
        self._unread = 0  # bytes since a poll found nothing more

    def wait_for_version(self) -> SoftwareVersion:
        """Return the controller's software version from its greeting.

        Raises:
            DriverError: no version message in time, this is no Universal Robots port, or the software is of
                a CB2, whose packages have other forms.
        """
        self._read_until(lambda: self.version is not None)
        if self.version is None:
            raise DriverError(f"the {self._name} port says nothing about its version: is this a control box?")
        if self.version < OLDEST:
            require((software(self.version),))
        return self.version

    def wait_for_configuration(self) -> ConfigurationData | None:
        """The configuration, which the first state has; None if the robot does not send it in time."""
        self._read_until(lambda: ConfigurationData.SUB_TYPE in self._newest)
        return self.newest(ConfigurationData)

    def newest(self, record: type[S]) -> S | None:
        """The newest sub-package of a type that has been read, or None; `poll` reads.

        Raises:
            DriverError: it is shorter than its oldest form.
        """
        data = self._newest.get(record.SUB_TYPE)
        if data is None:
            return None
        try:
            found = decode_sub_package(record.SUB_TYPE, data)
        except RemoteProtocolError as error:
            raise DriverError(f"the {self._name} port does not speak its protocol: {error}") from error
        assert isinstance(found, record)
        return found

    def poll(self) -> list[RobotMessage]:
        """Messages that have arrived, without waiting.

        Raises:
            DriverError: the connection broke, carries another protocol, or floods us.
        """
        while (more := self._read(0.0)) is not None:
            self._early += more
        messages, self._early, self._unread = self._early, [], 0
        return messages

    def send_program(self, text: str) -> None:
        """Send a whole program; it must end with a line break, or the robot waits for more.

        Raises:
            DriverError: the connection is gone.
        """
        self._transport.send(text.encode("latin-1"))

    def close(self) -> None:
        """Close the connection."""
        self._transport.close()

    def _read_until(self, condition: Callable[[], bool]) -> None:
        """Read until a condition holds, or until _VERSION_TIMEOUT is over."""
        waited = Patience()
        while not condition() and waited.spent(self._network.now()) <= _VERSION_TIMEOUT:
            self._early += self._read(LONGEST_STEP) or []

    def _read(self, timeout: float) -> list[RobotMessage] | None:
        """Messages in the next piece of the stream, or None when nothing came for `timeout` [s]."""
        data = self._transport.receive(timeout)
        if data == b"":
            raise DriverError(f"the robot closed the {self._name} connection")
        if data is None:
            return None
        self._unread += len(data)
        if self._unread > MOST_WAITING:
            raise DriverError(
                f"the {self._name} port floods us: more than {MOST_WAITING >> 20} MiB at once; a robot sends "
                "20 kB a second: restart it, or look what else answers there"
            )
        messages: list[RobotMessage] = []
        try:
            self._buffer.feed(data)
            while (package := self._buffer.next_frame()) is not None:
                if package[4] == _ROBOT_STATE:
                    for sub_type, body in split_state(package[_HEADER_SIZE:]):
                        if sub_type in _KEPT:
                            self._newest[sub_type] = body
                if package[4] == _PROGRAM_STATE and len(package) <= _LONGEST_VARIABLES:
                    self._take_variables(package[_HEADER_SIZE:])
                if package[4] != _ROBOT_MESSAGE:
                    continue
                message = decode_message(package[_HEADER_SIZE:], self.version or _OLDEST)
                if isinstance(message, VersionMessage):
                    self.version = SoftwareVersion(
                        message.major, message.minor, message.bugfix, message.build
                    )
                if isinstance(message, KeyMessage) and message.title == KeyMessage.STARTED:
                    self.variables.clear()  # a program without any sends no names
                messages.append(message)
        except RemoteProtocolError as error:
            raise DriverError(f"the {self._name} port does not speak its protocol: {error}") from error
        return messages

    def _take_variables(self, body: bytes) -> None:
        """Take names, which begin anew with those of another program, or values by the numbers of names.

        No movement depends on them, so what cannot be read is left out.
        """
        with suppress(RemoteProtocolError):
            match decode_program_state(body, self.version or _OLDEST):
                case GlobalVariablesSetup(start_index=start, names=names):
                    if start == 0:
                        self.variables.clear()
                        self._variable_names.clear()
                    self._variable_names |= {
                        k: name for k, name in enumerate(names, start) if k < _MOST_VARIABLES
                    }
                case GlobalVariablesUpdate(start_index=start, values=values):
                    known = self._variable_names
                    self.variables |= {known[k]: new for k, new in enumerate(values, start) if k in known}


def raise_on_error(messages: list[RobotMessage], program: str = "") -> None:
    """Turn what a robot reports about a failed program into an exception, quoting the line that failed.

    Raises:
        RobotStoppedError: a runtime exception, or an error code of a serious level.
    """
    for message in messages:
        if isinstance(message, RuntimeExceptionMessage):
            lines = program.splitlines()
            quoted = f" ({lines[message.line - 1].strip()})" if 1 <= message.line <= len(lines) else ""
            raise RobotStoppedError(
                f"the robot's program failed in line {message.line}, column {message.column}: "
                f"{message.text}{quoted}"
            )
        serious = range(ReportLevel.VIOLATION, ReportLevel.CRITICAL_FAULT + 1)
        if isinstance(message, ErrorCodeMessage) and message.report_level in serious:
            what = f"C{message.code}A{message.argument} {message.text}"
            raise RobotStoppedError(f"the robot reports {what}".rstrip())
