"""What an attack is, how it is run, what came of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from typing import Any

from box_under_attack import KINDS, MOST_MEMORY, BoxUnderAttack, Kind, Seen, serving, watching

Run = Callable[[BoxUnderAttack, float], str | None]


@dataclass(frozen=True, slots=True)
class Attack:
    """A row of the table.

    Attributes:
        name: of its function.
        what: what is done.
        limit: what stops it: a limit and what happens beyond it; "" where nothing is refused.
        run: does it, for about so many seconds, never for more than a minute; may return a remark. An
            `AssertionError` or `OSError` says that the box has not behaved.
        kinds: names of the boxes that it applies to.
        unread_log: it needs a box of its own, whose log goes to a pipe that nobody reads.
        is_short: it makes sense within a moment, too, and belongs to `make nightly`.
    """

    name: str
    what: str
    limit: str
    run: Run
    kinds: tuple[str, ...] = tuple(KINDS)
    unread_log: bool = False
    is_short: bool = True


@dataclass(slots=True)
class Section:
    """The attacks of a module, in the order of the table."""

    title: str
    attacks: list[Attack] = field(default_factory=list)

    def attack(self, what: str, limit: str = "", **settings: Any) -> Callable[[Run], Run]:
        """Add the function below as an attack; see `Attack`."""

        def add(run: Run) -> Run:
            name = run.__name__.replace("_", " ")
            self.attacks.append(Attack(name, what, limit, run, **settings))
            return run

        return add


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of an attack.

    Attributes:
        seen: by the bystanders.
        problems: a line each; none if the box has withstood.
        remark: of the attack.
        stop_s: from SIGTERM to the end of the process; nan if the box goes on.
    """

    seen: Seen
    problems: tuple[str, ...]
    remark: str
    stop_s: float


def served(attack: Attack, kind: Kind) -> AbstractContextManager[BoxUnderAttack]:
    """Serve a box of this kind that an attack may begin with."""
    return serving(kind, unread_log=attack.unread_log)


def watched(attack: Attack, kind: Kind, seconds: float) -> Outcome:
    """Attack a box of its own, with bystanders."""
    with served(attack, kind) as box:
        outcome = attacked(attack, box, seconds)
        return outcome if box.is_stopped else replace(outcome, stop_s=box.stop())


def attacked(attack: Attack, box: BoxUnderAttack, seconds: float) -> Outcome:
    """Attack a box with bystanders, which see what is left behind too; it goes on."""
    began = time.monotonic()
    with watching(box) as seen:
        remark, problems = _attacked(attack, box, seconds)
        while not box.is_stopped and time.monotonic() < began + seconds:
            time.sleep(0.02)
    problems += box.problems()
    if seen.memory_mb > MOST_MEMORY:
        problems.append(f"memory: {seen.memory_mb:.0f} MB")
    if not box.is_stopped and (seen.lost or seen.closed):
        problems.append(
            f"the client of port 30003 has lost {seen.lost} cycles" + seen.closed * " and was closed"
        )
    return Outcome(seen, tuple(problems), remark, math.nan)


def _attacked(attack: Attack, box: BoxUnderAttack, seconds: float) -> tuple[str, list[str]]:
    try:
        return attack.run(box, seconds) or "", []
    except (AssertionError, OSError, EOFError) as error:
        return "", [str(error) or type(error).__name__]
