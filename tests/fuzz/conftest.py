"""What the tests of the box and of the client share is of use here too."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / folder) for folder in ("ur_emulator", "pc_client")]
