"""Numbers of a snapshot as bytes, in one generated call of `struct.pack`: this runs every cycle."""

import struct
from collections.abc import Callable, Iterable
from typing import Any

from protocol.errors import LocalProtocolError

__all__ = ["attribute", "snapshot_packer"]


def attribute(name: str, count: int) -> str:
    """The argument for an attribute of a snapshot: a number, or a tuple of `count` numbers."""
    return f"*s.{name}" if count > 1 else f"s.{name}"


def snapshot_packer(
    header: bytes,
    letters: str,
    arguments: Iterable[str],
    explain: Callable[[Any, Exception], LocalProtocolError],
) -> Callable[[Any], bytes]:
    """Make a function from a snapshot to a package: the header, then big-endian numbers.

    Args:
        letters: a letter of `struct` for each number.
        arguments: expressions of a snapshot `s`, made of names of tables only, never of what a client sent.
        explain: returns the error for a snapshot whose values do not fit.
    """
    source = (
        "def encode(s):\n"
        "    try:\n"
        f"        return pack(header, {', '.join(arguments)})\n"
        "    except (error, TypeError) as problem:\n"
        "        raise explain(s, problem) from None\n"
    )
    names: dict[str, Any] = {
        "header": header,
        "pack": struct.Struct(f">{len(header)}s{letters}").pack,
        "error": struct.error,
        "explain": explain,
    }
    exec(compile(source, "<snapshot packer>", "exec"), names)
    # Out of its own globals: a function that keeps itself alive is found by a full garbage collection only.
    encode: Callable[[Any], bytes] = names.pop("encode")
    return encode
