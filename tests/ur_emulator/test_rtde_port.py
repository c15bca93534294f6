"""Port 30004 without sockets: rates, repeats while time stands still, owners, bad clients; then over real ones.

Clients of one port share: a recipe is encoded once a cycle, however many clients have it.
"""

import socket
from collections import Counter
from itertools import pairwise

import pytest
from box_support import TIMEOUT, BareBox, Bench, FakeConnection, connect
from rtde_support import RtdeClient, input_package

from protocol.rtde import codec as M
from protocol.rtde import server_connection
from protocol.rtde.client_connection import DataReceived, RtdeClientConnection
from protocol.rtde.fields import output_fields
from protocol.rtde.types import TextLevel
from protocol.ur_types import SoftwareVersion
from ur_emulator import ControlBox
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.ports.rtde import RtdePort
from ur_emulator.machine.models.generations import CB3

V3_15 = SoftwareVersion(3, 15, 8)


class Client(FakeConnection):
    """A client whose other end is a protocol of the PC."""

    def __init__(self, port):
        super().__init__(port)
        self.pc = RtdeClientConnection()

    def ask(self, request):
        self.say(self.pc.send(request))
        (event,) = self.events()
        return event

    def events(self):
        for package in self.sent:
            self.pc.receive_data(package)
        self.sent.clear()
        return list(iter(self.pc.next_event, None))

    def stamps(self):
        return [round(event.values[event.names.index("timestamp")] / 0.008) for event in self.events()]


class PortBench(Bench):
    """A controller with an RTDE port; `tick` publishes, `stand` repeats the last snapshot."""

    def __init__(self):
        super().__init__(fidelity="ideal")
        self.commands = []
        self.box = BareBox(CB3.software(V3_15), self.controller, self.commands)
        self.port = RtdePort(self.box)

    def tick(self, n=1, *commands):
        for _ in range(n):
            taken, self.commands[:] = (*commands, *self.commands), []
            super().tick(1, *taken)
            self._publish()
            commands = ()
        return self.now

    def stand(self, n):
        for _ in range(n):
            self._publish()

    def _publish(self):
        self.port.publish(self.now)
        self.box.steps.publish(self.now)

    def client(self, *names, frequency=125.0):
        client = Client(self.port)
        assert client.ask(M.RequestProtocolVersion(2)).accepted
        if names:
            assert client.ask(M.SetupOutputs(names, frequency)).recipe_id == 1
        return client

    def started(self, *names, frequency=125.0):
        client = self.client(*names, frequency=frequency)
        assert client.ask(M.Start()) == M.StartReply(True)
        return client


@pytest.fixture
def bench():
    return PortBench()


def test_data_come_from_the_reply_to_a_start_to_that_to_a_pause(bench):
    client = bench.client("timestamp")
    for _ in range(2):
        bench.tick(5)
        bench.stand(5)
        assert client.events() == []
        client.say(client.pc.send(M.Start()))
        bench.tick(2)
        assert [type(event) for event in client.events()] == [M.StartReply, DataReceived, DataReceived]
        assert client.ask(M.Pause()) == M.PauseReply(True)


@pytest.mark.parametrize(("frequency", "cycles"), [(125.0, 1), (60.0, 2), (25.0, 5)])
def test_the_rate_is_every_nth_cycle(bench, frequency, cycles):
    client = bench.started("timestamp", frequency=frequency)
    first = bench.now.tick + 1
    bench.tick(3 * cycles)
    assert client.stamps() == [first, first + cycles, first + 2 * cycles]


def test_version_1_has_the_full_rate_and_no_ids(bench):
    client = Client(bench.port)
    assert client.ask(M.SetupOutputs(("timestamp",))) == M.SetupOutputsReply(("DOUBLE",))
    client.ask(M.Start())
    bench.tick(3)
    assert all(len(package) == 3 + 8 for package in client.sent)
    assert len(client.events()) == 3


def test_while_time_stands_still_the_last_state_comes_at_the_clients_rate(bench):
    client = bench.started("timestamp", frequency=25.0)
    bench.stand(11)
    assert client.stamps() == [bench.now.tick] * 3


