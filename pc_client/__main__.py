"""`python -m pc_client` is the command `ur-client`."""

from pc_client.cli import main

main()
