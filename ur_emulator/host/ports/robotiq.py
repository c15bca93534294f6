"""Port 63352: the variables of a Robotiq gripper, as the software of the maker offers them.

Answers come at once, from the present state. What a SET writes is a command for the next cycle; no answer
shows it before the next exchange of the gripper, so nobody waits for it. All clients, and programs at
127.0.0.1, talk to the same grippers; which of them (SID) belongs to the connection.
"""

from collections import deque
from collections.abc import Sequence
from functools import partial

from protocol import robotiq
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.ports.session import Session, SessionPort
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
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
    """Answers requests for the variables of `grippers`, which are known by their unit."""

    def __init__(self, box: ServedBox, grippers: Sequence[RobotiqGripper]) -> None:
        super().__init__(box, partial(_RobotiqSession, port=self))
        self.grippers = {gripper.unit: gripper for gripper in grippers}
        # What SETs have written since the cycle of that number, by unit and name.
        self._written: dict[int, dict[str, int]] = {}
        self._tick = 0

    @property
    def has_clients(self) -> bool:
        """Somebody uses the software of the gripper."""
        return bool(self._sessions)

    def write(self, unit: int, values: Sequence[tuple[str, int]]) -> None:
        """Have a gripper take variables; all that come between two cycles are one command.

        None of them is urgent: in lockstep a client may move the fingers between two velocities of a stream.
        """
        if self._tick != (tick := self._box.snapshot.tick):
            self._tick, self._written = tick, {}
        written = self._written.setdefault(unit, {})
        written.update(values)
        command = OperateGrippers((unit,), "set", tuple(written.items()))
        self._box.submit(command, in_place_of=f"gripper {unit}", urgent=False)


class _RobotiqSession(Session):
    def __init__(self, connection: Connection, box: ServedBox, port: RobotiqPort) -> None:
        super().__init__(connection, box)
        self._port = port
        self._parser = robotiq.GripperConnection()
        self._requests: deque[robotiq.Request] = deque()
        self._sid = robotiq.DEFAULT_SID

    def _take(self, data: bytes) -> None:
        self._requests.extend(self._parser.receive(data))

    def _answer_next(self) -> int:
        requests = [self._requests.popleft() for _ in range(min(len(self._requests), _TOGETHER))]
        if requests and not self.connection.send(b"".join(map(self._answer, requests))):
            self.connection.close()  # without its answer, a client takes the next one for it
        return len(requests) * _REQUEST_COST

    def _answer(self, request: robotiq.Request) -> bytes:
        match request:
            case robotiq.Set(values=((robotiq.SID, sid),)):
                # The maker's programs take each gripper that is acknowledged for connected, and wait for it.
                self._sid = sid
                return robotiq.ACK if self._chosen is not None else robotiq.NAK
            case robotiq.Set(values=values):
                if self._chosen is not None:
                    self._port.write(self._sid, values)
                return robotiq.ACK
            case robotiq.Get(name=name):
                return robotiq.encode_value(request, self._value(name))
            case robotiq.Malformed(is_set=is_set):
                return robotiq.NAK if is_set else f"{robotiq.NOT_KNOWN}\n".encode()

    @property
    def _chosen(self) -> RobotiqGripper | None:
        """The gripper of this connection; None if there is none with its number, or it has no power."""
        gripper = self._port.grippers.get(self._sid)
        return gripper if gripper is not None and gripper.has_power else None

    def _value(self, name: str) -> int | str:
        if name == robotiq.SID:
            return str([unit for unit, gripper in self._port.grippers.items() if gripper.has_power])
        gripper = self._chosen
        if gripper is None:
            return robotiq.NOT_KNOWN
        value = _TEXTS.get(name, _CONSTANTS.get(name, gripper.get(name)))
        return robotiq.NOT_KNOWN if value is None else value
