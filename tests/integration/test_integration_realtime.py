"""Real time over sockets: every frame once and in order. Nothing here asserts how long anything took."""

import threading

import pytest
from integration_support import PERIOD, Frames, Messages, VelocitySession, send, serving

from protocol.primary.messages import TextMessage


def test_two_seconds_of_frames_have_consecutive_stamps(realtime_box):
    with Frames(realtime_box) as frames:
        for _ in range(250):
            frames.raw()
        cycles = [round(stamp / PERIOD) for stamp in frames.stamps]
        assert cycles == list(range(cycles[0], cycles[0] + 250))


def test_several_clients_see_the_same_frames(realtime_box):
    with (
        Frames(realtime_box) as one,
        Frames(realtime_box) as two,
        Frames(realtime_box, "realtime_ro") as three,
    ):
        seen = {id(reader): {} for reader in (one, two, three)}
        for _ in range(100):
            for reader in (one, two, three):
                frame = reader.raw()
                seen[id(reader)][reader.stamps[-1]] = frame
        shared = set.intersection(*(set(s) for s in seen.values()))
        assert len(shared) > 90
        for stamp in shared:
            assert len({s[stamp] for s in seen.values()}) == 1
        assert one.lost() == two.lost() == three.lost() == 0


def test_no_frame_is_lost_while_programs_are_compiled(realtime_box):
    """A long program is compiled beside the loop, not in it."""
    body = "".join(f"  x{i} = {i} + sin({i})\n" for i in range(1500))
    with Messages(realtime_box) as primary, Frames(realtime_box) as frames:
        frames.next()
        for k in range(3):
            send(realtime_box, "secondary", f'def long{k}():\n{body}  textmsg("long {k}")\nend\n')
        reader = threading.Thread(target=primary.message, args=(TextMessage,), kwargs={"text": "long 2"})
        reader.start()
        frames.until(lambda _: not reader.is_alive(), frames.raw)
        cycles = [round(stamp / PERIOD) for stamp in frames.stamps]
        assert cycles == list(range(cycles[0], cycles[0] + len(cycles)))


def test_a_stream_of_velocities_arrives_cycle_by_cycle(realtime_box):
    with VelocitySession(realtime_box, missed_allowed=6) as session:
        for _ in range(125):
            frame = session.velocity(0.2)
        assert frame.target_qd[0] == pytest.approx(0.2)
        session.send(0)
        session.frames.rest()
        assert session.frames.lost() == 0


def test_speed_makes_the_same_frames_faster(tmp_path):
    with serving(tmp_path, "--pace", "realtime", "--speed", 10) as box, Frames(box) as frames:
        begin = frames.next().timestamp
        frames.until_stamp(begin + 5.0)
        assert frames.lost() == 0
