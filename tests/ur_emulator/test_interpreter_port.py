"""Port 30020 of an e-Series box: what the maker's example helper does, many clients, bad ones, limits."""

import pickle
import re
import socket
import zipfile
from contextlib import ExitStack

import pytest
from box_support import TIMEOUT, connect

from protocol.interpreter import CLEANED_UP, INVALID_STATE, MAX_ID, TOO_MANY
from ur_emulator.budgets import BUDGETS
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import RefusedError
from ur_emulator.machine.controller.interpreter_queue import InterpreterQueue
from ur_emulator.program_files.compiling import compile_line
from urscript.catalogue import catalogue_for
from urscript.compile.interpreter_mode import NO_NAMES
from urscript.names.living_scope import LivingScope

WAITING = 'def waiting():\n  interpreter_mode()\n  textmsg("mode ended")\n  sleep(1000)\nend\n'
IN_MODE = "def p():\n  interpreter_mode()\nend\n"
CATALOGUE = catalogue_for("5.12")
SCOPE = pickle.dumps(LivingScope())


class Helper:
    """A client like the maker's `InterpreterHelper`: a line, its answer, a number from it."""

    PATTERN = re.compile(r"(\w+):\W+(\d+)?")

    def __init__(self, box):
        self.sock = connect(box, "interpreter")
        self._file = self.sock.makefile("rb")

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._file.close()
        self.sock.close()

    def send(self, *lines):
        self.sock.sendall("".join(f"{line}\n" for line in lines).encode("latin-1"))

    def answer(self):
        line = self._file.readline().decode("latin-1")
        assert line.endswith("\n"), "the box has closed the connection"
        return line[:-1]

    def ask(self, line):
        self.send(line)
        return self.answer()

    def execute(self, line):
        reply = self.ask(line)
        match = self.PATTERN.match(reply)
        assert match[1] != "discard", reply
        return int(match[2])

    def run(self, line):
        """Execute a line and wait until it has begun."""
        number = self.execute(line)
        while self.execute("statelastexecuted") != number:
            pass
        return number


def e_series(pace="lockstep"):
    return ControlBox("ur5e", "5.12", in_process=True, pace=pace, port_base=None, fidelity="exact")


@pytest.fixture
def box():
    with e_series() as box:
        yield box


def texts(box):
    return [entry.text for entry in box.log if entry.source == "Program"]


@pytest.mark.parametrize("pace", ["lockstep", "realtime"])
def test_a_session_of_the_helper(pace):
    with e_series(pace) as box, Helper(box) as helper:
        assert helper.ask("x = 1") == f"discard: {INVALID_STATE}: x = 1"
        assert [helper.execute(f"statelast{it}") for it in ("executed", "interpreted", "cleared")] == [0] * 3
        box.run_program(WAITING)
        assert helper.run("global_like = 3") == 1
        assert helper.run('def show(n): textmsg("n is ", n) end') == 2
        assert helper.run("show(global_like)") == 3
        assert helper.execute("stateunexecuted") == 0
        assert helper.execute("statelastinterpreted") == 3
        assert helper.ask("show(missing)") == (
            "discard: Compile error: name 'missing' is not defined: show(missing)"
        )
        assert helper.ask("x = = 1").startswith("discard: Syntax error: unexpected '='")
        assert helper.run("clear_interpreter()") == 4
        assert helper.ask("show(1)").startswith("discard: Compile error: name 'show'")
        assert helper.execute("statelastcleared") == 4
        assert helper.execute("end_interpreter()") == 5
        box.wait_until(log="mode ended")
        assert helper.execute("statelastcleared") == 5
        assert "n is 3" in texts(box)
        # The line after the end waits for the next mode, which begins with an empty queue.
        helper.send("late = 1")
        box.run_program(WAITING)
        assert helper.answer() == f"discard: {INVALID_STATE}: late = 1"


