"""Two drivers in C++ that no package index has, as own small programs with their wire formats and habits.

`headless_driver` is in the manner of Universal_Robots_Client_Library: functions used before they are defined,
lists added and multiplied, a blocking socket read inside a critical section, servo and trajectory threads, a
socket each for set-points (8 integers), trajectories (21) and commands (28), all times 1e6. `reverse_driver` is in
the manner of ur_modern_driver: an unnamed socket, messages of 7 integers, locals shared with a nested thread.
"""

import socket
import struct
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from clients_support import BOTH_GENERATIONS, PROGRAMS, TIMEOUT, connect, receive_exactly, served_box
from strict_clients import VERSION_MESSAGE, PrimaryWire, StrictRtde

SCALE = 1_000_000
STOP, UNINITIALIZED, IDLE, SERVOJ, SPEEDJ, TRAJECTORY, SPEEDL = -2, -1, 0, 1, 2, 3, 4
TRAJECTORY_START = 1
DONE, CANCELLED, FAILED = 0, 1, 2
MOVEJ = 0
OUTPUTS = (
    "timestamp", "target_q", "target_qd", "target_TCP_pose", "target_TCP_speed", "actual_q", "runtime_state", "payload",
)  # fmt: skip
STOPPED, PLAYING = 1, 2


def fill(template, **values):
    """Return one of the programs with its values."""
    text = (PROGRAMS / template).read_text(encoding="utf-8")
    for name, value in values.items():
        text = text.replace("{" + name + "}", str(value))
    return text


def headless_driver(host, reverse, trajectory, command):
    """Return what one write on the primary port uploads: a stop, then the program with tabs."""
    body = fill(
        "headless_driver.template", host=host, reverse=reverse, trajectory=trajectory, command=command,
        stop=STOP, uninitialized=UNINITIALIZED, idle=IDLE, servoj=SERVOJ, speedj=SPEEDJ, forward=TRAJECTORY,
        speedl=SPEEDL, done=DONE, cancelled=CANCELLED, failed=FAILED, movej=MOVEJ,
    )  # fmt: skip
    lines = "".join(f"\t{line}\n" for line in body.splitlines())
    return f"stop program\ndef externalControl():\n{lines}end\n"


class DriverServers:
    """The servers of the PC that a headless driver's program dials."""

    def __init__(self):
        self._stack = ExitStack()
        self.servers = [self._stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(3)]
        for server in self.servers:
            server.settimeout(TIMEOUT)
        self.ports = [server.getsockname()[1] for server in self.servers]

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._stack.close()

    def accept(self):
        """Wait for the three connections."""
        sockets = [self._stack.enter_context(server.accept()[0]) for server in self.servers]
        for sock in sockets:
            sock.settimeout(TIMEOUT)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.reverse, self.trajectory, self.command = sockets

    def send(self, mode, values=(0,) * 6, timeout_ms=200):
        """Send a set-point; values in rad or m and their rates."""
        scaled = [round(v * SCALE) for v in values]
        self.reverse.sendall(struct.pack(">8i", timeout_ms, *scaled, mode))

    def forward(self, action, points, timeout_ms=0):
        """Announce a trajectory: plain integers, not scaled."""
        self.reverse.sendall(struct.pack(">8i", timeout_ms, action, points, 0, 0, 0, 0, TRAJECTORY))

    def point(self, q, duration, blend=0.0, kind=MOVEJ):
        scaled = [round(v * SCALE) for v in (*q, *(0.0,) * 12, duration, blend)]
        self.trajectory.sendall(struct.pack(">21i", *scaled, kind))

    def result(self):
        return struct.unpack(">i", receive_exactly(self.trajectory, 4))[0]

    def tell(self, number, *values):
        """Send a script command: numbers as they are."""
        self.command.sendall(struct.pack(">28i", number, *values, *(0,) * (27 - len(values))))

    def is_dropped(self):
        """Wait until the program has closed the reverse socket."""
        try:
            return self.reverse.recv(1) == b""
        except ConnectionResetError:
            return True


@contextmanager
def driver(box):
    """A driver as it starts: RTDE, servers, primary client, upload in one write, three connections."""
    with StrictRtde(box) as rtde, DriverServers() as servers, PrimaryWire(box) as primary:
        rtde.want(*OUTPUTS)
        rtde.start()
        first = primary.package()
        assert first[0] == 20
        primary.write(headless_driver("127.0.0.1", *servers.ports))
        servers.accept()
        rtde.catch_up()
        yield rtde, servers
        servers.send(STOP)
        assert servers.is_dropped()
        rtde.until(lambda v: v["runtime_state"] == STOPPED)


