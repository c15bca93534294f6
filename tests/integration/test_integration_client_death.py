"""A client that is lost in motion: the arm ramps to rest in 0.3 s, the program ends, the next client works.

Time to rest is counted in robot time, from the last command that the robot got. In lockstep the client dies at an
exact command: `DyingNetwork` stands between the real client and its sockets. Killed: all sockets close, as the kernel
closes those of a process. Frozen: the client stands still, its sockets stay open. Cut off: the client goes on, but
nothing reaches the robot any more and nothing comes from it.
"""

import struct
import threading
from dataclasses import replace

import pytest
from integration_support import LAYOUT, PERIOD, Frames, prepare_experiment

import ur_emulator.host.pacing as pacing
from pc_client.control.controller import CONTROLLERS
from pc_client.driver.session import UrDriver
from pc_client.driver.transport import TcpNetwork
from pc_client.driver.watchdog import REST_SPEED
from pc_client.errors import DriverError
from pc_client.experiment.run import ExperimentRunner
from pc_client.movements.movement import Movement
from pc_client.recording.recording import load_recording
from protocol.ur_types import ProgramState, SafetyMode
from protocol.velocity_stream import VelocityMode

KILLED, FROZEN, CUT_OFF = "killed", "frozen", "cut off"


class Killed(BaseException):
    """Where a killed process would not go on."""


class DyingNetwork:
    """A network whose client dies.

    Args:
        death: how.
        program: in which of the programs that it sends, counted from 1.
        speed: after the first command of that program with a joint faster than this [rad/s]; None: before the
            program is sent.

    Attributes:
        dead: set when it has happened.
        last_command: time stamp of the frame that the last command answered [s].
    """

    def __init__(self, death, program, speed):
        self.death, self.program, self.speed = death, program, speed
        self.dead, self.awake = threading.Event(), threading.Event()
        self.last_command = self.stamp = 0.0
        self.programs = 0
        self.sockets = []
        self._tcp = TcpNetwork()
        self._skew = 0.0

    # ---- Network
    def now(self):
        return self._tcp.now() + self._skew

    def connect(self, host, port, timeout):
        if self.is_gone():
            self.pass_time(timeout)
            raise DriverError(f"{host}:{port} does not answer")
        return Dying(self, self._tcp.connect(host, port, timeout))

    def listen(self, address, port):
        self.is_gone()
        return Dying(self, self._tcp.listen(address, port))

    # ---- death
    def die(self):
        self.dead.set()
        if self.death == KILLED:
            self.close()
        elif self.death == FROZEN:
            self.awake.wait()

    def is_gone(self):
        """True when nothing gets through any more; a killed client does not even come back."""
        if not self.dead.is_set() or self.death == FROZEN:
            return False
        if self.death == KILLED:
            raise Killed
        return True

    def pass_time(self, seconds):
        """A client that waits for a lost robot need not really wait."""
        self._skew += seconds

    def close(self):
        for each in self.sockets:
            each.close()

    def before(self, data):
        """The client is going to send this; dies before the program that was chosen."""
        if data.startswith(b"def velocity_receiver"):
            self.programs += 1
            if self.speed is None and self.programs == self.program:
                self.die()

    def took(self, data):
        """The robot has a message; dies after the one that was chosen."""
        if self.dead.is_set() or len(data) != 28:
            return
        mode, *steps = struct.unpack(">7i", data)
        if mode == VelocityMode.VELOCITY:
            self.last_command = self.stamp
            is_fast = self.speed is not None and max(map(abs, steps)) > 1e6 * self.speed
            if is_fast and self.programs == self.program:
                self.die()


class Dying:
    """A connection or a listener of a client that dies."""

    def __init__(self, network, inner):
        self._network, self._inner = network, inner
        network.sockets.append(inner)

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def send(self, data):
        self._network.before(data)
        if not self._network.is_gone():
            self._inner.send(data)
            self._network.took(data)

    def receive(self, timeout):
        if self._network.is_gone():
            return self._network.pass_time(timeout)
        data = self._inner.receive(timeout)
        if data and len(data) % LAYOUT.size == 0:  # no package of another port has this size
            (self._network.stamp,) = struct.unpack_from(">d", data, len(data) - LAYOUT.size + 4)
        return data

    def accept(self, timeout):
        if self._network.is_gone():
            return self._network.pass_time(timeout)
        caller = self._inner.accept(timeout)
        return caller and Dying(self._network, caller)

    def close(self):
        if not self._network.is_gone():
            self._inner.close()


