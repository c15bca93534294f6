"""A Robotiq gripper, reached by port 63352 of its robot: moves the fingers and waits for them.

A motion has begun when PRE is its target: OBJ is 0 no later, and until then that of the motion before. A
connection lasts for one call, so that others reach the gripper; that of a law as long as it drives the arm.
Source: reference `grippers.md` 1.3 and 1.5.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from threading import get_ident

from pc_client.driver.transport import TcpNetwork, TcpTransport
from pc_client.errors import ClientError, DriverError
from protocol.errors import RemoteProtocolError
from protocol.robotiq import NOT_KNOWN, Fault, Get, Objects, Set, Status, encode_request, take_answer
from ur_hil.patience import LONGEST_STEP, Patience
from ur_hil.records import checked, number
from ur_hil.tools import ToolModel

_TIMEOUT = 2.0  # s, for connections, answers and what it takes over; programs of the maker wait so long
_ACTIVATION_TIMEOUT = 10.0  # s
_POLL = 0.01  # s between two questions; the gripper is read every 16 ms
_HELD = (Objects.CONTACT_OPENING, Objects.CONTACT_CLOSING)


class Gripper:
    """The gripper of an `Arm`. Its first motion activates it: the fingers open and close fully.

    A person is asked before each motion of an arm that is not known to be simulated. What reaches the gripper
    raises a `ClientError` if it does not answer, has no power, reports a fault, or is late.
    """

    def __init__(self, model: ToolModel, host: str, port: int, ask: Callable[[str], None]) -> None:
        self._model = model
        self._host, self._port = host, port
        self._ask = ask
        self._force, self._speed = 0, 255
        self._law_thread, self._is_rehearsal = 0, False
        self._law_port: _Port | DriverError  # the second prevents commands

    @property
    def width(self) -> float:
        """Distance between the pads by the table of tools [m]."""
        with self._connected() as port:
            return self._model.width_of(port.get("POS"))

    @property
    def is_holding(self) -> bool:
        """The fingers press on an object."""
        with self._connected() as port:
            return port.get("GTO") == 1 and port.get("OBJ") in _HELD

    @property
    def speed(self) -> float:
        """Of the width in the motions that follow [m/s]; the fastest until it is set."""
        return self._model.speed_of(self._speed)

    @speed.setter
    def speed(self, value: float) -> None:
        self._speed = _share("speed", value, self._model.speed, "m/s")

    def force(self, newton: float) -> None:
        """Set with which force [N] a pad presses in the motions that follow; the least until it is set."""
        self._force = _share("force", newton, self._model.force, "N")

    def open(self) -> None:
        """Open fully."""
        self._move(0, "open")

    def close(self) -> None:
        """Close until something is held or nothing is left to close."""
        self._move(255, "close")

    def move(self, width: float) -> None:
        """Move until the pads are so far apart [m], or something is in their way; `is_holding` says which."""
        value = checked(number(0.0, self._model.stroke, "m"), width, "width", ClientError)
        self._move(self._model.count_of(value), f"move to {1e3 * value:.1f} mm")

    @contextmanager
    def beside_law(self, *, is_rehearsal: bool = False) -> Iterator[None]:
        """While a law drives the arm from this thread: its commands are sent, and it waits for nothing.

        Nobody is asked: who lets the law move the arm is told of the fingers. In a rehearsal nothing is sent.
        What prevents commands is raised when the law gives one.

        Raises:
            DriverError: on leaving, the gripper reports a fault, or has not taken a command.
        """
        with ExitStack() as until_then:
            try:
                self._law_port = port = until_then.enter_context(self._connected())
                if not port.is_active():
                    raise DriverError(f"the {self._model.title} is not active: open it before the law runs")
            except DriverError as error:
                self._law_port = error
            self._law_thread, self._is_rehearsal = get_ident(), is_rehearsal
            try:
                yield
            finally:
                self._law_thread = 0
            if isinstance(self._law_port, _Port):
                self._law_port.check()

    def _move(self, position: int, how: str) -> None:
        model = self._model
        force, slowest = model.force_of(self._force), model.stroke / model.speed[0]
        target = {"POS": position, "SPE": self._speed, "FOR": self._force, "GTO": 1}
        if not self._law_thread:
            self._ask(
                f"the fingers of the {model.title} at {self._host} {how}, pressing with up to {force:.0f} N"
            )
        with self._connected() as port:
            if self._law_thread == get_ident():
                if not self._is_rehearsal:
                    port.post(Set(tuple(target.items())))
                return
            if not port.is_active():
                port.set(ACT=0, ATR=0, GTO=0)
                port.wait("reset", lambda: port.get("ACT") == port.get("STA") == 0)
                port.set(ACT=1)
                port.wait("activation", lambda: port.get("STA") == Status.ACTIVE, _ACTIVATION_TIMEOUT)
            port.set(**target)
            port.wait("start", lambda: port.get("PRE") == position and port.get("GTO") == 1)
            port.wait("motion", lambda: port.get("OBJ") != Objects.MOVING, slowest + _TIMEOUT)
            port.check()

    @contextmanager
    def _connected(self) -> Iterator["_Port"]:
        if self._law_thread == get_ident():
            if isinstance(self._law_port, DriverError):
                raise self._law_port
            yield self._law_port
            return
        if not self._port:
            raise DriverError(f"no gripper: its port at {self._host} is 0; give its number in `ports`")
        try:
            transport = TcpNetwork().connect(self._host, self._port, _TIMEOUT)
        except DriverError as error:
            raise DriverError(f"no gripper: {error} (is its software installed there?)") from error
        try:
            yield _Port(transport, self._model.title)
        except RemoteProtocolError as error:
            raise DriverError(f"{self._host}:{self._port} is not the port of a gripper: {error}") from error
        finally:
            transport.close()


class _Port:
    """A connection to the software of a gripper."""

    def __init__(self, transport: TcpTransport, title: str) -> None:
        self._transport = transport
        self._title = title
        self._inbox = bytearray()
        self._asked: deque[Get | Set] = deque()  # whose answers have not been taken

    def is_active(self) -> bool:
        """The fingers can be moved at once."""
        return self.get("STA") == Status.ACTIVE and self.get("FLT") <= Fault.NOT_ACTIVATED

    def get(self, name: str) -> int:
        """The number of a variable; DriverError without power."""
        answer = self._exchange(Get(name, bare=False))
        if answer == NOT_KNOWN:
            raise DriverError(f"the {self._title} has no power: 24 V at the tool, and no emergency stop?")
        return int(answer)

    def set(self, **values: int) -> None:
        """Write variables together."""
        self._exchange(Set(tuple(values.items())))

    def wait(self, what: str, is_done: Callable[[], bool], seconds: float = _TIMEOUT) -> None:
        """Ask until it is done; DriverError for a fault, or if it takes longer."""
        waited = Patience()
        while not is_done():
            if waited.spent(time.monotonic()) > seconds:
                self.check()
                raise DriverError(f"the {self._title} is late: its {what} takes more than {seconds:.3g} s")
            time.sleep(_POLL)

    def check(self) -> None:
        """Raise DriverError if the gripper reports a fault."""
        if (fault := self.get("FLT")) > Fault.NOT_ACTIVATED:
            name = Fault(fault).name if fault in list(Fault) else "not known"
            raise DriverError(
                f"the {self._title} reports fault {fault} ({name}): the next motion activates it"
            )

    def post(self, request: Get | Set) -> None:
        """Send a request; its answer is taken before that of the next one."""
        self._transport.send(encode_request(request))
        self._asked.append(request)
        self._inbox += self._transport.receive(0.0) or b""

    def _exchange(self, request: Get | Set) -> int | str:
        self.post(request)
        waited = Patience()
        while True:
            while (answer := take_answer(self._inbox, self._asked[0])) is not None:
                self._asked.popleft()
                if not self._asked:
                    return answer
            data = self._transport.receive(LONGEST_STEP)
            if data == b"" or waited.spent(time.monotonic()) > _TIMEOUT:
                raise DriverError(f"the software of the {self._title} does not answer: restart it")
            self._inbox += data or b""


def _share(name: str, value: float, ends: tuple[float, float], unit: str) -> int:
    """0 to 255 for a value between the ends of a table."""
    least, most = ends
    return round(
        255 * (checked(number(least, most, unit), value, name, ClientError) - least) / (most - least)
    )
