"""The program that runs on the robot while we stream, and the port of this computer where it dials back.

The program's text is the file `programs/velocity_receiver.script` of the `urscript` package, filled in with
our address and numbers. It is read as a data file, without importing that package: the client needs the text,
not the language.
"""

import re
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from pc_client.driver.transport import PortTakenError, TcpListener, TcpNetwork, TcpTransport
from pc_client.errors import DriverError
from protocol.errors import RemoteProtocolError
from protocol.velocity_stream import HELLO_SIZE, check_hello
from ur_hil.patience import Patience

STOP_DECELERATION = 20.0
"""Of the program's ramp to rest [rad/s2]: what a UR3 does in UR's stopping figures (manual UR3/CB3 3.10, stop
category 0 from 183 deg/s, arm stretched, 3 kg: base 20, shoulder 21, elbow 35 rad/s2; a UR5's base 13)."""

MISSED_ALLOWED = 0.016
"""For so long the last velocity is repeated when we are late [s]. UR's client library waits 20 ms.

From the last command to rest, at the fastest speed that is commanded (180 deg/s, `kinematics.arms`),
on a CB3: 8 ms until it is read, 24 ms until the ramp begins, 157 ms ramp, the dead time (16 ms on the
emulated arm), and the time in which the joints follow. On the emulated arms that makes at most 0.21 s, with
the loop of `poor` 0.23 s."""

READ_TIMEOUT = 0.5
"""Silence of ours after which the program ends [s]: the arm has come to rest by then, and stays there."""

_FILE = Path("programs") / "velocity_receiver.script"
_MARKED_LINE = re.compile(r"^(?P<begin>\s+(?P<name>\w+) = )\S+(?P<end>\s+# <- client)$", re.MULTILINE)
_ADDRESS = re.compile(r"[0-9A-Za-z.:-]+")


@cache
def receiver_template() -> str:
    """The program text, whose lines to fill in end in `# <- client`; DriverError if it is not installed."""
    spec = find_spec("urscript")  # finds a top-level package without running it
    for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
        path = Path(folder) / _FILE
        if path.is_file():
            return path.read_text(encoding="ascii")
    raise DriverError(f"the robot's program urscript/{_FILE} is missing: install ur-hil again")


def fill_template(template: str, values: Mapping[str, str | int | float]) -> str:
    """Replace the value in every marked line.

    Raises:
        DriverError: a marked line has no value, or a value no line: program and client do not fit.
    """
    marked = [match["name"] for match in _MARKED_LINE.finditer(template)]
    if sorted(marked) != sorted(values):
        raise DriverError(
            f"the robot's program wants {', '.join(sorted(marked)) or 'nothing'} filled in, this client has "
            f"{', '.join(sorted(values))}: they are of different versions, install ur-hil again"
        )
    return _MARKED_LINE.sub(lambda line: f"{line['begin']}{values[line['name']]}{line['end']}", template)


def receiver_script(host: str, port: int, *, acceleration: float, period: float) -> str:
    """The program for the robot.

    Args:
        host: our address as the robot sees it.
        port: where we listen.
        acceleration: of `speedj`, leading axis [rad/s2].
        period: control cycle of the robot [s].

    Raises:
        DriverError: the program is not installed or does not fit this client, or that is no address.
    """
    if not _ADDRESS.fullmatch(host):  # it goes into a program: no quotes, no line breaks
        raise DriverError(f"{host!r} is no address that a robot could dial")
    values: dict[str, str | int | float] = {
        "pc_address": f'"{host}"',
        "pc_port": port,
        "acceleration": float(acceleration),
        "stop_deceleration": STOP_DECELERATION,
        "read_timeout": READ_TIMEOUT,
        "missed_allowed": round(MISSED_ALLOWED / period),
    }
    return fill_template(receiver_template(), values)


