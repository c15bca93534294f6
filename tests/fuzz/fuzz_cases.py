"""A case: a valid sample that was spoilt, and something that reads it.

It may end in one of the declared errors, whose message is one line, in bounded memory and processor time; everything
else is a finding.
"""

import random
import resource
import signal
import tempfile
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pc_client.errors import ClientError, one_line

# Of one case: processor time [s] and growth of the highest memory use of the process [bytes].
MOST_TIME = 20.0
MOST_MEMORY = 150 << 20
_LONGEST_MESSAGE = 2000


@dataclass(frozen=True)
class Target:
    """Something that reads what others have written.

    Attributes:
        samples: valid contents.
        mutate: spoils one of them.
        read: reads content; gets an empty folder for files.
        errors: what it may raise.
    """

    samples: Callable[[], tuple[bytes, ...]]
    mutate: Callable[[random.Random, bytes], bytes]
    read: Callable[[bytes, Path], object]
    errors: tuple[type[Exception], ...]


class TooMuchTime(BaseException):
    """A case has taken too much processor time; nothing that it calls may catch this."""


def run_case(target, data, folder):
    """Let a target read data; raise AssertionError, or what it raised, if that is a finding."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with _limited_time():
        try:
            target.read(data, folder)
        except target.errors as error:
            message = one_line(error) if isinstance(error, ClientError) else str(error)
            assert message, "an error without a message"
            assert "\n" not in message, f"more than a line: {message[:200]!r}"
            assert len(message) <= _LONGEST_MESSAGE, f"{len(message)} characters: {message[:200]!r}..."
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) << 10
    assert grown <= MOST_MEMORY, f"the case took {grown >> 20} MiB"


def make_case(name, target, seed, number):
    """Return the data of one case: the same for the same name, seed and number."""
    rng = random.Random(f"{name}/{seed}/{number}")
    return target.mutate(rng, rng.choice(target.samples()))


def run_cases(name, target, seed, numbers):
    """Run cases of a target; yield the number, the data and the error of each finding."""
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            data = make_case(name, target, seed, number)
            try:
                run_case(target, data, Path(folder))
            except (Exception, TooMuchTime) as error:
                yield number, data, error


@contextmanager
def _limited_time():
    def end(number, frame):
        raise TooMuchTime(f"more than {MOST_TIME:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, MOST_TIME)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
