"""Who has the arm: the table, and everything that may happen in every state, one after the other.

What acts together on whole boxes is walked in tests/walk.
"""

import itertools
import random
import re

import numpy as np
import pytest
from motion_support import DT, HOME, START, TOOL, Swing, line, renew, run_cycles

from protocol.pose import pose_trans
from ur_emulator.machine.motion.arm_motion import ArmMotion, OwnershipError
from ur_emulator.machine.motion.generators import (
    DirectTorque,
    JointTarget,
    Kind,
    ServoJ,
    SpeedJ,
    StopJ,
    TorqueCommand,
)
from ur_emulator.machine.motion.leg import move_j
from ur_emulator.machine.motion.move import Move
from ur_emulator.machine.motion.ownership import TABLE, TRANSITIONS, ArmState, Event, Fate
from ur_emulator.machine.motion.tool_streams import SpeedL

SIX = (0.0,) * 6
QD = (0.4, -0.3, 0.2, 0.1, 0.0, 0.5)


def a_move(q=HOME):
    pose = TOOL.pose(q)
    return Move(line(pose, pose_trans(pose, (0.02, 0.03, 0.02, 0.0, 0.0, 0.0)), near=q, v=0.2))


def test_no_row_says_another_thing_than_one_before_it():
    entries = [(state, row.event, kind) for row in TABLE for state in row.states for kind in row.kinds]
    assert len(entries) == len(set(entries)) == len(TRANSITIONS)


def test_every_state_is_entered_and_left_and_every_event_has_a_row_with_its_source():
    assert {row.event for row in TABLE} == set(Event)
    for state in ArmState:
        assert any(row.after is state and set(row.states) - {state} for row in TABLE)
        assert any(row.after is not state and state in row.states for row in TABLE)
    assert all(re.search(r"\b[DOIC]\b", row.why) for row in TABLE)


def test_whatever_has_the_arm_loses_it_to_a_stop():
    """From every state, with every kind of command, a stop and rest lead to an arm that nobody has."""
    for state, kind in itertools.product(ArmState, (None, *Kind)):
        if state is ArmState.BY_HAND:
            continue  # until the hand lets go
        taken = TRANSITIONS.get((state, Event.TAKEN, kind))
        after = state if taken is None else taken.after
        if after is ArmState.SUSPENDED:
            after = TRANSITIONS[after, Event.RESUME, None].after
        if after is ArmState.BRAKING:
            after = TRANSITIONS[after, Event.DONE, None].after
        assert after is ArmState.HOLDING
        assert taken is None or taken.fate is Fate.TAKEN


# What may happen to an arm; each gets the motion, a generator of random numbers and the last command.
COMMANDS = {
    "speedj": lambda rng: SpeedJ(QD, rng.uniform(0.5, 6.0)),
    "speedl": lambda rng: SpeedL((0.05, 0.02, -0.03, 0.1, 0.0, 0.2), 1.0, 1.0, line(START, START).tool),
    "servoj": lambda rng: ServoJ(tuple(q + 0.02 for q in HOME), 0.1, 300.0, (3.0,) * 6),
    "stop": lambda rng: StopJ(rng.uniform(0.5, 6.0)),
}
EVENTS = {
    "pause": lambda motion: motion.pause(),
    "hard pause": lambda motion: motion.pause(motion.stop_deceleration),
    "resume": lambda motion: motion.resume(),
    "interrupt": lambda motion: motion.interrupt(),
    "abort": lambda motion: motion.abort(),
    "end": lambda motion: motion.stop(),
    "release": lambda motion: motion.release("me"),
    "begin program": lambda motion: motion.begin_program(),
    "overlay": lambda motion: motion.add_overlay(Swing()),
    "no overlay": lambda motion: [motion.remove_overlay(overlay) for overlay in tuple(motion.overlays)],
}


@pytest.mark.parametrize("seed", range(60))
def test_whatever_happens_set_points_go_on_without_a_step(seed):
    rng = random.Random(seed)
    motion = ArmMotion(HOME, 20.0, run_up_time=0.16)
    command, scale, happened = None, 1.0, []
    for _ in range(400):
        for _ in range(rng.choice([0, 0, 0, 1, 1, 2])):
            name = rng.choice(["move", *COMMANDS, *EVENTS])
            happened.append(name)
            if name in EVENTS:
                EVENTS[name](motion)
                continue
            # A move begins at rest, as its builtin sees to.
            if name == "move":
                generator = StopJ(5.0) if any(motion.path.qd) else a_move(motion.path.q)
            else:
                generator = COMMANDS[name](rng)
            if name == "speedj" and rng.random() < 0.2:
                measured = motion.target
                generator = DirectTorque(TorqueCommand(SIX, SIX, SIX), lambda measured=measured: measured)
            try:
                command = motion.command("me", generator)
            except OwnershipError:
                assert motion._time.paused
        if command is not None and rng.random() < 0.9:
            command.is_renewed = True
        scale = rng.choice([scale] * 20 + [0.0, 0.3, 1.0])
        before, was_paused = motion.target, motion.is_paused
        is_move = motion.move is not None
        after = motion.step(DT, scale)
        change = np.abs(np.subtract(after.qd, before.qd)).max() / DT
        jump = np.abs(np.subtract(after.q, before.q) - 0.5 * DT * np.add(after.qd, before.qd)).max()
        assert not motion.is_compliant or motion.state is ArmState.BY_TORQUE
        if not motion.is_compliant and not (is_move and motion.state is ArmState.MOVING):
            # Of the hardest stop; that of overlays adds to that of the path.
            most = 48.0 if motion.overlays else 22.0
            assert change <= most, happened[-5:]
            assert jump <= most * DT**2, happened[-5:]
        if was_paused and motion.is_paused:
            assert after.q == before.q
            assert after.qd == SIX
        if command is not None and command.is_over:
            assert motion.command_of("me") is not command
    motion.stop()
    run_cycles(motion, 200)
    assert motion.state is ArmState.HOLDING
    assert motion.owner is None
    assert command is None or command.is_over


