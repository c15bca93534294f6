"""RTDE, port 30004: values of a robot as they come, and inputs that are written to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Self

from pc_client.driver.transport import TcpNetwork
from pc_client.errors import DriverError
from protocol.errors import RemoteProtocolError
from protocol.rtde import codec
from protocol.rtde.client_connection import ClientEvent, DataReceived, RtdeClientConnection
from protocol.rtde.types import IN_USE, REFUSALS, RtdeValue
from protocol.ur_types import SoftwareVersion

RtdeValues = Mapping[str, RtdeValue]
"""Values of one cycle by the names of their variables."""

_CONNECT_TIMEOUT = 2.0

_PACKAGE_TIMEOUT = 1.0
"""Longest wait for one package [s]. Source: UR's RTDE client in Python."""

_MOST_PACKAGES = 100
"""Packages that are read before an answer, or the first data."""


_NO_ANSWER = "the RTDE port sends no usable answer"


class RtdeStream:
    """A connection that has been set up and started; a context manager.

    Args:
        outputs: wanted variables; those that the software does not know are left out.
        rate: packages a second.
        inputs: variables that `send` writes, in its order.

    Attributes:
        version: software of the controller.

    Raises:
        DriverError: there is no RTDE at the port, or another client writes to the inputs.
    """

    version: SoftwareVersion

    def __init__(
        self,
        network: TcpNetwork,
        host: str,
        port: int,
        outputs: Sequence[str],
        rate: float,
        inputs: Sequence[str] = (),
    ) -> None:
        self._network = network
        self._connection = network.connect(host, port, _CONNECT_TIMEOUT)
        self._rtde = RtdeClientConnection()
        self._recipe_id = 0
        try:
            self._set_up(tuple(outputs), rate, tuple(inputs))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close; harmless if closed already."""
        self._connection.close()

    def receive(self) -> RtdeValues:
        """Return the next values; those that have come meanwhile are passed over.

        Raises:
            DriverError: none come in time, the connection ended, or this is no RTDE.
        """
        newest: DataReceived | None = None
        for _ in range(_MOST_PACKAGES):
            event = self._next(wait=newest is None)
            if isinstance(event, DataReceived):
                newest = event
            elif event is None:
                break
        if newest is None:
            raise DriverError("the RTDE port sends no data")
        return MappingProxyType(dict(zip(newest.names, newest.values, strict=True)))

    def send(self, values: Sequence[RtdeValue]) -> None:
        """Write the inputs. Raises DriverError when the connection is gone."""
        self._connection.send(self._rtde.send_data(self._recipe_id, values))

    def _set_up(self, outputs: tuple[str, ...], rate: float, inputs: tuple[str, ...]) -> None:
        if self._ask(codec.RequestProtocolVersion(2)) != codec.RequestProtocolVersionReply(True):
            raise DriverError(_NO_ANSWER)
        version = self._ask(codec.GetControllerVersion())
        types = self._ask(codec.SetupOutputs(outputs, rate))
        if not (
            isinstance(version, codec.GetControllerVersionReply)
            and isinstance(types, codec.SetupOutputsReply)
        ):
            raise DriverError(_NO_ANSWER)
        self.version = version.version
        known = tuple(name for name, word in zip(outputs, types.types, strict=True) if word not in REFUSALS)
        if known != outputs:  # one refused variable refuses the recipe
            self._ask(codec.SetupOutputs(known, rate))
        if inputs:
            reply = self._ask(codec.SetupInputs(inputs))
            refused = REFUSALS.intersection(reply.types if isinstance(reply, codec.SetupInputsReply) else ())
            if refused or not isinstance(reply, codec.SetupInputsReply):
                why = "another client writes to them" if IN_USE in refused else "the software lacks them"
                raise DriverError(f"inputs {inputs[0]} to {inputs[-1]} cannot be written: {why}")
            self._recipe_id = reply.recipe_id
        if self._ask(codec.Start()) != codec.StartReply(True):
            raise DriverError(_NO_ANSWER)

    def _ask(self, request: codec.Request) -> ClientEvent:
        """Ask, and wait for the answer; data that come before it are passed over."""
        self._connection.send(self._rtde.send(request))
        for _ in range(_MOST_PACKAGES):
            event = self._next(wait=True)
            if event is not None and not isinstance(event, DataReceived):
                return event
        raise DriverError(_NO_ANSWER)

    def _next(self, *, wait: bool) -> ClientEvent | None:
        """Return the next package; texts for the log are passed over. None: nothing more is there."""
        deadline = self._network.now() + _PACKAGE_TIMEOUT
        try:
            while self._network.now() <= deadline:
                event = self._rtde.next_event()
                if event is None:
                    data = self._connection.receive(_PACKAGE_TIMEOUT if wait else 0.0)
                    if data == b"":
                        raise DriverError("the robot closed the RTDE connection")
                    if data is None:
                        break
                    self._rtde.receive_data(data)
                elif not isinstance(event, codec.RtdeTextMessage):
                    return event
        except RemoteProtocolError as error:
            raise DriverError(f"the RTDE port does not speak its protocol: {error}") from error
        if wait:
            raise DriverError(_NO_ANSWER)
        return None
