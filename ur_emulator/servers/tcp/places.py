"""How many clients a box has, by their addresses and ports: who comes on top of the limits is refused."""

from __future__ import annotations

from collections import Counter

from ur_emulator.budgets import BUDGETS


class Places:
    """The places of a box that are taken."""

    def __init__(self) -> None:
        self._taken: Counter[tuple[str | int, ...]] = Counter()

    def take(self, host: str, port: int) -> str:
        """Take a place for a client; return "", or which limit stands against it.

        Args:
            host: address of the client.
            port: number of the port that it has connected to.
        """
        for key, limit, what in _limits(host, port):
            if self._taken[key] >= limit:
                return f"{limit} clients{what} are the most"
        self._taken.update(key for key, _, _ in _limits(host, port))
        return ""

    def release(self, host: str, port: int) -> None:
        """Give back the place of a client that is gone."""
        for key, _, _ in _limits(host, port):
            self._taken[key] -= 1
            if not self._taken[key]:
                del self._taken[key]


def _limits(host: str, port: int) -> tuple[tuple[tuple[str | int, ...], int, str], ...]:
    return (
        ((host, port), BUDGETS.clients_of_port, f" of {host} at this port"),
        ((host,), BUDGETS.clients_of_address, f" of {host}"),
        ((), BUDGETS.clients, ""),
    )
