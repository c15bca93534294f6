"""The journal: what any session gave, a bare machine gives again, bit for bit."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from box_support import MessageReader, connect, program
from dashboard_support import Dashboard

from protocol.primary.messages import TextMessage
from ur_emulator import ControlBox
from ur_emulator.errors import EmulatorError
from ur_emulator.host.journal import JournalError
from ur_emulator.host.replay import replay
from ur_emulator.machine.commands import client_writes, grippers, power, programs, safety, surroundings
from ur_emulator.machine.controller.io import network
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.plant.arm_plant import ArmPlant
from ur_emulator.machine.records import RECORDS, RecordError, to_input, to_plain
from urscript import compile_program
from urscript.catalogue import catalogue_for

CATALOGUE = catalogue_for("3.15")
MOVE = (
    "def p():\n  movej([0, -1.2, 1.2, -1.5, -1.5, 0], t=0.4)\n  textmsg(get_actual_joint_positions())\nend\n"
)


@pytest.fixture
def file(tmp_path):
    return tmp_path / "session.journal"


def kept(file, **options):
    return ControlBox(**{"pace": "lockstep", "port_base": None, "seed": 7, "journal": file, **options})


def assert_identical(file, at_least=1):
    found = replay(file)
    assert (found.difference, found.end) == (None, ""), str(found)
    assert found.cycles >= at_least
    return found


# --- sessions


@pytest.mark.parametrize(
    ("pace", "robot", "fidelity"), [("realtime", "ur3", "typical"), ("lockstep", "ur5e", "poor")]
)
def test_a_session_of_operations_is_explained_by_its_inputs(file, pace, robot, fidelity):
    with kept(file, pace=pace, robot=robot, fidelity=fidelity) as box:
        box.run_program(MOVE, wait=True)
        box.push((8, 0, 0), duration=0.1)
        box.set_digital_input("standard", 1, True)
        box.add_obstacle("post", "box", (0.05, 0.05, 0.3), (0.9, 0.4, 0.2, 0, 0, 0))
        box.run_program(
            "def q():\n  freedrive_mode()\n  sleep(0.1)\n  end_freedrive_mode()\nend\n", wait=True
        )
        with pytest.raises(EmulatorError):
            box.remove_obstacle("nothing")
    assert_identical(file, 60)


def test_every_stop_and_recovery_is_explained(file):
    with kept(file, robot="ur5e") as box:
        loop = "def p():\n  while True:\n    movej([0,-1.2,1.2,-1.5,-1.5,0])\n    movej([0.2,-1.2,1.2,-1.5,-1.5,0])\n  end\nend\n"
        for stop, recover in (
            (box.protective_stop, box.unlock_protective_stop),
            (box.emergency_stop, lambda: (box.release_emergency_stop(), box.power_on())),
            (box.trigger_fault, lambda: (box.restart_safety(), box.power_on())),
            (box.pause_program, box.resume_program),
        ):
            box.run_program(loop)
            stop()
            box.wait_until(steady=True)
            recover()
            box.release_brakes()
            box.wait_until(robot_mode="RUNNING")
            box.stop_program()
    assert_identical(file, 500)


def test_sockets_calls_and_modbus_units_of_a_program_are_explained(file):
    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as calls:
        calls.register_function(lambda a, b: [a + b, 0.5, {"x": 1}["x"]], "add")
        calls.register_function(lambda name: f"hello {name}", "greet")
        threading.Thread(target=calls.serve_forever, daemon=True).start()
        with socket.create_server(("127.0.0.1", 0)) as server, kept(file, in_process=True) as box:
            unit = f"127.0.0.1:{box.ports.modbus}"
            lines = (
                f'socket_open("127.0.0.1", {server.getsockname()[1]}, "s")',
                'socket_send_string("ready", "s")',
                'textmsg(socket_read_binary_integer(2, "s"))',
                'textmsg(socket_read_line("s"))',
                'textmsg(socket_open("127.0.0.1", 1, "refused"))',
                'textmsg(socket_open("no such name", 80, "unknown"))',
                f'h = rpc_factory("xmlrpc", "http://127.0.0.1:{calls.server_address[1]}")',
                "textmsg(h.add(1, 2))",
                'textmsg(h.greet("you"))',
                f'modbus_add_signal("{unit}", 255, 128, 3, "r", False)',
                'modbus_set_output_register("r", 77, False)',
                "sleep(0.3)",
                'textmsg(modbus_get_signal_status("r", False))',
                "textmsg(read_port_register(128))",
                'modbus_delete_signal("r")',
                'socket_close("s")',
                'textmsg("end")',
            )
            with connect(box, "primary") as client:
                reader = MessageReader(client)
                client.sendall(program(*lines).encode())
                peer, _ = server.accept()
                with peer:
                    assert peer.recv(5) == b"ready"
                    peer.sendall(b"\0\0\0\1\0\0")
                    peer.sendall(b"\0\2a line\nand more")
                    texts = []
                    while not texts or texts[-1] != "end":
                        texts.append(reader.message(TextMessage).text)
        calls.shutdown()
    assert texts[:2] == ["[2,1,2]", "a line"]
    assert "hello you" in texts
    assert texts[-3] == "77"
    assert_identical(file, 40)


def test_a_gripper_a_program_file_and_what_clients_write_are_explained(file, tmp_path):
    (tmp_path / "one.script").write_text(MOVE)
    with kept(file, robot="ur5e", tool="robotiq-2f85", programs=tmp_path) as box:
        with connect(box, "gripper") as client:
            for words in (b"SET ACT 1\n", b"SET POS 200\n", b"SET GTO 1\n"):
                client.sendall(words)
                assert client.recv(3) == b"ack"
            box.run_program("def p():\n  sleep(2)\nend\n", wait=True)
            client.sendall(b"GET POS\n")
            assert int(client.recv(20).split()[1]) > 100
        with connect(box, "modbus") as client:
            client.sendall(bytes.fromhex("000100000006ff0600800102"))
            assert len(client.recv(12)) == 12
        with Dashboard(box) as dashboard:
            assert dashboard.ask_all("load one.script", "play")[1] == "Starting program"
        box.wait_until(program_state="STOPPED", steady=True)
    assert_identical(file, 1000)


def test_another_process_with_another_hash_seed_finds_the_same(file):
    with kept(file, scene="examples/scene.toml") as box:
        box.run_program(MOVE, wait=True)
        time = box.state.time
    done = subprocess.run(
        [sys.executable, "-m", "ur_emulator", "replay", str(file), "--until", f"{time - 0.1}"],
        env={**os.environ, "PYTHONHASHSEED": "11"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("identical: ")


# --- what is wrong with a journal


def lines_of(file):
    return [json.loads(line) for line in file.read_text().splitlines()]


def write(file, lines):
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    file = tmp_path_factory.mktemp("session") / "session.journal"
    with kept(file, in_process=True) as box:
        box.run_program(MOVE, wait=True)
    return file.read_text()


@pytest.fixture
def session(file, recorded):
    """The journal of a short session, to be spoilt."""
    file.write_text(recorded)
    return file


def test_the_first_cycle_and_field_that_differ_are_named(session):
    lines = lines_of(session)
    at = next(k for k, line in enumerate(lines) if line.get("i"))
    lines[at]["i"][0]["program"]["text"] = MOVE.replace("0.4", "0.5").replace("-1.2", "-1.3")
    write(session, lines)
    found = replay(session)
    assert found.difference.tick > lines[at]["t"]
    assert "target_q" in found.difference.fields
    assert "differs in" in str(found)


def test_a_sensor_that_differs_in_one_bit_is_found(session):
    lines = lines_of(session)
    sums = bytearray.fromhex(lines[20]["d"])
    sums[1] ^= 1
    lines[20]["d"] = sums.hex()
    write(session, lines)
    assert replay(session).difference.tick == lines[20]["t"]


def test_a_journal_is_read_after_its_process_was_killed(file):
    box = kept(file).__enter__()
    box.wait_until(time=box.state.time + 0.2)
    while file.read_text().count("\n") < 20:
        pass
    box._rack._child.look()
    os.kill(box._rack._child.pid, signal.SIGKILL)
    with pytest.raises(EmulatorError, match="SIGKILL"):
        box.__exit__(None, None, None)
    assert_identical(file, 18)
    file.write_text(file.read_text()[:-7])  # a line that was cut off
    assert_identical(file, 17)


def test_an_error_that_has_ended_a_box_is_met_again(file, monkeypatch):
    def broken(push):
        raise ZeroDivisionError("broken")

    def session():
        with kept(file, in_process=True) as box:
            box.push((1, 0, 0), duration=0.1)
            while box.failure is None:
                pass

    monkeypatch.setattr(ArmPlant, "count_push", broken)
    with pytest.raises(ZeroDivisionError):
        session()
    found = replay(file)
    assert found.difference is None
    assert "ends with an error, as it did then: ZeroDivisionError('broken')" in found.notes[-1]
    monkeypatch.undo()
    assert replay(file).difference.fields == ("the error that has ended it",)


def test_a_gap_ends_the_replay(session):
    lines = lines_of(session)
    lines[30:40] = [{"lost": 10}]
    write(session, lines)
    found = replay(session)
    assert (found.cycles, found.end) == (29, "the journal has a gap of 10 cycles")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "it is no journal"),
        ("{}\n", "it is no journal"),
        ('{"journal": 2}\n', "it is no journal"),
        ("hello\n", "line 1: it is no line of a journal"),
        ("[1]\n", "line 1: it is no line of a journal"),
        ('{"journal": 1, "box": {"weather": "fine"}, "files": {}}\n', "other options"),
        ('{"journal": 1, "box": {"robot": "ur33"}, "files": {}}\n', "unknown robot"),
    ],
)
def test_what_is_no_journal_is_refused_in_one_line(file, text, told):
    file.write_text(text)
    with pytest.raises(EmulatorError, match=told):
        replay(file)


@pytest.mark.parametrize(
    "given",
    [
        {"@": "os.system", "command": "true"},
        {"@": "OperateGrippers", "units": [9], "operation": "__init__", "values": []},
        {"@": "program", "name": "p", "text": "def p(:"},
        {"@": "Push", "force": [1e9, 0, 0]},
        {"@": "Push"},
        ["Push"],
        7,
    ],
    ids=str,
)
def test_an_input_that_is_none_ends_the_replay(session, given):
    lines = lines_of(session)
    lines[10]["i"] = [given]
    write(session, lines)
    assert "no input" in replay(session).end


def test_a_journal_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(JournalError, match="No such file or directory"):
        ControlBox(journal=tmp_path / "no" / "folder", port_base=None, in_process=True)
    with pytest.raises(EmulatorError, match="that of one box"):
        ControlBox.many(2, journal=tmp_path / "one")


def test_when_a_journal_cannot_go_on_the_box_does(file):
    """As when the disk is full: here who reads the file goes away."""
    os.mkfifo(file)
    reader = os.open(file, os.O_RDONLY | os.O_NONBLOCK)
    with ControlBox(journal=file, port_base=None, pace="lockstep", in_process=True) as box:
        os.close(reader)
        box.wait_until(time=box.state.time + 1.0)
        ends = [entry.text for entry in box.log if "the journal" in entry.text]
        box.set_digital_input("standard", 3, True)
    assert ends == [f"the journal {file} ends here: [Errno 32] Broken pipe"]


def test_the_journal_of_the_box_before_is_kept(file):
    for n in (1, 2):
        with ControlBox(journal=file, port_base=None, pace="lockstep", in_process=True) as box:
            box.set_digital_input("standard", n, True)
    kept = file.with_name(f"{file.name}.old")
    assert [[f'"n":{n}' in path.read_text() for n in (1, 2)] for path in (kept, file)] == [
        [True, False],
        [False, True],
    ]


# --- records


def all_inputs():
    rooms = (client_writes, grippers, power, programs, safety, surroundings, network)
    return {name for room in rooms for name, kind in vars(room).items()
            if isinstance(kind, type) and callable(getattr(kind, "apply", None)) and kind.__module__ == room.__name__
            and not name.startswith("_") and not getattr(kind, "__abstractmethods__", None)}  # fmt: skip


def test_every_command_can_be_written_down():
    assert all_inputs() <= set(RECORDS)
    assert {kind.__name__ for kind in network.Arrival.__args__} <= set(RECORDS)


@pytest.mark.parametrize(
    "given",
    [
        power.SetOperationalMode("manual"),
        programs.AnswerRequest(True, 2),
        programs.StartProgram(compile_program(MOVE, catalogue=CATALOGUE), loaded=True),
        safety.SetSafetyPlane("a", (0.0, 0.1, 0.0), (0.0, 0.0, 1.0)),
        surroundings.AddObstacle("a", "sphere", (0.1,), (0.5, 0.0, 0.0, 0.0, 0.0, 0.0)),
        client_writes.WriteInputs((("input_int_register_0", 7), ("speed_slider_fraction", 0.1))),
        grippers.ExchangeRegisters(9, b"\x03\x00\xff"),
        grippers.OperateGrippers((9,), "set", (("POS", 255),)),
        network.BytesArrived(3, bytes(range(256))),
        network.CallEnded(4, {"x": [1, 2.5, None, "é"], "y": True}, ""),
        network.SignalServed(5, (1, 2), "lost", 2, -2),
    ],
    ids=lambda given: type(given).__name__,
)  # fmt: skip
def test_an_input_is_the_same_after_it_was_written_and_read(given):
    machine = Machine(robot_by_name("ur3"), CB3.fidelity("exact"), 1)
    read = to_input(json.loads(json.dumps(to_plain(given))), machine, CATALOGUE)
    assert type(read) is type(given)
    assert to_plain(read) == to_plain(given)
    if not isinstance(given, programs.StartProgram):
        assert read == given


def test_what_is_no_record_is_not_written():
    with pytest.raises(RecordError, match="object is no record of the machine"):
        to_plain(object())
