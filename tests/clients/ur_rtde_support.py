"""ur_rtde from PyPI, as it is, and what its tests share."""

import sys
import time
from contextlib import contextmanager, nullcontext, suppress
from types import SimpleNamespace

import numpy as np
import pytest
from clients_support import wait_until

REASON = f"ur_rtde 1.6.5 has no wheel for Python {sys.version_info[0]}.{sys.version_info[1]} on this machine"
rtde_control = pytest.importorskip("rtde_control", reason=REASON)
rtde_receive = pytest.importorskip("rtde_receive", reason=REASON)
rtde_io = pytest.importorskip("rtde_io", reason=REASON)
dashboard_client = pytest.importorskip("dashboard_client", reason=REASON)

RTDEControl = rtde_control.RTDEControlInterface
RTDEReceive = rtde_receive.RTDEReceiveInterface
RTDEIO = rtde_io.RTDEIOInterface
Dashboard = dashboard_client.DashboardClient

HOME = (0.3944, -1.7645, -2.0996, -0.1030, 1.2950, 1.8570)  # rad
PERIOD = 0.008  # s
SPEED, ACCELERATION = 3.0, 12.0  # rad/s, rad/s^2; no test is about slowness
LOOKAHEAD, GAIN = 0.1, 300  # of servoJ
CLOSE_Q = 5e-4  # rad; backlash and sag of the arm at rest
CLOSE_X = 1e-3  # m, and rad for a rotation vector
TRIES = 3  # before the last


@contextmanager
def connected(interface, *arguments, port=None):
    """Connect one of ur_rtde's interfaces and disconnect it: one that outlives its box ends the whole process.

    The client gives its script five seconds to start, by the wall clock. A busy machine gets more tries. `port` gives
    the last argument, another one each time: a client that has failed keeps the port that it listens on.
    """
    for tries_left in range(TRIES, -1, -1):
        with suppress(RuntimeError) if tries_left else nullcontext():
            client = interface(*arguments, *([] if port is None else [port()]))
            break
    try:
        yield client
    finally:
        client.disconnect()


class Arm(SimpleNamespace):
    """The control and receive interfaces of one arm, and the joint angles where its tests begin."""

    def get_ready(self):
        """Run the control script, unlock the arm if need be, and bring it to its start."""
        if self.receive.isProtectiveStopped():
            self.unlock()
        if not self.control.isProgramRunning():
            self.restart()
        self.control.isSteady()  # a call that a test may have cost
        self.go_home()

    def restart(self):
        assert self.control.reuploadScript()
        wait_until(self.control.isProgramRunning, "the control script")

    def unlock(self):
        """Unlock a protective stop on the dashboard, which refuses it for the first seconds."""
        dashboard = Dashboard(self.box.host)
        dashboard.connect()
        refusals = set()

        def is_unlocked():
            try:
                dashboard.unlockProtectiveStop()
            except RuntimeError as refusal:
                refusals.add(str(refusal))
                return False
            return True

        wait_until(is_unlocked, "the end of the protective stop")
        self.until(lambda r: not r.isProtectiveStopped())
        dashboard.stop()
        dashboard.disconnect()
        return refusals

    def go_home(self):
        wait_until(lambda: self.control.moveJ(list(self.home), SPEED, ACCELERATION), "the start")
        # The answer may overtake the last packages of the move.
        self.until(lambda r: np.allclose(r.getTargetQ(), self.home, rtol=0, atol=1e-9))

    def until(self, condition):
        """Wait until the receive interface shows it."""
        wait_until(lambda: condition(self.receive))

    def still(self):
        """Wait until the arm rests."""
        self.until(lambda r: not any(r.getTargetQd()) and np.abs(r.getActualQd()).max() < 2e-3)

    def after(self, seconds):
        """Wait until so much robot time has passed."""
        start = self.receive.getTimestamp()
        self.until(lambda r: r.getTimestamp() >= start + seconds - 1e-4)

    def is_at(self, q):
        """Return whether the arm comes to rest at these joint angles."""
        self.still()
        return np.allclose(self.receive.getActualQ(), q, rtol=0, atol=CLOSE_Q)

    def is_at_pose(self, pose):
        """Return whether the arm comes to rest at this pose."""
        self.still()
        return np.allclose(self.receive.getActualTCPPose(), pose, rtol=0, atol=CLOSE_X)

    def trace(self, running, *names):
        """Return what the getters gave in the cycles in which `running()` held: an array for each."""
        rows = [sample(self.receive, "Timestamp", *names)[1]]
        while running():
            assert len(rows) < 100_000
            row = sample(self.receive, "Timestamp", *names)[1]
            if row[0] > rows[-1][0]:
                rows.append(row)
            time.sleep(0.001)
        return [np.array(column) for column in zip(*rows, strict=True)]


def home(*delta):
    """Return the start's angles with some of the first changed."""
    q = np.array(HOME)
    q[: len(delta)] += delta
    return q.tolist()


def shifted(pose, *delta):
    """Return a pose displaced along the base's axes."""
    moved = np.array(pose)
    moved[: len(delta)] += delta
    return moved.tolist()


def sample(receive, *names):
    """Return timestamp and values of one cycle."""
    for _ in range(1000):
        stamp = receive.getTimestamp()
        values = [getattr(receive, "get" + name)() for name in names]
        if receive.getTimestamp() == stamp:
            return stamp, values
    raise AssertionError("no cycle lasted as long as reading it")


def servo_along_a_sine(arm, period, amplitude=0.1):
    """Stream a whole sine of the first joint [rad] in a second of robot time; return its set-points and angles."""
    start = arm.receive.getTimestamp()
    rows = []
    while (now := arm.receive.getTimestamp() - start) < 1.0:
        begin = arm.control.initPeriod()
        offset = amplitude * (1 - np.cos(2 * np.pi * now)) / 2
        q = [arm.home[0] + offset, *arm.home[1:]]
        assert arm.control.servoJ(q, 0.5, 0.5, period, LOOKAHEAD, GAIN)
        rows.append([values[0] for values in sample(arm.receive, "TargetQ", "ActualQ")[1]])
        arm.control.waitPeriod(begin)
    assert arm.control.servoStop(5.0)
    arm.still()
    assert len(rows) > 50
    target, actual = np.array(rows).T
    assert np.ptp(target) > 0.8 * amplitude
    return target, actual
