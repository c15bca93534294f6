"""What reads files: of the client (recordings, movements, settings, pens) and of the box (programs, answers).

A case is a valid sample that was spoilt, and something that reads it. It may end in one of the declared errors, whose
message is one line, in bounded memory and processor time; everything else is a finding.
"""

import io
import random
import resource
import signal
import socket
import tempfile
import time
import xmlrpc.client
import zipfile
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import fuzz_mutations as mutations
from dashboard_support import installation, urp
from recording_samples import record_movement
from urp_samples import SAMPLES

from pc_client.analysis.run import analyse_run
from pc_client.control.controller import Controller
from pc_client.errors import ClientError, one_line
from pc_client.files import FILE_KINDS
from pc_client.movements.library_sets import LIBRARY_FOLDER
from pc_client.movements.movement import load_movement
from pc_client.recording.recording import load_recording
from pc_client.studies.extraction.pen import contents, parse_pen, pen_sources
from pc_client.studies.sweep.settings import read_config
from ur_emulator.errors import ProgramFileError
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.script_network.loop_network import LoopNetwork
from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.io.network import Network
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.scripting.rpc_builtins import RpcBuiltins
from ur_emulator.program_files.compiling import load_and_compile
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation_reader import NEW_BOX, load_installation
from ur_hil.cell import load_cell
from urscript.errors import ScriptRuntimeError

# --- cases

# Of one case: processor time [s] and growth of the highest memory use of the process [bytes].
MOST_TIME = 20.0
MOST_MEMORY = 150 << 20
_LONGEST_MESSAGE = 2000


@dataclass(frozen=True)
class Target:
    """Something that reads what others have written.

    Attributes:
        samples: valid contents.
        mutate: spoils one of them.
        read: reads content; gets an empty folder for files.
        errors: what it may raise.
    """

    samples: Callable[[], tuple[bytes, ...]]
    mutate: Callable[[random.Random, bytes], bytes]
    read: Callable[[bytes, Path], object]
    errors: tuple[type[Exception], ...]


class TooMuchTime(BaseException):
    """A case has taken too much processor time; nothing that it calls may catch this."""


