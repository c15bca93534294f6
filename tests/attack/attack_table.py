"""All attacks, in the order of docs/security.md."""

from attacks_bytes import BYTES
from attacks_clients import CLIENTS
from attacks_compiling import COMPILING
from attacks_failures import FAILURES
from attacks_grippers import GRIPPERS
from attacks_places import PLACES
from attacks_scripts import SCRIPTS
from attacks_window import WINDOW

SECTIONS = (FAILURES, COMPILING, SCRIPTS, CLIENTS, PLACES, BYTES, GRIPPERS, WINDOW)


def described() -> list[dict[str, object]]:
    """Return what the page says of each attack beside its figures."""
    return [
        {
            "name": one.name,
            "section": section.title,
            "what": one.what,
            "limit": one.limit,
            "boxes": [*one.kinds],
        }
        for section in SECTIONS
        for one in section.attacks
    ]
