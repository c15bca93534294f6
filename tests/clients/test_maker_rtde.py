"""The maker's RTDE client for Python, as urpy 1.2.0 on PyPI carries it, in the flows of its examples.

Its home, UniversalRobots/RTDE_Python_Client_Library, is not on PyPI.
"""

import struct
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from clients_support import PROGRAMS, served_box, submit
from urpy.rtde import rtde, rtde_config

SIZES = {
    "VECTOR6D": 48,
    "VECTOR3D": 24,
    "VECTOR6INT32": 24,
    "DOUBLE": 8,
    "UINT64": 8,
    "INT32": 4,
    "UINT32": 4,
}
recipe = rtde_config.ConfigFile(str(Path(__file__).with_name("maker_recipes.xml"))).get_recipe
# Robot, software, control cycle [s].
BOXES = [
    pytest.param(("ur3", "3.15.8", 0.008), id="3.15.8"),
    pytest.param(("ur5e", "5.9.4", 0.002), id="5.9.4", marks=pytest.mark.nightly),
    pytest.param(("ur5e", "5.25.1", 0.002), id="5.25.1", marks=pytest.mark.nightly),
]


@pytest.fixture(scope="module", params=BOXES)
def box(tmp_path_factory, request):
    robot, software, period = request.param
    options = ("--robot", robot, "--software", software, "--fidelity", "ideal")
    with served_box(tmp_path_factory.mktemp("maker"), *options) as served:
        served.software, served.period = software, period
        yield served


@contextmanager
def connected(box):
    """Connect and ask for the software, as all examples do."""
    client = rtde.RTDE(box.host, box.ports.rtde)
    client.connect()
    try:
        assert ".".join(map(str, client.get_controller_version()[:3])) == box.software
        yield client
    finally:
        client.disconnect()


def newest(client):
    """Return the package after all that have come: the client reads 4 kB at a time."""
    while client.has_data():
        client.receive()
    return client.receive()


def test_recorders_get_rows_and_every_cycle_where_they_buffer(box):
    names, types = recipe("recorded")
    with connected(box) as client:
        assert client.send_output_setup(names, types, frequency=125)
        assert client.send_start()
        row = client.receive()
        assert (len(row.actual_q), row.robot_mode) == (6, 7)
        assert client.send_pause()
        assert client.send_output_setup(names, types, frequency=round(1 / box.period))
        assert client.send_start()
        rows = []
        while len(rows) < 200:
            if (row := client.receive_buffered(binary=True)) is not None:
                rows.append(row)
        assert client.send_pause()
    assert {len(row) for row in rows} == {sum(SIZES[kind] for kind in types)}
    stamps = [struct.unpack_from(">d", row)[0] for row in rows]
    assert np.diff(stamps) == pytest.approx([box.period] * 199, abs=1e-9)


def test_receive_skips_what_has_come_meanwhile(box):
    names, types = recipe("stamp")
    with connected(box) as slow, connected(box) as clock:
        for client in (slow, clock):
            assert client.send_output_setup(names, types, frequency=round(1 / box.period))
            assert client.send_start()
        before = slow.receive().timestamp
        while clock.receive().timestamp < before + 60 * box.period:
            pass
        assert slow.receive().timestamp > before + 15 * box.period
        assert slow.skipped_package_count >= 15


def test_later_recorders_need_later_software(box):
    names, types = recipe("later")
    with connected(box) as client:
        if box.software in ("3.15.8", "5.9.4"):
            with pytest.raises(ValueError, match="NOT_FOUND"):
                client.send_output_setup(names, types, frequency=125)
        else:
            assert client.send_output_setup(names, types, frequency=125)
            assert client.send_start()
            assert client.receive().output_bit_register_64 is False


def test_wrong_types_are_noticed_and_taken_inputs_too(box):
    with connected(box) as client, connected(box) as other:
        assert not client.send_output_setup(["timestamp", "robot_mode"], ["DOUBLE", "UINT32"])
        assert client.send_input_setup(["input_int_register_24"], ["INT32"]).recipe_id == 1
        assert client.send_input_setup(["input_double_register_24"], ["DOUBLE"]).recipe_id == 2
        with pytest.raises(ValueError, match="already in use"):
            other.send_input_setup(["input_int_register_24"], ["INT32"])
        with pytest.raises(ValueError, match="NOT_FOUND"):
            other.send_input_setup(["input_nothing"], ["INT32"])


def test_a_package_of_a_later_protocol_does_not_end_the_connection(box):
    """The client of 2026 asks for properties, which software has from 5.26 on; it waits, then says so."""
    with connected(box) as client:
        client._RTDE__sendall(ord("R"), b"v1.software.version")
        assert client.get_controller_version()[0] == int(box.software[0])


def test_the_control_loop(box):
    """Two poses in turn over registers, a watchdog kicked with each state; without kicks the program pauses."""
    with connected(box) as client, connected(box) as watcher:
        assert client.send_output_setup(*recipe("state"), frequency=round(1 / box.period))
        setp, watchdog = (client.send_input_setup(*recipe(name)) for name in ("setp", "watchdog"))
        assert client.send_start()
        assert watcher.send_output_setup(["timestamp", "target_TCP_pose", "runtime_state"])
        assert watcher.send_start()
        submit(box, (PROGRAMS / "maker_control_loop.script").read_text())
        start = newest(watcher).target_TCP_pose
        goals = [[*start[:2], start[2] + lift, *start[3:]] for lift in (0.03, 0.0)]
        watchdog.input_int_register_0 = 0

        def until(register):
            for _ in range(20_000):
                state = client.receive()
                client.send(watchdog)
                if state.output_int_register_0 == register:
                    return
            raise AssertionError("what was waited for did not come")

        for goal in goals:
            until(1)
            for n, value in enumerate(goal):
                setattr(setp, f"input_double_register_{n}", value)
            assert client.send(setp)
            # The program copies a pose in the cycle after the one in which it comes: only then it may move there.
            sent = newest(watcher).timestamp
            while newest(watcher).timestamp < sent + 10 * box.period:
                client.send(watchdog)
            watchdog.input_int_register_0 = 1
            until(0)
            watchdog.input_int_register_0 = 0
            # The register may overtake what the other connection shows.
            while newest(watcher).target_TCP_pose != pytest.approx(goal, abs=1e-5):
                client.send(watchdog)
        states = [newest(watcher)]
        while states[-1].runtime_state == 2:
            states.append(watcher.receive())
        assert states[-1].runtime_state in (3, 4)
        assert all(after.timestamp - before.timestamp < 0.5 for before, after in pairwise(states))
        assert 0.9 < states[-1].timestamp - states[0].timestamp < 1.3