def test_lines_before_the_mode_wait_for_it_if_the_program_wants_them(box):
    program = "def p():\n  while not get_digital_in({}):\n    sync()\n  end\n  interpreter_mode({})\nend\n"
    with Helper(box) as helper:
        box.run_program(program.format(0, "clearQueueOnEnter=False"))
        helper.send("x = 1", "textmsg(x)")
        assert helper.execute("stateunexecuted") == 2
        box.set_digital_input("standard", 0, True)
        assert [helper.answer(), helper.answer()] == ["ack: 1: x = 1", "ack: 2: textmsg(x)"]

        box.run_program(program.format(1, "clearQueueOnEnter=True"))
        helper.send("x = 2")
        assert helper.execute("stateunexecuted") == 1
        box.set_digital_input("standard", 1, True)
        assert helper.answer() == f"discard: {CLEANED_UP}: x = 2"


def test_many_clients_take_turns_and_ids_are_consecutive(box):
    box.run_program(IN_MODE)
    with ExitStack() as stack:
        clients = [stack.enter_context(Helper(box)) for _ in range(6)]
        clients[0].send(*(f"a{n} = {n}" for n in range(200)))
        for number, client in enumerate(clients[1:]):
            client.send(f"b{number} = 1", f"textmsg(b{number})")
        ids = [int(client.answer().split(":")[1]) for client in clients[1:] for _ in range(2)]
        ids += [int(clients[0].answer().split(":")[1]) for _ in range(200)]
        assert sorted(ids) == list(range(1, 211))
        assert max(ids[:10]) < 100, "the client with 200 lines kept the others waiting"


def test_lines_of_a_client_that_has_gone_are_executed(box):
    box.run_program(IN_MODE)
    with connect(box, "interpreter") as sock:
        sock.sendall(b'textmsg("left behind")\n')
    box.wait_until(log="left behind")


def test_a_client_that_only_reads_on_gets_its_answers(box):
    box.run_program(IN_MODE)
    with connect(box, "interpreter") as sock:
        sock.sendall(b"x = 1\ny = 2\n")
        sock.shutdown(socket.SHUT_WR)
        received = b""
        while data := sock.recv(4096):
            received += data
    assert received == b"ack: 1: x = 1\nack: 2: y = 2\n"


HOSTILE = {
    "deep": b"x = " + b"(" * 15_000 + b"\n",
    "deep and closed": b"x = " + b"(" * 9_000 + b"1" + b")" * 9_000 + b"\n",
    "deep blocks": b"if True: " * 2_000 + b"end " * 2_000 + b"\n",
    "long expression": b"x = " + b"1+" * 14_000 + b"1\n",
    "many statements": b"x = 1 " * 5_000 + b"\n",
    "many functions": b" ".join(b"def f%d(): end" % n for n in range(1_500)) + b"\n",
    "endless loop": b"thread t(): while True: end end h = run t()\n",
}


def test_a_hostile_line_disturbs_nobody(box):
    with Helper(box) as bad, Helper(box) as good:
        for name, line in HOSTILE.items():
            box.run_program(IN_MODE)
            bad.sock.sendall(line)
            assert bad.answer().split(":")[0] in ("ack", "discard"), name
            reply = good.ask("textmsg(1)")
            assert reply.startswith("ack: ") or (name == "endless loop" and INVALID_STATE in reply), name


def test_a_flood_is_bounded_and_answered(box):
    n_lines = BUDGETS.interpreter_bytes // 256
    box.run_program('def p():\n  socket_open("127.0.0.1", 1)\n  while True:\n    sleep(1000)\n  end\nend\n')
    with Helper(box) as helper, Helper(box) as other:
        helper.sock.settimeout(TIMEOUT)
        refused = 0
        for _ in range(0, n_lines + 200, 100):
            helper.send(*["x = 1"] * 100)
        while refused < 100:
            refused += helper.answer() == f"discard: {TOO_MANY}: x = 1"
        assert 0 < other.execute("stateunexecuted") <= n_lines


def test_only_software_with_the_mode_has_the_port():
    for robot, version in (("ur3", "3.15.8"), ("ur5e", "5.9.4")):
        with ControlBox(robot, version, in_process=True, port_base=None, pace="lockstep") as box:
            assert box.ports.interpreter == 0


def test_words_of_many_clients_act_once_in_a_cycle_and_are_all_answered(box):
    box.run_program(IN_MODE)
    with Helper(box) as one, Helper(box) as other:
        one.send(*["skipbuffer", "abort"] * 50)
        other.send(*["skipbuffer"] * 50)
        assert sorted(one.answer() for _ in range(100)) == 50 * ["ack: 0: abort"] + 50 * [
            "ack: 0: skipbuffer"
        ]
        assert {other.answer() for _ in range(50)} == {"ack: 0: skipbuffer"}