class Bystander:
    """Reads the frames of a robot on a connection of its own, while a client works and dies.

    Attributes:
        latest: the newest frame.
    """

    def __init__(self, frames):
        self._frames = frames
        self.latest = frames.next()
        self._last_motion = 0.0

    def read(self):
        frame = self.latest = self._frames.next()
        if any(frame.target_qd) or abs(frame.actual_qd).max() > REST_SPEED:
            self._last_motion = frame.timestamp

    def until(self, condition):
        while not condition():
            self.read()

    def until_rest(self):
        """Read until no program runs and nothing has moved for as long as time goes on without one."""
        still = 0
        while still < 40:
            self.read()
            at_rest = self.latest.timestamp > self._last_motion
            still = still + 1 if at_rest and self.latest.runtime_state == ProgramState.STOPPED else 0

    def time_to_rest(self, since):
        """From a time stamp to the first of the frames in which the arm rests for good [s]; 0 if it rested."""
        return max(self._last_motion + PERIOD - since, 0.0)


ALLOWED = 0.3  # s

# The programs of an experiment of two runs, and a speed [rad/s] that the phase reaches.
PHASES = {
    "approach": (1, 0.4),
    "identification": (2, 0.08),
    "stream": (3, 0.3),
    "return": (4, 0.3),
    "pause between runs": (4, None),
}


@pytest.fixture(scope="module")
def twice(tmp_path_factory):
    movement = Movement.through([(0.35, -0.08, 0.25), (0.35, 0.08, 0.3)], durations=[1.5])
    return prepare_experiment([movement], repeat=2, out=tmp_path_factory.mktemp("unused"))


def lose_client(box, experiment, death, phase, monkeypatch):
    """Run an experiment until its client is lost and the arm rests, then let the client go on if it can.

    Returns:
        What ended the client, the time to rest [s] and the frame at rest.
    """
    network, errors = DyingNetwork(death, *PHASES[phase]), []

    def work():
        try:
            with UrDriver(box.host, box.ports, network=network) as driver:
                ExperimentRunner(driver, experiment, CONTROLLERS["preview"]).run()
        except BaseException as error:
            errors.append(error)

    client = threading.Thread(target=work)
    with Frames(box) as frames:
        bystander = Bystander(frames)
        client.start()
        try:
            bystander.until(lambda: network.dead.is_set() or not client.is_alive())
            assert network.dead.is_set(), errors
            with monkeypatch.context() as patched:  # s, instead of a minute: time goes on without a command
                patched.setattr(pacing, "HANG_LIMIT", 0.05)
                bystander.until_rest()
            time_to_rest, at_rest = bystander.time_to_rest(network.last_command), bystander.latest
        finally:
            network.awake.set()
            bystander.until(lambda: not client.is_alive())
            network.close()
    return (errors or [None])[0], time_to_rest, at_rest


@pytest.mark.parametrize(
    ("death", "phase"),
    [
        (KILLED, "stream"),
        (FROZEN, "identification"),
        (CUT_OFF, "return"),
        pytest.param(KILLED, "approach", marks=pytest.mark.nightly),
        *(
            pytest.param(death, phase, marks=pytest.mark.nightly)
            for death in (FROZEN, CUT_OFF)
            for phase in ("stream", "pause between runs")
        ),
    ],
)
def test_the_arm_rests_in_time(lockstep_box, twice, tmp_path, death, phase, monkeypatch):
    experiment = replace(twice, out=tmp_path)
    error, time_to_rest, at_rest = lose_client(lockstep_box, experiment, death, phase, monkeypatch)
    rests_already = phase == "pause between runs"
    assert time_to_rest <= ALLOWED
    assert rests_already or time_to_rest > 4 * PERIOD  # it was in motion
    assert at_rest.runtime_state == ProgramState.STOPPED
    assert at_rest.safety_mode == SafetyMode.NORMAL
    if death == KILLED:
        assert isinstance(error, Killed)
        return
    assert (
        kept_recordings(experiment)
        == {
            "approach": [],
            "identification": [],
            "stream": ["aborted"],
            "return": ["complete"],
            "pause between runs": ["complete"] * (2 if death == FROZEN else 1),
        }[phase]
    )
    if death == FROZEN and rests_already:
        assert error is None  # nothing has happened that it need know of
    else:
        words = "the robot had no command for" if death == FROZEN else "no new realtime frame for 120 s"
        assert str(error).startswith(words)
        assert "\n" not in str(error)
        # A client that cannot see the robot any more says so; one that was frozen sees that the arm rests.
        notes = [it for it in getattr(error, "__notes__", []) if not it.startswith("recorded until then")]
        assert bool(notes) == (death == CUT_OFF)


def kept_recordings(experiment):
    """How each recording that was begun ended; all can be read and hold rows."""
    recordings = [load_recording(path) for path in sorted(experiment.out.glob("*.mcap"))]
    assert all(len(recording.column("timestamp")) > 20 for recording in recordings)
    return ["aborted" if "aborted" in recording.summary else "complete" for recording in recordings]
