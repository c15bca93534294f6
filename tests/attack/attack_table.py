"""All attacks, in the order of docs/security.md."""

from attacks_failures import FAILURES

SECTIONS = (FAILURES,)
