"""Unknown words in a configuration: what was given, what it is nearest to."""

from __future__ import annotations

from collections.abc import Iterable

from pc_client.errors import ClientError
from ur_hil.records import nearest


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
