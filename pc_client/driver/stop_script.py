"""What ends a motion without the receiver program: a program of our own that stops the arm, and a word."""

from __future__ import annotations

from pc_client.driver.receiver_script import STOP_DECELERATION

STOP_WORD = "stop program\n"
"""A controller's own word, no program: ends what runs or is paused. Source: public client library."""


def stop_script() -> str:
    """A program that replaces whatever runs and brings the arm to rest."""
    return f"def ur_client_stop():\n  stopj({STOP_DECELERATION})\nend\n"
