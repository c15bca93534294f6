"""`python -m ur_pendant`: the process of a window, which takes a moment to be loaded."""

import sys

from ur_hil import run_command

if __name__ == "__main__":
    sys.argv[0] = "window"
    run_command("ur_pendant.window")
