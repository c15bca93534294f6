r"""External Control: when a program is played, the box asks a PC for a part of it.

    box -> PC    request_program\n
    PC -> box    lines of URScript, the last one ended

Source: source text of the URCap and of the public client library.
"""

import time
from collections.abc import Callable

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.script_network.loop_network import LoopNetwork
from ur_emulator.host.steps import Steps
from ur_emulator.program_files.installation import ExternalControlPc
from ur_emulator.program_files.names import one_line

REQUEST = b"request_program\n"
# For so long the box waits for a connection and for the first line [real s]; the first is the URCap's.
CONNECT_LIMIT = 5.0
ANSWER_LIMIT = 5.0
# A PC that keeps the connection open has sent all when nothing has come for this long after a line's end.
QUIET = 0.1


def request_program(
    network: LoopNetwork, pc: ExternalControlPc, clock: Callable[[], float] = time.monotonic
) -> Steps[str]:
    """Ask a PC for its program, in steps; return what it has sent, one character a byte.

    If there is none: a program that shows what went wrong and waits for somebody to close the popup, as the
    URCap does. The clock gives real time [s].
    """
    problem = ""
    received = bytearray()
    connection = network.open(pc.host, pc.port)
    try:
        since = clock()
        while connection.is_connecting and clock() - since < CONNECT_LIMIT:
            yield
        if not connection.send(REQUEST):
            problem = connection.problem or "it cannot be reached"
        begin = since = clock()
        while not problem:
            inbox = connection.inbox
            if inbox:
                received += inbox
                inbox.clear()
                since = clock()
            elif not connection.is_open:
                break
            silence = clock() - since
            if silence > (QUIET if received.endswith(b"\n") else ANSWER_LIMIT):
                break
            if len(received) > MAX_PROGRAM:
                problem = f"it sends more than {MAX_PROGRAM} bytes"
            elif clock() - begin > BUDGETS.external_control_time:
                problem = f"it has not sent all of it within {BUDGETS.external_control_time:g} s"
            yield
    finally:
        connection.close()
    if not problem and not received.strip():
        problem = "it sends nothing"
    return _apology(pc, problem) if problem else received.decode("latin-1")


def _apology(pc: ExternalControlPc, problem: str) -> str:
    text = one_line(f"No program from the remote PC at {pc.host}:{pc.port}: {problem}")
    return f'popup("{text}", "External Control", False, True, blocking=True)\nsync()\n'
