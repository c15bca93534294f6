"""Words of a configuration that nobody knows: what was given, what it is nearest to."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from pc_client.errors import ClientError


def check_keys(given: Iterable[str], known: Iterable[str], prefix: str, error: type[ClientError]) -> None:
    """Refuse keys that do not exist.

    Args:
        given: keys of a table.
        known: those that there are.
        prefix: file and table, for the message.
        error: what is raised.

    Raises:
        ClientError: the first that does not exist, with the nearest one that does; of the type `error`.
    """
    known = list(known)
    for key in given:
        if key not in known:
            raise error(f"{prefix}{key}: no such key; {nearest(key, known)}")


def nearest(word: str, known: Iterable[str]) -> str:
    """A hint for someone who wrote a word that is not among the known ones."""
    known = list(known)
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
