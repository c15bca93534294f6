"""`python -m ur_emulator` is the command `ur-emulator`."""

from ur_hil import run_command


def main() -> None:
    """Entry point of the console script."""
    run_command("ur_emulator.cli")


if __name__ == "__main__":
    main()
