"""Loads the Modbus library when it is needed for the first time, without holding up the loop."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from ur_emulator.realtime.event_loop import EventLoop

if TYPE_CHECKING:
    from ur_emulator.servers.modbus.codec import ModbusCodec


class CodecLoader:
    """The codec of one box, once somebody has asked for it.

    Attributes:
        codec: None until it is loaded.
        problem: why it cannot be loaded; empty while nothing is known against it.
    """

    def __init__(self, loop: EventLoop) -> None:
        self._loop = loop
        self._is_asked_for = False
        self._callers: list[Callable[[], None]] = []
        self.codec: ModbusCodec | None = None
        self.problem = ""

    def start(self, then: Callable[[], None] | None = None) -> None:
        """Begin to load it; harmless if that has begun already.

        Args:
            then: called in the loop's thread once it is loaded or cannot be; not if that is known already.
        """
        if then is not None and self.codec is None and not self.problem:
            self._callers.append(then)
        if not self._is_asked_for:
            self._is_asked_for = True
            threading.Thread(target=self._load, name="modbus-library", daemon=True).start()

    def _load(self) -> None:
        """Import; in its own thread, touching nothing but the loop's call queue."""
        try:
            from ur_emulator.servers.modbus.codec import ModbusCodec

            self._loop.call_soon_threadsafe(partial(self._finish, ModbusCodec(), ""))
        except ImportError as error:
            self._loop.call_soon_threadsafe(
                partial(self._finish, None, f"pymodbus cannot be loaded ({error}): pip install pymodbus")
            )

    def _finish(self, codec: ModbusCodec | None, problem: str) -> None:
        self.codec, self.problem = codec, problem
        callers, self._callers = self._callers, []
        for call in callers:
            call()