def test_a_hand_takes_the_arm_from_a_move_and_the_move_from_its_thread_when_it_lets_go():
    motion = ArmMotion(HOME, 20.0)
    command = motion.command("me", a_move())
    run_cycles(motion, 20)
    where = tuple(q + 0.1 for q in HOME)
    motion.guide(lambda: JointTarget(where, (0.5, *SIX[1:])))
    assert motion.step(DT, 1.0) == JointTarget(where, (0.5, *SIX[1:]))
    assert command.fate is Fate.ACTIVE
    motion.let_go()
    assert command.fate is Fate.TAKEN
    drops = -np.diff([t.qd[0] for t in run_cycles(motion, 10)], prepend=0.5)
    assert drops.max() <= 20.0 * DT * (1 + 1e-9)
    assert motion.state is ArmState.HOLDING


def test_a_hand_that_lets_go_at_once_leaves_the_set_point():
    motion = ArmMotion(HOME, 20.0)
    motion.guide(lambda: JointTarget(tuple(q + 0.1 for q in HOME)))
    motion.let_go()
    assert motion.step(DT, 1.0).q == HOME


def test_a_move_that_is_guided_away_in_a_pause_returns_to_its_path():
    motion = ArmMotion(HOME, 20.0)
    command = motion.command("me", a_move())
    run_cycles(motion, 20)
    motion.pause()
    run_cycles(motion, 40)
    left = motion.path.q
    motion.guide(lambda: JointTarget(tuple(q + 0.1 for q in HOME)))
    run_cycles(motion, 5)
    motion.let_go()
    run_cycles(motion, 5)
    assert motion.is_paused
    motion.resume()
    assert motion.state is ArmState.RETURNING
    targets = run_cycles(motion, 1)
    while motion.state is ArmState.RETURNING:
        targets += run_cycles(motion, 1)
    assert targets[-1].q == pytest.approx(left, abs=1e-9)
    while not command.is_over:
        run_cycles(motion, 1)
    assert command.fate is Fate.DONE


def test_a_paused_stream_that_goes_on_before_it_rests_keeps_its_speed():
    """At a lowered speed scaling too; where the slider has moved meanwhile, the arm rests first."""
    for before, after in ((1.0, 1.0), (0.3, 0.3), (1.0, 0.3), (0.3, 1.0)):
        motion = ArmMotion(HOME, 20.0)
        command = motion.command("me", SpeedJ(QD, 2.0))
        targets = []

        def cycles(n, scale, *, renews=True, motion=motion, command=command, targets=targets):
            for _ in range(n):
                if renews:
                    command.is_renewed = True
                targets.append(motion.step(DT, scale))

        cycles(120, before)
        motion.pause()
        cycles(2, after, renews=False)
        assert any(targets[-1].qd)
        motion.resume()
        cycles(200, after)
        assert targets[-1].qd == pytest.approx([after * v for v in QD])
        # The ramp of a pause, and that of the speed scaling.
        change = np.abs(np.diff([t.qd for t in targets], axis=0)).max() / DT
        assert change <= 4.0 + 4.0 * max(QD)


def test_a_stream_that_was_lost_is_renewed_where_it_is():
    motion = ArmMotion(HOME, 20.0)
    command = motion.command("me", SpeedJ(QD, 2.0))
    renew(motion, command, 100)
    run_cycles(motion, 3)
    assert motion.state is ArmState.BRAKING
    assert command.fate is Fate.SUSPENDED
    command.is_renewed = True
    motion.step(DT, 1.0)
    assert motion.state is ArmState.STREAMING
    run_cycles(motion, 100)
    assert command.fate is Fate.TAKEN
    assert motion.owner is None


def test_nobody_moves_the_arm_in_a_pause():
    motion = ArmMotion(HOME, 20.0)
    motion.pause()
    with pytest.raises(OwnershipError):
        motion.command("another", SpeedJ(QD, 2.0))


def test_the_first_move_of_a_program_runs_up_as_recorded():
    """Source: recordings of a real UR3 and of the maker's simulator, with a = 1 rad/s²."""
    motion = ArmMotion(HOME, 20.0, run_up_time=0.16)
    motion.begin_program()
    motion.command("me", Move(move_j(HOME, (HOME[0] + 1.5, *HOME[1:]), TOOL, a=1.0, v=0.8)))
    qd = [target.qd[0] for target in run_cycles(motion, 30)]
    recorded = [4e-5, 1.8e-4, 4.8e-4, 1.0e-3, 1.8e-3, 2.94e-3, 4.48e-3, 6.48e-3, 9.0e-3, 1.21e-2]
    assert qd[:10] == pytest.approx(recorded, rel=5e-3)
    qdd = np.diff(qd, prepend=0.0) / DT
    assert qdd.max() == pytest.approx(1.3775, abs=1e-4)
    assert qdd[20:] == pytest.approx(1.0)
