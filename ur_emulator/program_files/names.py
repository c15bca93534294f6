"""Names of programs, functions, threads and variables in scripts.

Source: names of programs and the names of the functions in the scripts that PolyScope saved beside them.
"""

import re

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_OTHER = re.compile(r"[^A-Za-z0-9_]")


def is_identifier(name: str) -> bool:
    """True for a name that a script can have as it is."""
    return _IDENTIFIER.fullmatch(name) is not None


def identifier(name: str) -> str:
    """Return the name of a program's function.

    A full stop is left out, a letter that is not ASCII becomes `u` and its decimal code, what else is neither
    letter nor digit becomes `_`, and a `P` stands before a digit at the start.
    """
    plain = _OTHER.sub(lambda one: "_" if one[0].isascii() else f"u{ord(one[0])}", name.replace(".", ""))
    return plain if is_identifier(plain) else f"P{plain}"


class Names:
    """Names that are taken, so that each is unique."""

    def __init__(self) -> None:
        self._taken: dict[str, int] = {}  # with the number that was tried last

    def reserve(self, name: str) -> None:
        """Note that a name is taken."""
        self._taken.setdefault(name, 1)

    def new(self, wanted: str) -> str:
        """Return a name like the wanted one that is not taken yet, and take it."""
        plain = name = identifier(wanted)
        while name in self._taken:
            self._taken[plain] += 1
            name = f"{plain}_{self._taken[plain]}"
        self._taken[name] = 1
        return name


def one_line(text: str) -> str:
    """Return a text for a string literal of a script; there are no escapes."""
    return " ".join(text.replace('"', "'").split())
