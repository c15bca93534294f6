"""The token of a control port: who shows it may control the box."""

from __future__ import annotations

import hmac

from ur_emulator.errors import EmulatorError

# Environment variable with the token: what stands on a command line is seen by all users of a machine.
TOKEN_VARIABLE = "UR_EMULATOR_TOKEN"
MAX_TOKEN = 200
# Printed ASCII without the blank: it goes through HTTP as it is.
_CHARACTERS = frozenset(map(chr, range(0x21, 0x7F)))


def check_token(token: str | None) -> None:
    """Check a token; None is no token.

    Raises:
        EmulatorError: it cannot stand in a header of HTTP.
    """
    if token is not None and not (0 < len(token) <= MAX_TOKEN and set(token) <= _CHARACTERS):
        raise EmulatorError(
            f"a token of {len(token)} characters given: it has 1 to {MAX_TOKEN} printed characters of ASCII, "
            "no blanks"
        )


def shows_token(authorization: str, token: str) -> bool:
    """Return whether a header `Authorization: Bearer TOKEN` shows the token."""
    scheme, _, shown = authorization.partition(" ")
    is_equal = hmac.compare_digest(shown.strip().encode("utf-8"), token.encode("utf-8"))
    return scheme.lower() == "bearer" and is_equal
