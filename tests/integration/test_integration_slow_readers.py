"""Peers that do not read, or flood: nobody else loses anything, memory stays bounded, time goes on."""

from contextlib import ExitStack, contextmanager
from itertools import pairwise

import pytest
from integration_support import PERIOD, Frames, Messages, connect, in_background, send, serving

import ur_emulator.realtime.pacing as pacing
from protocol.primary.layout import RobotModeData
from protocol.primary.messages import ErrorCodeMessage, TextMessage
from protocol.primary.packages import RobotState

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


def test_memory_stays_bounded_with_peers_that_never_read(tmp_path):
    """In real time nobody is waited for; sixty times as fast to be done in a second."""
    with serving(tmp_path, "--pace", "realtime", "--speed", 30) as box:
        with never_read(box, *["realtime"] * 20), Frames(box) as frames:
            begin = frames.next().timestamp
            frames.until_stamp(begin + 5.0)
            early = resident(box.process.pid)
            frames.until_stamp(begin + 35.0)
            grown = resident(box.process.pid) - early
        unread = 20 * 3750 * 1140
        assert grown < 0.1 * unread


def resident(pid):
    """Resident memory of a process [bytes]."""
    with open(f"/proc/{pid}/statm") as statm:
        return int(statm.read().split()[1]) * 4096


def test_a_flood_of_statements_is_bounded_and_delays_nobody_for_long(realtime_box):
    with (
        Messages(realtime_box) as primary,
        Frames(realtime_box) as frames,
        connect(realtime_box, "secondary") as flood,
    ):
        frames.next()
        with in_background(frames.raw):
            flood.sendall(b"x\n" * 50_000)
            send(realtime_box, "secondary", 'def hello():\n  textmsg("hello")\nend\n')
            primary.message(TextMessage, limit=500_000, text="hello")
        texts = [m.text for m in primary.all if isinstance(m, ErrorCodeMessage)]
        assert "programs come faster than they compile, some were dropped" in texts
        assert frames.lost() == 0


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
