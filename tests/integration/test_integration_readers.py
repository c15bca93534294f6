"""Clients that read, read late or never: every frame once and in order, and nobody else loses anything.

What a process that is stopped for half a minute changes is held where clocks are handed in:
test_realtime_pacing.py, test_driver_stream.py.
"""

from contextlib import ExitStack, contextmanager
from itertools import pairwise

import pytest
from integration_support import (
    PERIOD,
    Frames,
    Messages,
    connect,
    in_background,
    send,
    serving,
)

import ur_emulator.loop.pacing as pacing
from protocol.primary.layout import RobotModeData
from protocol.primary.messages import TextMessage
from protocol.primary.packages import RobotState
from protocol.ur_types import ProgramState


def test_several_clients_see_the_same_frames(lockstep_box):
    ports = ("realtime", "realtime", "realtime_ro")
    with ExitStack() as stack:
        readers = [stack.enter_context(Frames(lockstep_box, port)) for port in ports]
        begins = [reader.next().timestamp for reader in readers]
        send(lockstep_box, "secondary", "def f():\n  sleep(1)\nend\n")
        seen = [{} for _ in readers]
        while min(reader.stamps[-1] for reader in readers) < begins[0] + 1.0:
            for reader, frames in zip(readers, seen, strict=True):
                frame = reader.raw()
                frames[reader.stamps[-1]] = frame
        shared = set.intersection(*map(set, seen))
        assert len(shared) > 100
        for stamp in shared:
            assert len({frames[stamp] for frames in seen}) == 1
        assert [reader.lost() for reader in readers] == [0, 0, 0]


def test_speed_makes_the_same_frames_faster(tmp_path):
    with serving(tmp_path, "--pace", "realtime", "--speed", 10) as box, Frames(box) as frames:
        begin = frames.next().timestamp
        frames.until_stamp(begin + 1.0)
        assert frames.lost() == 0


MINUTE = 'def minute():\n  sleep(60)\n  textmsg("done")\nend\n'
PATIENCE = 0.2  # s; instead of the seconds that a box waits for a reader in lockstep


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(pacing, "READER_LIMIT", PATIENCE)


@contextmanager
def never_read(box, *ports):
    """Peers that connect and never read, with room for little in their kernel buffers."""
    with ExitStack() as stack:
        for port in ports:
            stack.enter_context(connect(box, port))
        yield


@pytest.mark.usefixtures("impatient")
def test_for_a_minute_of_a_program_nobody_else_loses_anything(lockstep_box):
    idle = ("realtime", "realtime", "realtime_ro", "primary", "secondary_ro", "dashboard")
    with never_read(lockstep_box, *idle), Messages(lockstep_box) as primary, Frames(lockstep_box) as frames:
        begin = frames.next().timestamp
        send(lockstep_box, "secondary", MINUTE)
        with in_background(primary.next):
            frames.until_stamp(begin + 60.0)
        done = primary.message(TextMessage) if not said(primary) else said(primary)[0]
        assert done.text == "done"
        assert frames.lost() == 0
        times = sorted({state_time(p) for p in primary.all if isinstance(p, RobotState)})
        assert (
            max(round((b - a) / PERIOD) for a, b in pairwise(times)) <= 13
        )  # 10 states a second, of 12.5 cycles


def said(primary):
    return [m for m in primary.all if isinstance(m, TextMessage)]


def state_time(state):
    return next(p.timestamp for p in state.sub_packages if isinstance(p, RobotModeData)) * 1e-6


@pytest.mark.usefixtures("impatient")
def test_a_reader_that_comes_back_gets_whole_frames_again(lockstep_box):
    with Frames(lockstep_box) as late, Frames(lockstep_box) as frames:
        begin = frames.next().timestamp
        send(lockstep_box, "secondary", MINUTE)
        frames.until_stamp(begin + 50.0)
        late.until_stamp(begin + 40.0)  # asserts that every package is whole
        with in_background(late.raw):
            frames.until_stamp(begin + 60.0)
        assert frames.lost() == 0
        assert late.lost() > 1000
        after = [round(s / PERIOD) for s in late.stamps if s > begin + 52.0]
        assert after[-1] - after[0] + 1 == len(set(after))


@pytest.mark.parametrize("pause", ["sync()", ""], ids=["over cycles", "in one cycle"])
def test_a_flood_of_messages_from_a_program_reaches_who_reads(lockstep_box, pause):
    n = 1000
    text = (
        f"def f():\n  i = 0\n  while i < {n}:\n    textmsg(i)\n    i = i + 1\n    {pause}\n  end\n"
        '  sync()\n  sync()\n  textmsg("end")\nend\n'
    )
    with Messages(lockstep_box) as primary:
        primary.next()
        send(lockstep_box, "secondary", text)
        primary.message(TextMessage, limit=50_000, text="end")
        assert [m.text for m in said(primary)] == [*map(str, range(n)), "end"]


def test_a_client_that_reads_nothing_for_a_while_is_waited_for_and_loses_nothing(lockstep_box):
    with Frames(lockstep_box) as late, Frames(lockstep_box) as frames:
        begin = late.next().timestamp
        send(lockstep_box, "secondary", "def f():\n  sleep(60)\nend\n")
        frames.until(
            lambda f: f.runtime_state == ProgramState.PLAYING and frames.stamps[-2:-1] == frames.stamps[-1:]
        )
        held = frames.stamps[-1]
        assert held < begin + 60.0
        late.until_stamp(held)
        assert late.lost() == 0
