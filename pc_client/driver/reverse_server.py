"""Where the robot's program dials back: one caller, and only the robot."""

from __future__ import annotations

from collections.abc import Callable

from pc_client.driver.transport import Network, Transport
from pc_client.errors import DriverError
from protocol.errors import RemoteProtocolError
from protocol.velocity_stream import HELLO_SIZE, decode_hello

DIAL_TIMEOUT = 5.0
"""A program that has not dialled back after this [s] cannot reach us."""

_POLL = 0.02
"""How long one look at the listening socket waits [s]; in between we look after the other connections."""


class ReverseServer:
    """A listening port for one call of the robot's program.

    Args:
        network: opens the port.
        address: our own address as the robot sees it; the port opens on no other.
        robot_address: the only address that may call. An emulated robot on this machine may call from any
            of this machine's loopback addresses.
    """

    __slots__ = ("_address", "_listener", "_network", "_robot_address")

    def __init__(self, network: Network, address: str, robot_address: str) -> None:
        self._network = network
        self._address = address
        self._robot_address = robot_address
        self._listener = network.listen(address)

    @property
    def address(self) -> str:
        """The address to dial."""
        return self._address

    @property
    def port(self) -> int:
        """The port to dial."""
        return self._listener.port

    def accept_program(self, meanwhile: Callable[[], None], timeout: float = DIAL_TIMEOUT) -> Transport:
        """Wait for the program's call and its hello.

        Args:
            meanwhile: called between two looks: reads the other connections and raises when the robot
                reports an error.
            timeout: [s].

        Returns:
            The connection; the caller closes it.

        Raises:
            DriverError: nobody called in time, or the caller is not our program.
        """
        deadline = self._network.now() + timeout
        while True:
            caller = self._listener.accept(_POLL)
            if caller is not None:
                if _is_from(caller.peer_address, self._robot_address):
                    break
                caller.close()  # somebody else found the port
            meanwhile()
            if self._network.now() > deadline:
                raise DriverError(
                    f"the robot's program did not dial back to {self._address}:{self.port} within "
                    f"{timeout:g} s: is a firewall between the robot and this computer?"
                )
        try:
            _read_hello(caller, timeout)
        except BaseException:
            caller.close()
            raise
        return caller

    def close(self) -> None:
        """Close the listening port."""
        self._listener.close()


def _is_from(caller: str, robot: str) -> bool:
    return caller == robot or (caller.startswith("127.") and robot.startswith("127."))


def _read_hello(caller: Transport, timeout: float) -> None:
    received = b""
    while len(received) < HELLO_SIZE:
        data = caller.receive(timeout)
        if not data:
            raise DriverError(
                "the robot's program dialled back but did not say hello: it ended or is another one"
            )
        received += data
    try:
        decode_hello(received)
    except RemoteProtocolError as error:
        raise DriverError(f"the robot's program is not our velocity receiver: {error}") from error