def test_the_cycles_that_are_sent_do_not_depend_on_how_long_time_stood_still(bench):
    client = bench.started("timestamp", frequency=25.0)
    first = bench.now.tick + 1
    bench.tick(3)
    bench.stand(4)  # less than the client's period
    bench.tick(8)
    bench.stand(4)
    assert client.stamps() == [first, first + 5, first + 10]


def test_a_state_reached_between_two_packages_is_reported_once_time_stands_still(bench):
    client = bench.started("timestamp", frequency=25.0)
    bench.tick(2)
    bench.stand(5)
    assert client.stamps() == [bench.now.tick - 1, bench.now.tick]


# --- inputs


def test_inputs_are_taken_before_start_and_act_in_the_next_cycle(bench):
    client = bench.client()
    assert client.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 1
    client.say(input_package(1, ["INT32"], 5))
    client.say(input_package(1, ["INT32"], 6))
    assert client.events() == []
    assert bench.tick().registers.input_integers[0] == 6
    assert bench.tick().registers.input_integers[0] == 6


def test_the_last_client_wins_in_a_cycle(bench):
    first, second = bench.client(), bench.client()
    assert first.ask(M.SetupInputs(("input_int_register_0", "speed_slider_mask"))).recipe_id == 1
    assert second.ask(M.SetupInputs(("input_int_register_1",))).recipe_id == 1
    second.say(input_package(1, ["INT32"], 2))
    first.say(input_package(1, ["INT32", "UINT32"], 1, 0))
    assert bench.tick().registers.input_integers[:2] == (1, 2)


def test_an_input_is_in_use_for_others_until_its_owner_is_gone(bench):
    owner, other = bench.client(), bench.client()
    assert other.ask(M.SetupInputs(("input_int_register_0", "nonsense"))).recipe_id == 0  # owns nothing
    assert owner.ask(M.SetupInputs(("input_int_register_0", "input_int_register_1"))).recipe_id == 1
    assert owner.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 2
    refused = other.ask(M.SetupInputs(("input_int_register_0", "input_int_register_2")))
    assert refused == M.SetupInputsReply(("IN_USE", "INT32"), 0)
    assert other.ask(M.SetupInputs(("input_int_register_2",))).recipe_id == 1
    assert owner.ask(M.SetupInputs(("input_int_register_2",))).types == ("IN_USE",)
    owner.close()
    assert other.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 2


def test_equal_input_recipes_are_one_object(bench):
    client = bench.client()
    names = ("input_int_register_0", "input_int_register_1") * 48
    assert [client.ask(M.SetupInputs(names)).recipe_id for _ in range(3)] == [1, 2, 3]
    (session,) = bench.port._sessions.values()
    held = session.protocol.input_recipes
    assert held[1] is held[2] is held[3]
    client.close()
    other = bench.client()
    other.ask(M.SetupInputs(names))
    (session,) = bench.port._sessions.values()
    assert session.protocol.input_recipes[1] is held[1]


