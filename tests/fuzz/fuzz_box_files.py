"""What reads programs, installations and answers of XML-RPC servers in the box."""

import socket
import time
import xmlrpc.client
from functools import cache

import fuzz_mutations as mutations
from dashboard_support import installation, urp
from fuzz_cases import Target
from urp_samples import SAMPLES as NODES

from ur_emulator.controller.clock import Clock
from ur_emulator.errors import ProgramFileError
from ur_emulator.models.generations import CB3
from ur_emulator.program_files.compiling import load_and_compile
from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation_reader import NEW_BOX, load_installation
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.scripting.rpc_builtins import RpcBuiltins
from ur_emulator.servers.scripts.loop_network import LoopNetwork
from urscript.errors import ScriptRuntimeError

_MOST_TURNS = 10_000  # of a call

_CATALOGUE = CB3.software(CB3.parse_version(CB3.default_version)).catalogue


@cache
def _programs():
    single = [urp(nodes) for nodes, _ in NODES.values()]
    return (
        *single,
        *(urp("".join(nodes for nodes, _ in NODES.values()), once=once) for once in (True, False)),
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
        self._network = LoopNetwork(self._loop, CB3.period_s, self._report, "127.0.0.1")
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
            remotes.close_all()
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
        self._clock.advance()
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


_VALUES = (
    1,
    2.5,
    "a text",
    True,
    [1, 2, 3],
    [1.0, 2],
    [[1, 2], [3, 4]],
    [],
    None,
    dict.fromkeys(("x", "y", "z", "rx", "ry", "rz"), 0.5),
)


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
