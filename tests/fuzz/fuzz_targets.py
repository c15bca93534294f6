"""All readers that are fuzzed, by name."""

from fuzz_box_files import BOX_FILES
from fuzz_client_files import CLIENT_FILES

TARGETS = {**CLIENT_FILES, **BOX_FILES}
