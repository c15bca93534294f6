"""Remote-procedure handles on the bench: values, waiting, errors. The server is the test."""

import pytest
from box_support import Bench

from ur_emulator.commands.programs import StopProgram
from ur_emulator.models.generations import CB3, E_SERIES
from ur_emulator.scripting.network import RemoteCallError


class FakeCall:
    """A call that ends when the test says so."""

    def __init__(self, method, arguments):
        self.method = method
        self.arguments = arguments
        self.is_done = False
        self.value = None

    def result(self):
        if isinstance(self.value, Exception):
            raise self.value
        return self.value

    def answer(self, value):
        self.value, self.is_done = value, True


class FakeServer:
    """A server whose procedures are the test."""

    def __init__(self, url):
        self.url = url
        self.calls = []
        self.closed = 0

    def call(self, method, arguments):
        self.calls.append(FakeCall(method, arguments))
        return self.calls[-1]

    def close(self):
        self.closed += 1


class RpcBench(Bench):
    """A bench whose network knows servers."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.servers = []
        self.network.remote_server = self._remote_server

    def _remote_server(self, url):
        self.servers.append(FakeServer(url))
        return self.servers[-1]

    def call(self, arguments="", url="http://10.0.0.1:8000/RPC2"):
        self.start(
            f'def p():\n  h = rpc_factory("xmlrpc", "{url}")\n  x = h.work({arguments})\n'
            '  textmsg("got ", x)\nend\n'
        )
        return self.servers[-1].calls[-1] if self.servers and self.servers[-1].calls else None

    @property
    def texts(self):
        return [event.text for event in self.events if hasattr(event, "text")]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1),
        ("-2.5", -2.5),
        ("True", True),
        ('"abc"', "abc"),
        ("[1, 2]", [1, 2]),
        ("[[1, 2], [3, 4]]", [[1, 2], [3, 4]]),
        ("p[1, 2, 3, 4, 5, 6]", {"x": 1.0, "y": 2.0, "z": 3.0, "rx": 4.0, "ry": 5.0, "rz": 6.0}),
        ('"\xc3\xa9"', "\u00e9"),
    ],
)
def test_arguments(text, value):
    (argument,) = RpcBench().call(text).arguments
    assert argument == value
    assert type(argument) is type(value)


@pytest.mark.parametrize(
    ("result", "text"),
    [
        (3, "3"),
        (0.5, "0.5"),
        (False, "False"),
        ("abc", "abc"),
        ("\u00e9", "\xc3\xa9"),
        ([1, 2], "[1, 2]"),
        ([[1, 2], [3, 4]], "[[1, 2], [3, 4]]"),
        ([1, 2.5], "[1, 2.5]"),
        ({"x": 1, "y": 2, "z": 3, "rx": 4, "ry": 5, "rz": 6.5}, "p[1, 2, 3, 4, 5, 6.5]"),
    ],
)
def test_results(result, text):
    bench = RpcBench()
    bench.call().answer(result)
    bench.tick()
    assert bench.texts[-1].replace(" ", "") == f"got {text}".replace(" ", "")


@pytest.mark.parametrize("result", [2**31, {"a": 1}, [1, "a"], [[1], [1, 2]], {"x": "a"}, object()])
def test_results_without_counterpart_end_the_program(result):
    bench = RpcBench()
    bench.call().answer(result)
    bench.tick()
    assert any("the result" in text or "rows of equal length" in text for text in bench.texts)
    assert not bench.controller.programs.is_running


@pytest.mark.parametrize(("n", "told"), [(255, "got {"), (256, "has no counterpart in a script")])
def test_members_of_a_struct_have_names_of_a_script(n, told):
    bench = RpcBench(robot="ur5e", generation=E_SERIES)
    bench.call().answer({"m" * n: 1})
    bench.tick()
    assert told in bench.texts[-1]


def test_a_failed_call_is_a_run_time_error_where_it_stands():
    bench = RpcBench()
    bench.call().answer(RemoteCallError("no such procedure"))
    bench.tick()
    (event,) = [event for event in bench.events if type(event).__name__ == "ScriptFailed"]
    assert event.line == 3
    assert "work: remote procedure call failed: no such procedure" in event.text
    assert bench.servers[0].closed == 1


def test_only_the_calling_thread_waits():
    bench = RpcBench()
    bench.start(
        'def p():\n  h = rpc_factory("xmlrpc", "http://x:1")\n  thread t():\n    sleep(0.1)\n    textmsg("alive")\n'
        "  end\n  run t()\n  h.work()\n  textmsg(1)\nend\n"
    )
    bench.tick(20)
    assert bench.texts[-1] == "alive"
    assert bench.controller.waits_outside


def test_an_address_without_scheme_is_http():
    bench = RpcBench()
    bench.call(url="10.0.0.1:8000")
    assert bench.servers[0].url == "http://10.0.0.1:8000"


def test_the_handle_closes_its_connection_itself():
    bench = RpcBench()
    bench.run(
        'def p():\n  h = rpc_factory("xmlrpc", "http://x:1")\n  h.closeXMLRPCClientConnection()\n  textmsg("on")\nend\n'
    )
    assert bench.texts == ["on"]
    assert bench.servers[0].calls == []
    assert bench.servers[0].closed == 2  # by the script, and at the end of the program


def test_a_program_that_is_stopped_closes_what_it_opened():
    bench = RpcBench()
    call = bench.call()
    bench.tick(1, StopProgram())
    assert bench.servers[0].closed == 1
    call.answer(1)
    bench.tick(3)
    assert not any(text.startswith("got") for text in bench.texts)


@pytest.mark.parametrize(
    ("arguments", "words"), [("value=1", "have no names"), ("None", "cannot be an argument")]
)
def test_arguments_that_cannot_be_sent(arguments, words):
    bench = RpcBench()
    bench.call(arguments)
    assert any(words in text for text in bench.texts)


@pytest.mark.parametrize(("generation", "cycles"), [(CB3, 1), (E_SERIES, 4)])
def test_so_many_values_are_sent_in_8_ms_and_a_longer_call_takes_the_room_of_the_next_cycles(
    generation, cycles
):
    bench = RpcBench(generation=generation)
    bench.start(
        'def p():\n  thread t():\n    h.second([1])\n  end\n  h = rpc_factory("xmlrpc", "http://10.0.0.1/")\n'
        "  x = [0" + ", 0" * 4_998 + "]\n  sync()\n  run t()\n  h.first(x)\nend\n"
    )
    bench.tick()
    [server] = bench.servers
    assert [call.method for call in server.calls] == ["first"]
    bench.tick(cycles - 1)
    assert len(server.calls) == 1
    bench.tick()
    assert [call.method for call in server.calls] == ["first", "second"]