@BOTH_GENERATIONS
def test_servo_set_points_are_followed(box):
    with driver(box) as (rtde, servers):
        start = np.array(rtde.data()["target_q"])
        for n in range(125):
            rtde.data()
            servers.send(SERVOJ, np.add(start, [0.1 * (1 - np.cos(np.pi * n / 125)) / 2, 0, 0, 0, 0, 0]))
        goal = np.add(start, [0.1, 0, 0, 0, 0, 0])
        for _ in range(250):
            servers.send(SERVOJ, goal)
            if np.allclose(rtde.data()["target_q"], goal, atol=1e-4):
                break
        else:
            raise AssertionError("the set-point was not reached")


@BOTH_GENERATIONS
def test_joint_and_tool_speeds_and_commands(box):
    with driver(box) as (rtde, servers):
        for _ in range(60):
            values = rtde.data()
            servers.send(SPEEDJ, (-0.3, 0, 0, 0, 0, 0.2))
        assert np.allclose(values["target_qd"], (-0.3, 0, 0, 0, 0, 0.2), atol=1e-6)
        for _ in range(60):
            values = rtde.data()
            servers.send(SPEEDL, (0, 0, 0.05, 0, 0, 0))
        assert np.allclose(values["target_TCP_speed"], (0, 0, 0.05, 0, 0, 0), atol=1e-3)
        servers.send(IDLE, timeout_ms=0)
        rtde.until(lambda v: not any(v["target_qd"]))
        for mass in (0.75, 0.0):  # by the socket of commands
            servers.tell(1, round(mass * SCALE), 0, 0, 40_000)
            rtde.until(lambda v, mass=mass: v["payload"] == mass)


@BOTH_GENERATIONS
def test_a_trajectory_with_blends_and_one_that_is_cancelled(box):
    with driver(box) as (rtde, servers):
        start = np.array(rtde.data()["target_q"])
        offsets = (0.1, 0.2, 0.1, 0.0)
        servers.forward(TRAJECTORY_START, len(offsets))
        for offset in offsets:
            servers.point(np.add(start, [0, 0, 0, 0, 0, offset]), 0.2, 0.02)
        assert servers.result() == DONE
        rtde.catch_up()
        values = rtde.until(lambda v: not any(v["target_qd"]))
        assert np.allclose(values["target_q"], start, atol=1e-5)
        servers.send(IDLE, timeout_ms=0)
        servers.forward(TRAJECTORY_START, 1)
        servers.point(np.add(start, [0, 0, 0, 0, 0, 1.0]), 4.0)
        rtde.until(lambda v: v["target_qd"][5] > 0.05)
        servers.send(IDLE, timeout_ms=0)
        assert servers.result() == CANCELLED
        values = rtde.until(lambda v: not any(v["target_qd"]))
        assert 0.0 < values["target_q"][5] - start[5] < 0.9


@BOTH_GENERATIONS
@pytest.mark.parametrize("mode", [SERVOJ, pytest.param(IDLE, marks=pytest.mark.nightly)])
def test_silence_ends_the_program(box, mode):
    """As long as was said with the last message, and not before."""
    with driver(box) as (rtde, servers):
        q = rtde.data()["target_q"]
        servers.send(mode, q if mode == SERVOJ else (0,) * 6, timeout_ms=200)
        last = rtde.data()["timestamp"]
        ended = rtde.until(lambda v: v["runtime_state"] == STOPPED)["timestamp"]
        assert 0.19 < ended - last < 0.45
        assert servers.is_dropped()


@BOTH_GENERATIONS
def test_unreachable_set_points_leave_the_joints_where_they_are(box):
    with driver(box) as (rtde, servers):
        start = rtde.data()["target_q"]
        for _ in range(10):
            servers.send(SERVOJ, start, timeout_ms=0)
            rtde.data()
        before = rtde.until(lambda v: max(map(abs, v["target_qd"])) < 1e-9)["target_q"]
        for _ in range(10):
            servers.send(SERVOJ, [q + 3.0 for q in start], timeout_ms=0)
            after = rtde.data()["target_q"]
        assert struct.pack("6f", *after) == struct.pack("6f", *before)


