"""The RTDE port without sockets: rates, repeats while time stands still, owners, clients that misbehave."""

import pytest
from box_support import BareBox, Bench
from rtde_support import input_package

from protocol.rtde import codec as M
from protocol.rtde.client_connection import DataReceived, RtdeClientConnection
from protocol.ur_types import SoftwareVersion
from ur_emulator.budgets import BUDGETS
from ur_emulator.models.generations import CB3
from ur_emulator.ports.rtde import RtdePort

V3_15 = SoftwareVersion(3, 15, 8)


class FakeConnection:
    """What the port sees of a client; the other end is a protocol of the PC."""

    def __init__(self, port, *, full=False):
        self.port = port
        self.is_open = True
        self.has_ended = False
        self.takes_answers = True
        self.full = full
        self.sent = []
        self.calls, self.reads = [], True
        self.pc = RtdeClientConnection()
        port.opened(self)

    def send(self, package):
        if self.full or not self.is_open:
            return False
        self.sent.append(package)
        return True

    def close(self):
        if self.is_open:
            self.is_open = False
            self.port.closed(self)

    close_when_sent = close

    def failed(self, error):
        raise error

    def call_soon(self, call):
        self.calls.append(call)

    def set_reading(self, wanted):
        self.reads = wanted

    def say(self, data):
        self.port.received(self, data)
        while self.calls:
            self.calls.pop(0)()

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
        client = FakeConnection(self.port)
        assert client.ask(M.RequestProtocolVersion(2)).accepted
        if names:
            assert client.ask(M.SetupOutputs(names, frequency)).recipe_id == 1
        return client


@pytest.fixture
def bench():
    return PortBench()


def test_nothing_is_sent_unasked_before_the_start(bench):
    client = bench.client("timestamp")
    bench.tick(5)
    bench.stand(5)
    assert client.events() == []


def test_the_reply_to_start_precedes_the_first_package(bench):
    client = bench.client("timestamp")
    client.say(client.pc.send(M.Start()))
    bench.tick(2)
    assert [type(event) for event in client.events()] == [M.StartReply, DataReceived, DataReceived]


def test_the_full_rate_is_every_cycle(bench):
    client = bench.client("timestamp")
    client.ask(M.Start())
    first = bench.now.tick
    bench.tick(4)
    assert client.stamps() == [first + 1, first + 2, first + 3, first + 4]


@pytest.mark.parametrize(("frequency", "cycles"), [(60.0, 2), (25.0, 5), (10.0, 12)])
def test_lower_rates_are_every_nth_cycle(bench, frequency, cycles):
    client = bench.client("timestamp", frequency=frequency)
    client.ask(M.Start())
    first = bench.now.tick + 1
    bench.tick(3 * cycles)
    assert client.stamps() == [first, first + cycles, first + 2 * cycles]


def test_version_1_has_the_full_rate_and_no_ids(bench):
    client = FakeConnection(bench.port)
    assert client.ask(M.SetupOutputs(("timestamp",))) == M.SetupOutputsReply(("DOUBLE",))
    client.ask(M.Start())
    bench.tick(3)
    assert all(len(package) == 3 + 8 for package in client.sent)
    assert len(client.events()) == 3


def test_pause_ends_the_data_and_start_resumes_it(bench):
    client = bench.client("timestamp", frequency=25.0)
    client.ask(M.Start())
    bench.tick(3)
    assert len(client.events()) == 1
    assert client.ask(M.Pause()) == M.PauseReply(True)
    bench.tick(20)
    assert client.events() == []
    assert client.ask(M.Start()) == M.StartReply(True)
    bench.tick(6)
    assert len(client.events()) == 2


def test_while_time_stands_still_the_last_state_comes_at_the_clients_rate(bench):
    client = bench.client("timestamp", frequency=25.0)
    client.ask(M.Start())
    bench.stand(11)
    now = bench.now.tick
    assert client.stamps() == [now, now, now]


def test_the_cycles_that_are_sent_do_not_depend_on_how_long_time_stood_still(bench):
    clients = [bench.client("timestamp", frequency=25.0)]
    clients[0].ask(M.Start())
    first = bench.now.tick + 1
    bench.tick(3)
    bench.stand(4)  # less than the client's period
    bench.tick(8)
    assert clients[0].stamps() == [first, first + 5, first + 10]


def test_a_state_reached_between_two_packages_is_reported_once_time_stands_still(bench):
    client = bench.client("timestamp", frequency=25.0)
    client.ask(M.Start())
    bench.tick(2)
    bench.stand(5)
    assert client.stamps() == [bench.now.tick - 1, bench.now.tick]


