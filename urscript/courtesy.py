"""Long work that lets others go first.

Who compiles beside a control loop says with `giving_way` what is to be called every few dozen microseconds of
work; that call may wait until the loop sleeps. Without it nothing is called.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

GiveWay = Callable[[], None]

_current: ContextVar[GiveWay | None] = ContextVar("give_way", default=None)


@contextmanager
def giving_way(call: GiveWay) -> Iterator[None]:
    """In this block and thread, long work calls `call` between its steps."""
    token = _current.set(call)
    try:
        yield
    finally:
        _current.reset(token)


def give_way() -> GiveWay | None:
    """What work that begins now has to call between its steps; None if nothing."""
    return _current.get()
