"""`python -m ur_emulator` is the command `ur-emulator`."""

from ur_emulator.cli import main

main()
