"""All attacks, in the order of docs/security.md."""

from attacks_bytes import BYTES
from attacks_clients import CLIENTS
from attacks_compiling import COMPILING
from attacks_failures import FAILURES
from attacks_places import PLACES
from attacks_scripts import SCRIPTS

SECTIONS = (FAILURES, COMPILING, SCRIPTS, CLIENTS, PLACES, BYTES)
