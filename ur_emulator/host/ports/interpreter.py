"""Port 30020: the lines of interpreter mode are compiled one after the other, appended, answered.

Lines wait here while no program is in the mode, and while the names that they would find are about to change;
words get their answers before lines that wait. Clients take turns, so that one that sends thousands of lines
does not keep others waiting for all of them.
"""

from collections import Counter, deque
from dataclasses import dataclass

from protocol import interpreter
from protocol.errors import ProtocolError
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import NotRunningError, RefusedError, WorkerError
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.programs import AbortMove, AppendStatements, SkipStatements
from ur_emulator.machine.controller.command import Command
from ur_emulator.machine.controller.interpreter_queue import InterpreterQueue
from ur_emulator.program_files.compiling import compile_line

# A line costs so much beside its text [bytes].
_LINE_COST = 256
# Lines that are refused at once, one after the other, without a cycle in between.
_REFUSED_AT_ONCE = 32


# Without a text of its own: it may be long.
@dataclass(eq=False, repr=False, slots=True)
class _Line:
    """A line that waits, numbered in the order of arrival.

    Attributes:
        run: number of the program that ran then.
        n_cleanups: how often that queue had been cleaned up.
    """

    client: Connection
    text: str
    number: int
    run: int
    n_cleanups: int

    @property
    def cost(self) -> int:
        """What it is counted with [bytes]."""
        return _LINE_COST + len(self.text)