def run_case(target, data, folder):
    """Let a target read data; raise AssertionError, or what it raised, if that is a finding."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with _limited_time():
        try:
            target.read(data, folder)
        except target.errors as error:
            message = one_line(error) if isinstance(error, ClientError) else str(error)
            assert message, "an error without a message"
            assert "\n" not in message, f"more than a line: {message[:200]!r}"
            assert len(message) <= _LONGEST_MESSAGE, f"{len(message)} characters: {message[:200]!r}..."
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) << 10
    assert grown <= MOST_MEMORY, f"the case took {grown >> 20} MiB"


def make_case(name, target, seed, number):
    """Return the data of one case: the same for the same name, seed and number."""
    rng = random.Random(f"{name}/{seed}/{number}")
    return target.mutate(rng, rng.choice(target.samples()))


def run_cases(name, target, seed, numbers):
    """Run cases of a target; yield the number, the data and the error of each finding."""
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            data = make_case(name, target, seed, number)
            try:
                run_case(target, data, Path(folder))
            except (Exception, TooMuchTime) as error:
                yield number, data, error


@contextmanager
def _limited_time():
    def end(number, frame):
        raise TooMuchTime(f"more than {MOST_TIME:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, end)
    signal.setitimer(signal.ITIMER_VIRTUAL, MOST_TIME)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


# --- the client


ROOT = Path(__file__).parents[2]


def _file(suffix, read):
    """Return a reader of content by a reader of files."""

    def read_content(data, folder):
        path = folder / f"case{suffix}"
        path.write_bytes(data)
        return read(path)

    return read_content


@cache
def _recordings():
    with tempfile.TemporaryDirectory() as folder:
        return tuple(
            record_movement(Path(folder) / f"{k}.mcap", duration=duration, rest=0.05).read_bytes()
            for k, duration in enumerate((0.12, 0.4))
        )


def _report(path):
    analyse_run(load_recording(path))


_PEN = b"0,0,0\n" + b"".join(b"%.3f,%.4f,%.4f\n" % (0.01 * k, 0.001 * k * k, 0.002 * k) for k in range(1, 60))
_SAMPLES = b"x,y,z,t\n" + b"".join(
    b"%.4f,%.4f,0.2,%.2f\n" % (0.2 + 0.001 * k, 0.1, 0.01 * k) for k in range(60)
)


@cache
def _archives():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("a.csv", "sub/b.csv", "read me.md"):
            archive.writestr(name, _PEN)
    return (packed.getvalue(),)


def _read_archive(path):
    errors = []
    for source, content in contents(pen_sources([path])):
        try:
            if isinstance(content, Exception):
                raise content
            parse_pen(content, source.name)
        except ClientError as error:
            errors.append(error)
    if errors:
        raise errors[0]


@cache
def _texts(*paths):
    return tuple(path.read_bytes() for path in paths)


def _movement_samples():
    names = ("paper/lognorm_4_1", "paper/uniform_4_1", "arcs/lognorm_5_2", "arcs/uniform_4_1")
    return _texts(*(LIBRARY_FOLDER / f"{name}.toml" for name in names))


def _read_movement(path):
    movement = load_movement(path)
    movement.sample([0.0, 0.5 * movement.duration, movement.duration])


def _of_client(samples, mutate, read):
    return Target(samples, mutate, read, (ClientError,))


CLIENT_FILES = {
    "recording": _of_client(_recordings, mutations.mutate_mcap, _file(".mcap", _report)),
    "movement": _of_client(_movement_samples, mutations.mutate_toml, _file(".toml", _read_movement)),
    "samples": _of_client(lambda: (_SAMPLES,), mutations.mutate_table, _file(".csv", _read_movement)),
    "cell": _of_client(
        lambda: _texts(ROOT / "examples" / "cell.toml"),
        mutations.mutate_toml,
        _file(".toml", partial(load_cell, kind=FILE_KINDS["cell"])),
    ),
    "controller": _of_client(
        lambda: (b'base = "paper"\ngain_p = 10.0\ngain_i = 1.5\nuses_ilc = true\n',),
        mutations.mutate_toml,
        _file(".toml", Controller.from_toml),
    ),
    "sweep": _of_client(
        lambda: (b'movements = ["uniform_4_1"]\nseeds = [1, 2]\n[controller]\ngain_p = [1.0, 2.0]\n',),
        mutations.mutate_toml,
        _file(".toml", read_config),
    ),
    "pen": _of_client(lambda: (_PEN,), mutations.mutate_table, lambda data, folder: parse_pen(data, "a.csv")),
    "archive": _of_client(_archives, mutations.mutate_zip, _file(".zip", _read_archive)),
}


# --- the box


_MOST_TURNS = 10_000  # of a call

_CATALOGUE = CB3.software(CB3.parse_version(CB3.default_version)).catalogue


@cache
def _programs():
    nodes = "".join(sample.nodes for sample in SAMPLES.values() if not sample.words)
    return (
        *(sample.file() for sample in SAMPLES.values()),
        *(urp(nodes, once=once) for once in (True, False)),
    )


def _in_folder(name, read):
    def read_content(data, folder):
        (folder / name).write_bytes(data)
        read(ProgramFolder(folder), name)

    return read_content


def _load_program(folder, name):
    load_and_compile(folder, name, NEW_BOX, _CATALOGUE)


class _Answers:
    """An XML-RPC server that answers with the data of a case, and the network of a box; both turn by turn."""

    def __init__(self):
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self._loop = EventLoop(precise=False)
        self._network = network = Network()
        self._outside = LoopNetwork(
            self._loop, network, CB3.period_s, network.take, self._report, "127.0.0.1"
        )
        self._clock = Clock(CB3, 0)
        self._defects = []

    def _report(self, what, error):
        self._defects.append((what, error))

    def read(self, data, folder):
        remotes = RpcBuiltins(self._network, self._clock)
        factory = remotes.functions()["rpc_factory"]
        handle = factory(None, "xmlrpc", f"127.0.0.1:{self._server.getsockname()[1]}")
        steps, answering = handle.call_method(None, "value", [1], {}), self._answer(data)
        try:
            blocked = next(steps)
            for _ in range(_MOST_TURNS):
                if blocked.ready():
                    break
                next(answering, None)
                self._turn()
            else:
                raise AssertionError("the call does not end")
            next(steps)
        except StopIteration:
            pass
        finally:
            answering.close()
            remotes.end()
            self._outside.carry_out(self._network.take_requests())
        assert not self._defects, self._defects

    def _answer(self, data):
        """Answer one call, as much in a step as the box takes."""
        while not (accepted := _at_once(self._server.accept)):
            yield
        with accepted[0] as client:
            client.setblocking(False)
            while not _at_once(client.recv, 1 << 16):
                yield
            while data:
                data = data[_at_once(client.send, data) or 0 :]
                yield
            _at_once(client.shutdown, socket.SHUT_WR)
            while True:
                yield

    def _turn(self):
        self._clock.tick += 1
        self._outside.carry_out(self._network.take_requests())
        for service in tuple(self._loop._services):
            service.advance(time.monotonic())
        self._loop.call_soon(_nothing, _raise)  # so that it does not wait
        self._loop._dispatch(time.monotonic() + 60.0)


def _nothing():
    pass


def _raise(error):
    raise error


def _at_once(call, *arguments):
    """Return what a call on a socket that does not wait returns, None if it would wait or the other end has gone."""
    try:
        return call(*arguments)
    except OSError:
        return None


@cache
def _answers():
    return _Answers()


_POSE = dict.fromkeys(("x", "y", "z", "rx", "ry", "rz"), 0.5)
_VALUES = (1, 2.5, "a text", True, [1, 2, 3], [1.0, 2], [[1, 2], [3, 4]], [], None, _POSE)


@cache
def _responses():
    bodies = [xmlrpc.client.dumps((value,), methodresponse=True, allow_none=True) for value in _VALUES]
    bodies.append(xmlrpc.client.dumps(xmlrpc.client.Fault(3, "not today")))
    head = "HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: {}\r\n\r\n"
    return tuple((head.format(len(body)) + body).encode() for body in bodies)


BOX_FILES = {
    "program": Target(
        _programs, mutations.mutate_packed_xml, _in_folder("case.urp", _load_program), (ProgramFileError,)
    ),
    "installation": Target(
        lambda: (installation("10.1.2.3", "50010"),),
        mutations.mutate_packed_xml,
        _in_folder("case.installation", load_installation),
        (ProgramFileError,),
    ),
    "answer": Target(
        _responses,
        mutations.mutate_http,
        lambda data, folder: _answers().read(data, folder),
        (ScriptRuntimeError,),
    ),
}

TARGETS = {**CLIENT_FILES, **BOX_FILES}
