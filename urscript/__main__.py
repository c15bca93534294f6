"""`python -m urscript` is the command `urscript`."""

from ur_hil import run_command


def main() -> None:
    """Entry point of the console script."""
    run_command("urscript.cli")


if __name__ == "__main__":
    main()
