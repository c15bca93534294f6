"""The primary and secondary ports read by hand, byte for byte, as clients do that bring a parser of their own."""

import struct
from dataclasses import dataclass

import numpy as np
from clients_support import TIMEOUT, connect, receive_exactly

STATE, MESSAGE = 16, 20
VERSION_MESSAGE, TEXT, LABEL, POPUP, SAFETY_MODE, ERROR, KEY, EXCEPTION, REQUEST = 3, 0, 1, 2, 5, 6, 7, 10, 9
MODE, JOINTS, TOOL, MASTERBOARD, CARTESIAN, KINEMATICS, CONFIGURATION, FORCE, ADDITIONAL = range(9)


@dataclass(frozen=True)
class Message:
    """A message of the robot.

    Attributes:
        stamp: as sent.
        source: who says it.
        kind: number of its type.
        body: what follows.
    """

    stamp: int
    source: int
    kind: int
    body: bytes


class PrimaryWire:
    """A connection to a primary or secondary port."""

    def __init__(self, box, port="primary"):
        self.sock = connect(box, port)
        self.sock.settimeout(TIMEOUT)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.sock.close()

    def write(self, text):
        self.sock.sendall(text.encode())

    def package(self):
        """Return type and payload of the next package."""
        size, kind = struct.unpack(">iB", receive_exactly(self.sock, 5))
        assert 5 <= size <= 4096, "URCL reads packages of at most 4096 bytes"
        return kind, receive_exactly(self.sock, size - 5)

    def message(self, kind=None):
        """Return the next message, or the next of a kind."""
        while True:
            package, payload = self.package()
            if package == MESSAGE:
                stamp, source, number = struct.unpack_from(">QbB", payload)
                if kind in (None, number):
                    return Message(stamp, source, number, payload[10:])

    def state(self, wanted=None):
        """Return the sub-packages of the next state (that has one of this type) by their types."""
        while True:
            kind, payload = self.package()
            if kind != STATE:
                continue
            parts, at = {}, 0
            while at < len(payload):
                size, number = struct.unpack_from(">iB", payload, at)
                assert 5 <= size <= len(payload) - at
                parts[number] = payload[at + 5 : at + size]
                at += size
            if wanted is None or wanted in parts:
                return parts


def calibrated_dh(box):
    """Return theta, a, d, alpha of the arm as the primary port tells them; each 6 numbers."""
    with PrimaryWire(box) as wire:
        body = wire.state(KINEMATICS)[KINEMATICS]
    values = struct.unpack_from(">24d", body, 6 * 4)
    return np.array(values).reshape(4, 6)


def forward(dh, q):
    """Return position and rotation matrix of the flange."""
    pose = np.eye(4)
    for theta, a, d, alpha in zip(dh[0] + q, *dh[1:], strict=True):
        ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        pose = pose @ np.array(
            [
                [ct, -st * ca, st * sa, a * ct],
                [st, ct * ca, -ct * sa, a * st],
                [0, sa, ca, d],
                [0, 0, 0, 1],
            ]
        )
    return pose[:3, 3], pose[:3, :3]


def rotation(vector):
    """Return the matrix of a rotation vector."""
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def twist(dh, q, qd):
    """Return the flange's velocity and angular velocity."""
    step = 1e-6
    ahead, behind = (forward(dh, np.asarray(q) + s * step * np.asarray(qd)) for s in (1, -1))
    omega = (ahead[1] - behind[1]) @ forward(dh, q)[1].T / (2 * step)
    return np.concatenate([(ahead[0] - behind[0]) / (2 * step), [omega[2, 1], omega[0, 2], omega[1, 0]]])