def test_several_clients_have_recipes_and_rates_of_their_own(bench):
    fast, slow = bench.client("timestamp"), bench.client("timestamp", "actual_q", frequency=25.0)
    fast.ask(M.Start())
    slow.ask(M.Start())
    bench.tick(10)
    assert len(fast.events()) == 10
    (one, two) = slow.events()
    assert one.names == two.names == ("timestamp", "actual_q")
    slow.close()
    bench.tick(1)
    assert len(fast.events()) == 1
    assert set(bench.port._sessions) == {fast}


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


def test_an_owned_input_is_in_use_for_others_variable_by_variable(bench):
    owner, other = bench.client(), bench.client()
    assert owner.ask(M.SetupInputs(("input_int_register_0", "input_int_register_1"))).recipe_id == 1
    assert owner.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 2
    refused = other.ask(M.SetupInputs(("input_int_register_0", "input_int_register_2")))
    assert refused == M.SetupInputsReply(("IN_USE", "INT32"), 0)
    assert other.ask(M.SetupInputs(("input_int_register_2",))).recipe_id == 1
    assert owner.ask(M.SetupInputs(("input_int_register_2",))).types == ("IN_USE",)


def test_a_refused_recipe_owns_nothing(bench):
    one, other = bench.client(), bench.client()
    assert one.ask(M.SetupInputs(("input_int_register_0", "nonsense"))).recipe_id == 0
    assert other.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 1


def test_inputs_are_free_as_soon_as_their_owner_is_gone(bench):
    owner, other = bench.client(), bench.client()
    owner.ask(M.SetupInputs(("input_int_register_0",)))
    assert other.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 0
    owner.close()
    assert other.ask(M.SetupInputs(("input_int_register_0",))).recipe_id == 1


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
    ("names", "n_taken"),
    [
        (("input_int_register_0",), BUDGETS.rtde_recipes),
        (("input_int_register_0",) * 90, BUDGETS.rtde_variables // 90),
    ],
)
def test_a_client_has_so_many_input_recipes_and_variables(bench, names, n_taken):
    client = bench.client()
    taken = [client.ask(M.SetupInputs(names)) for _ in range(n_taken)]
    assert [reply.recipe_id for reply in taken] == list(range(1, n_taken + 1))
    assert client.ask(M.SetupInputs(names)) == M.SetupInputsReply(("NOT_FOUND",) * len(names), 0)
    other = ("input_int_register_1",)
    assert bench.client().ask(M.SetupInputs(other)) == M.SetupInputsReply(("INT32",), 1)


def test_the_script_line_is_wanted_while_a_recipe_has_it(bench):
    bench.client("timestamp")
    assert not bench.controller.programs.reports_line
    one, other = bench.client("script_control_line"), bench.client("script_control_line")
    assert bench.controller.programs.reports_line
    one.close()
    assert bench.controller.programs.reports_line
    other.ask(M.SetupOutputs(("timestamp",), 125.0))
    assert not bench.controller.programs.reports_line


# --- clients that misbehave


def test_an_absurd_size_is_answered_with_a_text_and_the_end(bench):
    client = bench.client("timestamp")
    client.say(b"\0\0")
    (text,) = client.events()
    assert isinstance(text, M.RtdeTextMessage)
    assert text.level == 1
    assert not client.is_open
    assert not bench.port._sessions


def test_a_client_in_version_1_gets_its_text_in_version_1(bench):
    client = FakeConnection(bench.port)
    client.say(b"GET / HTTP/1.1\r\n\r\n")
    (text,) = client.events()
    assert text.message.startswith("an RTDE package of 18245 bytes")


def test_after_the_text_nothing_more_is_read(bench):
    client = bench.client()
    client.close_when_sent = lambda: None  # the text still waits in the outbox
    client.say(b"\0\0")
    client.say(b"\0\3S")
    assert [type(event) for event in client.events()] == [M.RtdeTextMessage]


def test_a_reply_that_cannot_be_sent_ends_the_connection(bench):
    client = bench.client("timestamp")
    client.full = True
    client.say(client.pc.send(M.Start()))
    assert not client.is_open
    bench.tick()
    assert client.sent == []


def test_data_for_a_full_client_is_dropped_and_the_others_get_theirs(bench):
    full, other = bench.client("timestamp"), bench.client("timestamp")
    full.ask(M.Start())
    other.ask(M.Start())
    full.full = True
    bench.tick(3)
    full.full = False
    bench.tick(1)
    assert len(full.events()) == 1
    assert len(other.events()) == 4


def test_a_client_that_closes_within_a_burst_of_requests_is_read_no_further(bench):
    client = bench.client("timestamp")
    client.full = True
    client.say(client.pc.send(M.Start()) + client.pc.send(M.Pause()))
    assert not client.is_open