@BOTH_GENERATIONS
def test_a_second_upload_replaces_the_first(box):
    with driver(box) as (rtde, first), DriverServers() as second:
        first.send(IDLE, timeout_ms=0)
        with connect(box, "primary") as sock:
            sock.sendall(headless_driver("127.0.0.1", *second.ports).encode())
            second.accept()
        assert first.is_dropped()
        second.send(IDLE, timeout_ms=0)
        rtde.until(lambda v: v["runtime_state"] == PLAYING)
        second.send(STOP)
        assert second.is_dropped()
        first.send = lambda *a, **k: None  # its program is gone
        rtde.until(lambda v: v["runtime_state"] == STOPPED)


# --- the older driver


def test_its_reads_hold_the_version_and_whole_realtime_packages(box):
    """One read of 512 bytes: the message comes first and whole."""
    with connect(box, "primary") as sock:
        data = sock.recv(512)
        size, kind = struct.unpack_from(">iB", data)
        assert kind == 20
        assert size <= len(data)
        data = data[:size]
        _, _, number, length = struct.unpack_from(">QbBB", data, 5)
        assert number == VERSION_MESSAGE
        name = data[16 : 16 + length]
        assert name == b"URControl"
        major, minor, bugfix = struct.unpack_from(">BBi", data, 16 + length)
        assert (major, minor, bugfix) == (3, 15, 8)
        assert len(data[16 + length + 10 :]) <= 20
    with connect(box, "realtime") as sock:
        for _ in range(50):
            # A read that comes late finds more than one package, but always whole ones.
            data = sock.recv(1 << 16)
            assert len(data) % 1140 == 0
            assert struct.unpack_from(">i", data)[0] == 1140


def test_a_stream_of_one_line_programs_is_one_motion(box):
    """`speedj` once a cycle on the realtime port: no braking between them, and none while a busy machine waits."""
    with StrictRtde(box) as rtde, connect(box, "realtime") as script:
        rtde.want("timestamp", "target_qd", "target_q")
        rtde.start()
        speeds = []
        for _ in range(125):
            script.sendall(b"speedj([0.2, 0, 0, 0, 0, -0.1], 4.0, 5.0)\n")
            speeds.append(rtde.data()["target_qd"])
        reached = next(n for n, qd in enumerate(speeds) if abs(qd[0] - 0.2) < 1e-9)
        assert all(abs(qd[0] - 0.2) < 1e-9 and abs(qd[5] + 0.1) < 1e-9 for qd in speeds[reached:])
        script.sendall(b"stopj(10)\n")
        rtde.until(lambda v: not any(v["target_qd"]))


@pytest.mark.nightly
def test_a_reverse_program_follows_points_that_come_four_times_a_cycle(tmp_path):
    """In lockstep: the arm brakes in every cycle without a fresh point, and this PC may be late."""
    with (
        served_box(tmp_path, "--pace", "lockstep") as box,
        StrictRtde(box) as rtde,
        socket.create_server(("127.0.0.1", 0)) as server,
    ):
        server.settimeout(TIMEOUT)
        rtde.want(*OUTPUTS)
        rtde.start()
        start = np.array(rtde.data()["target_q"])
        text = fill("reverse_driver.template", host="127.0.0.1", port=server.getsockname()[1])
        with connect(box, "realtime") as sock:
            sock.sendall(text.encode())
            reverse, _ = server.accept()
        rtde.catch_up()
        with reverse:
            reverse.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

            def point(q, keepalive=1):
                reverse.sendall(struct.pack(">7i", *(round(x * SCALE) for x in q), keepalive))

            track = {}
            for n in range(150):
                values = rtde.data()
                track[values["timestamp"]] = values["target_q"][0] - start[0]
                for quarter in range(4):
                    turn = 0.1 * np.sin(np.pi / 2 * min(1.0, (n + quarter / 4) / 125))
                    point(np.add(start, [turn, 0, 0, 0, 0, 0]))
            track = list(track.values())
            moved = np.diff(track)
            assert track[-1] == pytest.approx(0.1, abs=0.01)
            assert moved[5:90].min() > 1e-5, "the arm went on, without a stutter"
            point(np.add(start, [0.1, 0, 0, 0, 0, 0]), 0)
            rtde.until(lambda v: v["runtime_state"] == STOPPED)