class InterpreterPort:
    """Turns the lines of its clients into statements of the running program."""

    def __init__(self, box: ServedBox) -> None:
        self._box = box
        self._lines: dict[Connection, interpreter.InterpreterConnection] = {}
        # By client; the one whose turn is next is first.
        self._waiting: dict[Connection, deque[_Line]] = {}
        self._current: _Line | None = None
        self._n_taken = self._skipped_up_to = self._n_compiled = 0
        # What the lines that have no answer are counted with [bytes].
        self._held = 0
        self._is_serving = False
        # Who waits for the answer to a word that acts in the next cycle.
        self._asking: dict[interpreter.Word, list[Connection]] = {}

    @property
    def _queue(self) -> InterpreterQueue:
        return self._box.controller.state.interpreter

    # --- clients

    def opened(self, client: Connection) -> None:
        """Wait for lines; a client that has closed its sending side still gets its answers."""
        client.allow_half_close(self._ended)
        self._lines[client] = interpreter.InterpreterConnection()

    def received(self, client: Connection, data: bytes) -> None:
        """Take lines; a client whose line has no end is disconnected."""
        lines = self._lines[client]
        try:
            lines.receive_data(data)
        except ProtocolError:
            client.close()
            return
        while (event := lines.next_event()) is not None:
            if isinstance(event, interpreter.Statements):
                self._take(client, event.text)
            else:
                self._take_word(client, event)

    def closed(self, client: Connection) -> None:
        """Forget the client; its lines are executed, as programs are whose sender has gone."""
        self._lines.pop(client, None)

    def _ended(self, client: Connection) -> None:
        """A client sends nothing more: close it when all its lines are answered."""
        if client not in self._waiting and (self._current is None or self._current.client is not client):
            client.close_when_sent()

    def _take(self, client: Connection, text: str) -> None:
        self._n_taken += 1
        line = _Line(client, text, self._n_taken, self._queue.run, self._queue.n_cleanups)
        if self._held + line.cost > BUDGETS.interpreter_bytes:
            _send(client, interpreter.discard(interpreter.TOO_MANY, text))
            return
        self._held += line.cost
        self._waiting.setdefault(client, deque()).append(line)
        if not self._is_serving:
            self._is_serving = True
            self._box.steps.start(self._serve(), self._served)

    def _take_word(self, client: Connection, word: interpreter.Word) -> None:
        queue = self._queue
        match word:
            case interpreter.Word.ABORT:
                self._act(client, word, AbortMove())
            case interpreter.Word.SKIP_BUFFER:
                self._skipped_up_to = self._n_taken
                self._act(client, word, SkipStatements())
            case interpreter.Word.LAST_EXECUTED:
                _send(client, interpreter.state(queue.last_executed, word))
            case interpreter.Word.LAST_INTERPRETED:
                _send(client, interpreter.state(queue.last_interpreted, word))
            case interpreter.Word.LAST_CLEARED:
                _send(client, interpreter.state(queue.last_cleared, word))
            case interpreter.Word.UNEXECUTED:
                n_waiting = sum(map(len, self._waiting.values())) + (self._current is not None)
                _send(client, interpreter.state(queue.n_ready + n_waiting, word))

    def _act(self, client: Connection, word: interpreter.Word, command: Command) -> None:
        """Do what a word asks for, and answer when it is done; a word acts once in a cycle."""
        if word in self._asking:
            self._asking[word].append(client)
            return
        self._asking[word] = [client]

        def done(_: object, error: Exception | None) -> None:
            answer = interpreter.acknowledge(self._queue.last_interpreted, word.value)
            for each, count in Counter(self._asking.pop(word)).items():
                if error is None:
                    _send(each, count * answer)
                else:
                    each.failed(error)

        self._box.submit(command, done)

    # --- lines

    def _why_not(self, line: _Line) -> str:
        """Return why a line is not interpreted any more; "" if it can be."""
        queue = self._queue
        if not self._box.controller.programs.is_running or line.run != queue.run:
            return interpreter.INVALID_STATE
        is_dropped = line.n_cleanups != queue.n_cleanups or line.number <= self._skipped_up_to
        return interpreter.CLEANED_UP if is_dropped else ""

    def _serve(self) -> Steps[None]:
        """Interpret or discard lines until none is left."""
        n_refused = 0
        while self._waiting:
            # The first is that of the client whose turn it is.
            next_lines = [lines[0] for lines in self._waiting.values()]
            refused = next(filter(self._why_not, next_lines), None)
            if refused is not None:
                self._take_out(refused)
                self._answer(refused, interpreter.discard(self._why_not(refused), refused.text))
                n_refused += 1
                if n_refused % _REFUSED_AT_ONCE == 0:
                    yield
            elif self._queue.takes_lines:
                line = self._current = next_lines[0]
                self._take_out(line)
                while not (answer := (yield from self._interpret(line))):
                    yield
                self._current = None
                self._answer(line, answer)
            else:
                yield

    def _served(self, _: None, error: Exception | None) -> None:
        """All lines are answered, the box has ended, or an error of ours the serving."""
        self._is_serving = False
        if error is None or isinstance(error, NotRunningError):
            return
        clients = set(self._waiting) | ({self._current.client} if self._current else set())
        self._waiting.clear()
        self._current, self._held = None, 0
        for client in clients:
            client.failed(error)

    def _take_out(self, line: _Line) -> None:
        """Take the next line of a client, which is the last in turn now."""
        lines = self._waiting.pop(line.client)
        lines.popleft()
        if lines:
            self._waiting[line.client] = lines

    def _interpret(self, line: _Line) -> Steps[bytes]:
        """Compile and append a line; return the answer, b"" if it has to wait for other names."""
        queue = self._queue
        if reason := self._why_not(line):
            return interpreter.discard(reason, line.text)
        if not queue.takes_lines:
            return b""
        catalogue = self._box.identity.software.catalogue
        epoch, self._n_compiled = queue.epoch, self._n_compiled + 1
        try:
            outcome = yield from self._box.in_worker(
                compile_line, line.text, self._n_compiled, queue.scope, queue.added, catalogue
            )
        except WorkerError as error:
            outcome = f"Compile error: {error}"
        if isinstance(outcome, str):
            return interpreter.discard(outcome, line.text)
        if self._why_not(line):
            return b""
        try:
            result = yield from self._box.apply(AppendStatements(outcome, epoch))
        except RefusedError as error:
            return interpreter.discard(str(error), line.text)
        return interpreter.acknowledge(result["id"], line.text) if result["id"] else b""

    def _answer(self, line: _Line, answer: bytes) -> None:
        """Answer a line, and close a client that sends nothing more after its last one."""
        self._held -= line.cost
        client = line.client
        _send(client, answer)
        if client.is_open and client.has_ended:
            self._ended(client)


def _send(client: Connection, answer: bytes) -> None:
    """Answer a client; one that does not read is closed, for an answer less would shift all that follow."""
    if client.is_open and not client.send(answer) and client.dropped:
        client.close()
