"""`python -m pc_client` is the command `ur-client`."""

from ur_hil import run_command


def main() -> None:
    """Entry point of the console script."""
    run_command("pc_client.cli")


if __name__ == "__main__":
    main()
