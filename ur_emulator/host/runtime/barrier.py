"""The error barrier: an error ends what has caused it, and nothing else.

The code that registers a callback names the function that gets an error in it. An error in that function
has no owner any more: it ends the loop.
"""

import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

# Ends what an error belongs to: a connection, a program, a box.
Failed = Callable[[Exception], None]
# Writes into the log of a box what has ended, and the error that has ended it.
Report = Callable[[str, Exception], None]


def guarded(failed: Failed, call: Callable[..., Any], *arguments: Any) -> None:
    """Call a function; an error in it goes to `failed`."""
    try:
        call(*arguments)
    except Exception as error:
        failed(error)


def describe_error(error: Exception) -> str:
    """Return an error and where it was raised, in one line for a log."""
    frames = traceback.extract_tb(error.__traceback__, limit=-1)
    where = "".join(
        f" in {frame.name}, line {frame.lineno} of {Path(frame.filename).name}" for frame in frames
    )
    return f"{error!r}{where}"