@pytest.mark.parametrize(
    ("n_names", "n_taken"), [(1, BUDGETS.rtde_recipes), (50, BUDGETS.rtde_variables // 50)]
)
def test_a_client_has_so_many_input_recipes_and_variables(bench, n_names, n_taken):
    names = ("input_int_register_0",) * n_names
    client = bench.client()
    taken = [client.ask(M.SetupInputs(names)) for _ in range(n_taken)]
    assert [reply.recipe_id for reply in taken] == list(range(1, n_taken + 1))
    assert client.ask(M.SetupInputs(names)) == M.SetupInputsReply(("NOT_FOUND",) * len(names), 0)
    other = ("input_int_register_1",)
    assert bench.client().ask(M.SetupInputs(other)) == M.SetupInputsReply(("INT32",), 1)


def test_the_script_line_is_wanted_while_a_recipe_has_it(bench):
    def is_reported():
        bench.tick()
        return bench.controller.programs.reports_line

    bench.client("timestamp")
    assert not is_reported()
    one, other = bench.client("script_control_line"), bench.client("script_control_line")
    assert is_reported()
    one.close()
    assert is_reported()
    other.ask(M.SetupOutputs(("timestamp",), 125.0))
    assert not is_reported()


# --- clients that misbehave


def test_an_absurd_size_is_answered_with_a_text_and_the_end(bench):
    client = bench.client("timestamp")
    client.say(b"\0\0")
    (text,) = client.events()
    assert isinstance(text, M.RtdeTextMessage)
    assert text.level == 1
    assert not client.is_open
    assert not bench.port._sessions
    waiting = bench.client()
    waiting.close_when_sent = lambda: None  # the text still waits in the outbox
    for data in (b"\0\0", b"\0\3S"):  # nothing more is read
        waiting.say(data)
    assert [type(event) for event in waiting.events()] == [M.RtdeTextMessage]
    old = Client(bench.port)  # in version 1, it gets the text of version 1
    old.say(b"GET / HTTP/1.1\r\n\r\n")
    (text,) = old.events()
    assert text.message.startswith("an RTDE package of 18245 bytes")


@pytest.mark.parametrize("version", [1, 2])
def test_a_package_of_an_unknown_type_is_answered_with_a_text_and_the_connection_goes_on(bench, version):
    client = bench.client() if version == 2 else Client(bench.port)
    client.say(b"\0\3X\0\3\xff" + client.pc.send(M.Pause()))
    letter, number, reply = client.events()
    assert "'X' (88)" in letter.message
    assert "(255)" in number.message
    assert letter.level == number.level == TextLevel.WARNING
    assert reply == M.PauseReply(True)


def test_a_reply_that_cannot_be_sent_ends_the_connection(bench):
    client = bench.client("timestamp")
    client.full = True
    client.say(client.pc.send(M.Start()) + client.pc.send(M.Pause()))  # what follows is read no further
    assert not client.is_open
    bench.tick()
    assert client.sent == []


def test_data_for_a_full_client_is_dropped_and_the_others_get_theirs(bench):
    full, other = bench.started("timestamp"), bench.started("timestamp")
    full.full = True
    bench.tick(3)
    full.full = False
    bench.tick(1)
    assert len(full.events()) == 1
    assert len(other.events()) == 4


# --- what clients share

Q = ("timestamp", "actual_q", "actual_qd")
POSE = ("timestamp", "actual_TCP_pose")


@pytest.fixture
def encoded(monkeypatch):
    """Counts calls of encoders, by the names of the recipe's variables."""
    calls = Counter()
    original = server_connection.snapshot_encoder
    made = {}

    def counting(fields, header):
        encode = original(fields, header)
        if encode not in made:
            names = tuple(field.name for field in fields)

            def counted(snapshot):
                calls[names] += 1
                return encode(snapshot)

            made[encode] = counted
        return made[encode]

    monkeypatch.setattr(server_connection, "snapshot_encoder", counting)
    return calls


def test_fifty_clients_with_one_recipe_cost_one_encoding_a_cycle(bench, encoded):
    clients = [bench.started(*Q) for _ in range(50)]
    bench.started(*POSE)
    bench.tick(10)
    assert encoded == {Q: 10, POSE: 10}
    first = clients[0].sent
    assert len(first) == 10
    assert all(client.sent == first for client in clients)
    assert [client.stamps()[-1] for client in clients] == [bench.now.tick] * 50


def test_slow_clients_share_with_fast_ones_and_nothing_is_encoded_for_nobody(bench, encoded):
    slow = bench.started(*Q, frequency=125.0 / 4)
    bench.tick(8)
    assert encoded == {Q: 2}
    fast = bench.started(*Q)
    bench.tick(8)
    assert encoded == {Q: 10}
    assert len(fast.stamps()) == 8
    assert [b - a for a, b in pairwise(slow.stamps())] == [4, 4, 4]
    encoded.clear()
    bench.stand(5)  # a heartbeat is encoded anew once for all
    assert encoded == {Q: 5}


def test_clients_whose_recipes_have_other_numbers_get_their_own_header(bench):
    one, two = bench.started(*Q), bench.started(*POSE)
    assert two.ask(M.SetupOutputs(Q, 125.0)).recipe_id == 2
    bench.tick(1)
    assert one.sent[0][3] == 1
    assert two.sent[0][3] == 2
    assert one.sent[0][4:] == two.sent[0][4:]


def test_a_recipe_that_is_set_up_again_begins_a_new_stream(bench):
    client = bench.started(*Q, frequency=125.0 / 4)
    bench.tick(2)
    client.stamps()
    assert client.ask(M.SetupOutputs(Q, 125.0 / 4)).recipe_id == 2
    bench.tick(1)
    assert client.stamps() == [bench.now.tick]


# --- over real sockets, in lockstep

COUNT = "def c():\n  i = 0\n  while i < {}:\n    i = i + 1\n    write_output_integer_register(24, i)\n    sync()\n  end\nend\n"


@pytest.fixture
def box():
    with ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7) as running:
        yield running


def run(box, text):
    with connect(box, "secondary") as sock:
        sock.sendall(text.encode())


def test_a_whole_request_over_http_gets_the_text_about_data_that_is_not_rtde(box):
    with connect(box, "rtde") as sock:
        sock.sendall(b"POST /x HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        said = sock.makefile("rb").read()
    assert M.decode_message(said[2], said[3:], M.Role.ROBOT, 1).message.startswith("an RTDE package of")


def test_a_client_that_does_not_read_gets_whole_packages_and_does_not_stop_the_others():
    """In real time, as fast as the processor goes: the sleeper loses packages, what it gets is whole."""
    with (
        ControlBox(pace="realtime", speed=100.0, port_base=None, seed=7) as fast,
        socket.socket() as sleeper,
        connect(fast, "rtde") as sock,
    ):
        sleeper.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sleeper.settimeout(TIMEOUT)
        sleeper.connect((fast.host, fast.ports.rtde))
        names = tuple(output_fields(V3_15))[:60]
        asleep = RtdeClient(sleeper)
        asleep.subscribe(*names)
        awake = RtdeClient(sock)
        awake.subscribe("timestamp")
        first = awake.data()["timestamp"]
        size = sum(output_fields(V3_15)[name].type.size for name in names)
        enough = 600_000 // size  # cycles that certainly fill every buffer on the way
        awake.until(lambda v: v["timestamp"] > first + 0.008 * enough)
        stamps = [asleep.data()["timestamp"]]
        while stamps[-1] < first + 0.008 * enough:  # decoding would fail on a package that is cut
            stamps.append(asleep.data()["timestamp"])
        gaps = [round((b - a) / 0.008) for a, b in pairwise(stamps)]
        assert max(gaps) > 1
        assert min(gaps) == 1


@pytest.mark.parametrize(("pace", "times_said"), [("lockstep", 1), ("realtime", 0)])
def test_in_lockstep_the_log_says_once_that_inputs_have_no_fixed_time(pace, times_said):
    with ControlBox(in_process=True, pace=pace, port_base=None) as box, connect(box, "rtde") as sock:
        client = RtdeClient(sock)
        recipe = client.own("input_int_register_24")

        def said():
            return sum("writes inputs while a program runs" in entry.text for entry in box.log)

        client.write(recipe, 1)
        client.ask(M.Pause())
        assert said() == 0
        run(box, "def p():\n  while read_input_integer_register(24) < 3:\n    sync()\n  end\nend\n")
        box.wait_until(program_state="PLAYING")
        client.write(recipe, 2)
        client.write(recipe, 3)
        box.wait_until(program_state="STOPPED")
        assert said() == times_said


def test_in_lockstep_time_waits_for_a_client_that_reads_late(box):
    fields = output_fields(V3_15)
    names = ("output_int_register_24", *[name for name in fields if fields[name].type.count == 6])
    n_cycles = 700
    size = sum(fields[name].type.size for name in names)
    assert size * n_cycles > 500_000  # more than the buffers on the way hold
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.settimeout(TIMEOUT)
        sock.connect((box.host, box.ports.rtde))
        late = RtdeClient(sock)
        late.subscribe(*names)
        run(box, COUNT.format(n_cycles))
        with connect(box, "primary") as other:
            other.recv(1)  # the box goes on serving others meanwhile
        counts = [0]
        while counts[-1] < n_cycles:
            counts.append(late.data()["output_int_register_24"])
    assert {after - before for before, after in pairwise(counts)} <= {0, 1}
