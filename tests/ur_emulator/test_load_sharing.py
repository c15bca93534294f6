"""What many clients of one port share: a recipe is encoded once a cycle, however many clients have it."""

from collections import Counter
from itertools import pairwise

import pytest
from test_rtde_port import PortBench

from protocol.rtde import codec as M
from protocol.rtde import server_connection

Q = ("timestamp", "actual_q", "actual_qd")
POSE = ("timestamp", "actual_TCP_pose")


def started(bench, *names, **options):
    client = bench.client(*names, **options)
    assert client.ask(M.Start()).accepted
    return client


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


def test_fifty_clients_with_one_recipe_cost_one_encoding_a_cycle(encoded):
    bench = PortBench()
    clients = [started(bench, *Q) for _ in range(50)]
    bench.tick(10)
    assert encoded == {Q: 10}
    first = clients[0].sent
    assert len(first) == 10
    assert all(client.sent == first for client in clients)
    assert [client.stamps()[-1] for client in clients] == [bench.now.tick] * 50


def test_each_recipe_is_encoded_for_itself(encoded):
    bench = PortBench()
    for names in (Q, POSE, Q, POSE, Q):
        started(bench, *names)
    bench.tick(4)
    assert encoded == {Q: 4, POSE: 4}


def test_slow_clients_share_with_fast_ones_and_nothing_is_encoded_for_nobody(encoded):
    bench = PortBench()
    slow = started(bench, *Q, frequency=125.0 / 4)
    bench.tick(8)
    assert encoded == {Q: 2}
    fast = started(bench, *Q)
    bench.tick(8)
    assert encoded == {Q: 10}
    assert len(fast.stamps()) == 8
    assert [b - a for a, b in pairwise(slow.stamps())] == [4, 4, 4]


def test_a_heartbeat_is_encoded_anew_only_once_for_all(encoded):
    bench = PortBench()
    for _ in range(3):
        started(bench, *Q)
    bench.tick(1)
    bench.stand(5)
    assert encoded == {Q: 6}


def test_clients_whose_recipes_have_other_numbers_get_their_own_header():
    bench = PortBench()
    one, two = started(bench, *Q), started(bench, *POSE)
    assert two.ask(M.SetupOutputs(Q, 125.0)).recipe_id == 2
    bench.tick(1)
    assert one.sent[0][3] == 1
    assert two.sent[0][3] == 2
    assert one.sent[0][4:] == two.sent[0][4:]


def test_a_recipe_that_is_set_up_again_begins_a_new_stream():
    bench = PortBench()
    client = started(bench, *Q, frequency=125.0 / 4)
    bench.tick(2)
    client.stamps()
    assert client.ask(M.SetupOutputs(Q, 125.0 / 4)).recipe_id == 2
    bench.tick(1)
    assert client.stamps() == [bench.now.tick]


def test_a_client_that_is_full_costs_the_others_nothing():
    bench = PortBench()
    clients = [started(bench, *Q) for _ in range(3)]
    clients[1].full = True
    bench.tick(3)
    assert [len(client.sent) for client in clients] == [3, 0, 3]