REVERSE_PORT = 31000
"""The default port: always the same, so that a firewall can be opened for it.

No port of a control box (502, 29999 to 30020), and below those that systems give to clients, where another
program could hold it by chance (Linux from 32768 on, Windows and macOS from 49152 on).
"""

DIAL_TIMEOUT = 5.0
"""A program that has not dialled back after this [s] cannot reach us."""

_MOST_CALLERS = 100
"""More calls than this between two programs are no robot's."""

_POLL = 0.02
"""How long one look at the listening socket waits [s]; in between we look after the other connections."""


class ReverseServer:
    """A listening port for the calls of the robot's programs, open for a whole session.

    Args:
        address: our own address as the robot sees it; the port opens on no other.
        robot_address: the only address that may call. An emulated robot on this machine may call from any
            of this machine's loopback addresses.
        port: which one; 0: any free one; None: REVERSE_PORT, or any free one if it is taken and the robot is
            on this machine, where no firewall lies between and many emulated robots may be used at once.

    Raises:
        DriverError: the port is taken, or may not be used.
    """

    def __init__(self, network: TcpNetwork, address: str, robot_address: str, port: int | None) -> None:
        self._network = network
        self.address = address
        self._robot_address = robot_address
        self._listener = _listen(network, address, port)
        self.port = self._listener.port

    def forget_callers(self) -> None:
        """Close calls that are no longer expected; to be called before a program is started.

        Raises:
            DriverError: they do not end.
        """
        for _ in range(_MOST_CALLERS):
            if (caller := self._listener.accept(0.0)) is None:
                return
            caller.close()
        raise DriverError(
            f"more than {_MOST_CALLERS} callers wait at {self.address}:{self.port}; the robot has one "
            "program: look who else calls, or give another --reverse-port"
        )

    def accept_program(self, meanwhile: Callable[[], None], timeout: float = DIAL_TIMEOUT) -> TcpTransport:
        """Wait for the program's call and its hello.

        Args:
            meanwhile: called between two looks: reads the other connections, waits for a robot that says
                nothing at all, and raises when it reports an error.
            timeout: [s].

        Returns:
            The connection; the caller closes it.

        Raises:
            DriverError: no call in time, or the caller is not our program.
        """
        waited = Patience()
        while True:
            caller = self._listener.accept(_POLL)
            if caller is not None:
                if caller.peer_address == self._robot_address or (
                    _is_loopback(caller.peer_address) and _is_loopback(self._robot_address)
                ):
                    break
                caller.close()  # somebody else found the port
            meanwhile()
            if waited.spent(self._network.now()) > timeout:
                raise DriverError(
                    f"the robot's program did not dial back to {self.address}:{self.port} within "
                    f"{timeout:g} s: does a firewall keep it from this TCP port?"
                )
        try:
            self._read_hello(caller, meanwhile, timeout)
        except BaseException:
            caller.close()
            raise
        return caller

    def close(self) -> None:
        """Close the listening port."""
        self._listener.close()

    def _read_hello(self, caller: TcpTransport, meanwhile: Callable[[], None], timeout: float) -> None:
        waited = Patience()
        received = b""
        while len(received) < HELLO_SIZE:
            data = caller.receive(_POLL)
            if data is None and waited.spent(self._network.now()) <= timeout:
                meanwhile()
            elif data:
                received += data
            else:
                raise DriverError(
                    "the robot's program dialled back but did not say hello: it ended or is another one"
                )
        try:
            check_hello(received)
        except RemoteProtocolError as error:
            raise DriverError(f"the robot's program is not our velocity receiver: {error}") from error


def _is_loopback(address: str) -> bool:
    return address.startswith("127.")


def _listen(network: TcpNetwork, address: str, port: int | None) -> TcpListener:
    try:
        return network.listen(address, REVERSE_PORT if port is None else port)
    except PortTakenError:
        if port is not None or not _is_loopback(address):
            raise
        return network.listen(address, 0)
