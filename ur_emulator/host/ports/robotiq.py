"""Port 63352: the variables of a Robotiq gripper, as the software of the maker offers them.

A GET is answered at once, from the present state; a SET is a command, answered after the cycle in which it
acts, and the gripper has what it writes after its next exchange. All clients, and programs at 127.0.0.1, talk
to the same grippers; which of them (SID) belongs to the connection.
"""

from collections import deque
from collections.abc import Mapping, Sequence

from protocol import robotiq
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.ports.session import Session, SessionPort
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.grippers import OperateGrippers
from ur_emulator.machine.tools.robotiq import RobotiqGripper

_REQUEST_COST = 2

_TOGETHER = BUDGETS.client_work // _REQUEST_COST
"""Answers that leave in one segment: whoever asks for many variables in one reads once. Source: RT C++."""

_TEXTS = {"NCY": "1", "SNU": "C-00000", "FWV": "GC3-1.6.16", "VER": "1.8.0"}
"""Answers that are texts. The serial number is one that no real gripper has; a number of 0 cycles
is to the maker's programs one that they could not read."""

_CONSTANTS = {"DST": 4, "PCO": 0}


class RobotiqPort(SessionPort["_RobotiqSession"]):
    """Answers requests for the variables of grippers."""

    def __init__(self, box: ServedBox, grippers: Sequence[RobotiqGripper]) -> None:
        super().__init__(box)
        self._grippers = {gripper.unit: gripper for gripper in grippers}

    def _begin(self, connection: Connection) -> "_RobotiqSession":
        return _RobotiqSession(connection, self._box, self._grippers)


class _RobotiqSession(Session):
    """A client."""

    def __init__(
        self, connection: Connection, box: ServedBox, grippers: Mapping[int, RobotiqGripper]
    ) -> None:
        super().__init__(connection, box)
        self._grippers = grippers
        self._parser = robotiq.GripperConnection()
        self._requests: deque[robotiq.Request] = deque()
        self._sid = robotiq.DEFAULT_SID
        self._written: tuple[tuple[str, int], ...] = ()  # by SETs, and not yet applied

    def _take(self, data: bytes) -> None:
        self._requests.extend(self._parser.receive(data))

    def _answer_next(self) -> Steps[int]:
        requests = [self._requests.popleft() for _ in range(min(len(self._requests), _TOGETHER))]
        answers = []
        for request in requests:
            answers.append((yield from self._answer(request)))
        yield from self._write()
        if requests and not self.connection.send(b"".join(answers)):
            self.connection.close()  # without its answer, a client takes the next one for it
        return len(requests) * _REQUEST_COST

    def _answer(self, request: robotiq.Request) -> Steps[bytes]:
        match request:
            case robotiq.Set(values=((robotiq.SID, sid),)):
                yield from self._write()
                # The maker's programs take each gripper that is acknowledged for connected, and wait for it.
                self._sid = sid
                return robotiq.ACK if self._chosen is not None else robotiq.NAK
            case robotiq.Set(values=values):
                if self._chosen is not None:
                    self._written += values
                return robotiq.ACK
            case robotiq.Get(name=name):
                yield from self._write()
                return robotiq.encode_value(request, self._value(name))
            case robotiq.Malformed(is_set=is_set):
                return robotiq.NAK if is_set else f"{robotiq.NOT_KNOWN}\n".encode()

    def _write(self) -> Steps[None]:
        """Apply what is written: in one cycle, so that a client that is faster than cycles is not behind."""
        if self._written:
            values, self._written = self._written, ()
            yield from self._box.apply(OperateGrippers((self._sid,), "set", values))

    @property
    def _chosen(self) -> RobotiqGripper | None:
        """The gripper of this connection; None if there is none with its number, or it has no power."""
        gripper = self._grippers.get(self._sid)
        return gripper if gripper is not None and gripper.has_power else None

    def _value(self, name: str) -> int | str:
        if name == robotiq.SID:
            return str([unit for unit, gripper in self._grippers.items() if gripper.has_power])
        gripper = self._chosen
        if gripper is None:
            return robotiq.NOT_KNOWN
        value = _TEXTS.get(name, _CONSTANTS.get(name, gripper.get(name)))
        return robotiq.NOT_KNOWN if value is None else value
