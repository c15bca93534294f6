"""Framing by a leading length: any split of the bytes gives the same frames."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import RemoteProtocolError
from protocol.frame_buffer import FrameBuffer

BODIES = st.lists(st.binary(max_size=60), max_size=8)


def frame(body: bytes) -> bytes:
    return (len(body) + 4).to_bytes(4, "big") + body


def drain(buffer):
    frames = []
    while (one := buffer.next_frame()) is not None:
        frames.append(one)
    return frames


@given(BODIES, st.lists(st.integers(1, 50), min_size=1), st.booleans())
def test_any_split_gives_the_same_frames(bodies, cuts, drain_often):
    frames = [frame(body) for body in bodies]
    stream = b"".join(frames)
    buffer, got, position, k = FrameBuffer(64), [], 0, 0
    while position < len(stream):
        step = cuts[k % len(cuts)]
        buffer.feed(stream[position : position + step])
        position, k = position + step, k + 1
        if drain_often:
            got += drain(buffer)
    assert got + drain(buffer) == frames
    assert buffer.pending == 0


@given(BODIES)
def test_one_frame_a_feed_and_several_waiting(bodies):
    frames = [frame(body) for body in bodies]
    buffer = FrameBuffer(64)
    for one in frames:
        buffer.feed(one)
    assert buffer.pending == sum(map(len, frames))
    assert drain(buffer) == frames


@pytest.mark.parametrize("size", [-1, 0, 3, 4, 65, 2**31 - 1])
def test_absurd_lengths_are_refused_again_and_again(size):
    buffer = FrameBuffer(max_size=64, min_size=5)
    buffer.feed(size.to_bytes(4, "big", signed=True) + bytes(10))
    for _ in range(2):
        with pytest.raises(RemoteProtocolError, match=f"length {size} is not within 5 to 64"):
            buffer.next_frame()


def test_what_is_handed_out_does_not_change_with_the_callers_buffer():
    data = bytearray(frame(b"abc"))
    buffer = FrameBuffer(64)
    buffer.feed(data)
    data[4] = 0
    assert buffer.next_frame() == frame(b"abc")
