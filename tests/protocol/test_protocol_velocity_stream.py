"""The reverse channel: golden bytes, round trip, and refusal of what must never reach an arm."""

from __future__ import annotations

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol import velocity_stream as V
from protocol.errors import LocalProtocolError, RemoteProtocolError


def test_golden_message():
    qd = (0.1, -0.1, 0.0, 1e-6, 3.141593, -2.0)
    data = V.encode_velocity(V.VelocityMode.VELOCITY, qd)
    assert data == V.encode_velocity(V.VelocityMode.VELOCITY, np.array(qd))
    assert data.hex(" ", 4) == "00000001 000186a0 fffe7960 00000000 00000001 002fefd9 ffe17b80"


@given(st.sampled_from(V.VelocityMode), st.lists(st.floats(-2147.0, 2147.0), min_size=6, max_size=6))
def test_round_trip_within_half_a_step(mode, qd):
    data = V.encode_velocity(mode, qd)
    assert len(data) == 28
    word, *steps = struct.unpack(">7i", data)
    assert word == mode
    assert [step / 1e6 for step in steps] == pytest.approx(qd, abs=0.5000001e-6)


def test_stop_and_hold_need_no_velocities():
    assert V.encode_velocity(V.VelocityMode.STOP_PROGRAM) == bytes(28)
    assert V.encode_velocity(V.VelocityMode.HOLD) == b"\0\0\0\x02" + bytes(24)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 2147.5, -1e300, "x", None])
@pytest.mark.parametrize("place", [0, 5])
def test_values_that_do_not_fit_are_refused(bad, place):
    qd = [0.0] * 6
    qd[place] = bad
    with pytest.raises(LocalProtocolError, match="six finite numbers"):
        V.encode_velocity(V.VelocityMode.VELOCITY, qd)


@pytest.mark.parametrize("count", [0, 5, 7])
def test_other_counts_are_refused(count):
    with pytest.raises(LocalProtocolError, match="six finite numbers"):
        V.encode_velocity(V.VelocityMode.VELOCITY, np.zeros(count))


def test_hello():
    V.check_hello(b"\0\0\0\x01")
    for data in (b"", b"\0\0\0\x02", b"GET / HTTP"):
        with pytest.raises(RemoteProtocolError, match="instead of hello"):
            V.check_hello(data)