def test_reports_have_the_log(tmp_path):
    with ControlBox(
        "ur5e", "5.12", in_process=True, pace="lockstep", port_base=None, programs=tmp_path
    ) as box:
        box.run_program(IN_MODE)
        with Helper(box) as helper, connect(box, "dashboard") as sock, sock.makefile("r") as dashboard:
            helper.execute("x = 1")
            sock.sendall(b"generate flight report\n")
            assert "Universal Robots" in dashboard.readline()
            number = dashboard.readline().rpartition(":")[2].strip()
    with zipfile.ZipFile(tmp_path / "flightreports" / f"flightreport_{number}.zip") as archive:
        assert archive.read("interpreter.log") == b"interpreter log\ne: 0 c: 1 : x = 1\n"


# --- the queue itself


def line(queue, text, number=1):
    return compile_line(text, number, queue.scope, queue.added, CATALOGUE)


def in_mode(**flags):
    queue = InterpreterQueue()
    queue.program_started()
    queue.enter(SCOPE, **{"clear_queue": True, "clear_on_end": True, **flags})
    return queue


def test_ids_wrap_to_one():
    queue = in_mode()
    queue.last_interpreted = MAX_ID
    assert queue.append(line(queue, "x = 1"), queue.epoch) == 1


def test_so_many_lines_and_names_are_interpreted_until_they_are_cleared():
    queue = in_mode()
    for _ in range(BUDGETS.interpreter_lines):
        assert queue.append(LINE, queue.epoch)
        queue.take()
    with pytest.raises(RefusedError, match=TOO_MANY):
        queue.append(LINE, queue.epoch)
    queue.is_clearing = True
    queue.cleared()
    many = " ".join(f"n{i} = 1" for i in range(BUDGETS.interpreter_names + 1))
    with pytest.raises(RefusedError, match=TOO_MANY):
        queue.append(line(queue, many), queue.epoch)
    assert queue.append(LINE, queue.epoch) == BUDGETS.interpreter_lines + 1


LINE = compile_line("x = 1", 1, SCOPE, NO_NAMES, CATALOGUE)


def test_a_line_that_was_compiled_for_other_names_is_not_taken():
    queue = in_mode()
    epoch = queue.epoch
    queue.is_clearing = True
    queue.cleared()
    assert queue.append(LINE, epoch) == 0
    assert queue.append(LINE, queue.epoch) == 1
    queue.program_ended()
    assert queue.append(LINE, queue.epoch) == 0


@pytest.mark.parametrize("text", ["clear_interpreter()", "if False: end_interpreter() end"])
def test_names_may_change_until_such_a_line_has_ended_or_was_skipped(text):
    queue = in_mode()
    queue.append(line(queue, text), queue.epoch)
    assert not queue.takes_lines
    queue.take()
    assert not queue.takes_lines
    queue.take()
    assert queue.takes_lines
    queue.append(line(queue, text), queue.epoch)
    assert not queue.takes_lines
    queue.skip()
    assert queue.takes_lines


def test_log_files_are_those_of_the_manual():
    queue = in_mode()
    queue.append(LINE, queue.epoch)
    queue.take()
    queue.append(line(queue, "y = 2"), queue.epoch)
    lines = "interpreter log\ne: 0 c: 1 : x = 1\ne: 1 c: 2 : y = 2\n"
    assert queue.log.files == {"interpreter.log": lines}
    queue.is_clearing = True
    queue.cleared()
    assert queue.log.files == {"interpreter.0.log": lines}
    queue = in_mode(clear_on_end=False)
    queue.append(LINE, queue.epoch)
    queue.is_ending = True
    queue.leave()
    assert queue.log.files == {"interpreter.saved.log": "interpreter log\ne: 0 c: 1 : x = 1\n"}


def test_what_is_nested_too_deeply_is_discarded():
    found = compile_line("x = " + "-" * 5_000 + "1", 1, SCOPE, NO_NAMES, CATALOGUE)
    assert found == "Syntax error: the statements are nested too deeply"
