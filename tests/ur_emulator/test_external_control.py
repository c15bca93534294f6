"""A PC that is asked for its program and misbehaves: a bounded wait, bounded bytes, a program that says so."""

import pytest
from box_support import FakeNetwork

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.polyscope.external_control import request_program
from ur_emulator.program_files.installation import ExternalControlPc

PC = ExternalControlPc("10.0.0.9", 50002)


def ask(sends, step=1.0):
    """Play with a PC that sends `sends(n)` in step n; return the text, the number of steps and the socket."""
    network, time = FakeNetwork(), [0.0]
    steps = request_program(network, PC, lambda: time[0])
    n_steps = 0
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value, n_steps, network.sockets[0]
        network.sockets[0].inbox += sends(n_steps)
        n_steps += 1
        time[0] += step


@pytest.mark.parametrize(
    ("sends", "step", "words"),
    [
        (lambda n: b"x" * (1 << 20), 0.01, f"it sends more than {MAX_PROGRAM} bytes"),
        (lambda n: b"x", 1.0, "within 30 s"),
        (lambda n: b"x\n", 0.09, "within 30 s"),
        (lambda n: b"", 1.0, "it sends nothing"),
    ],
    ids=["endless", "slow without an end of line", "slow lines", "nothing"],
)
def test_a_pc_that_does_not_come_to_an_end(sends, step, words):
    text, n_steps, sock = ask(sends, step)
    assert words in text
    assert text.count("\n") == 2
    assert n_steps * step <= BUDGETS.external_control_time + 10 * step
    assert not sock.is_open
