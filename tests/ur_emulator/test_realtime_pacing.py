from dataclasses import dataclass

import pytest

from ur_emulator.realtime.pacing import (
    HANG_LIMIT,
    MAX_BACKLOG,
    READER_LIMIT,
    LockstepPacer,
    Pace,
    RealtimePacer,
    make_pacer,
)

PERIOD = 0.008


@dataclass
class Box:
    is_active: bool = True
    waits_outside: bool = False
    readers_full: bool = False
    given_up: int = 0
    cycles_behind: int = 0

    def give_up_readers(self):
        self.given_up += 1
        self.readers_full = False

    def fell_behind(self, n_cycles):
        self.cycles_behind += n_cycles


def test_realtime_ticks_at_absolute_deadlines_so_lateness_does_not_add_up():
    pacer = RealtimePacer(PERIOD)
    assert pacer.may_tick(10.0, Box())
    for k in range(1, 100):
        late = 0.003 if k % 7 == 0 else 0.0
        assert not pacer.may_tick(10.0 + k * PERIOD - 1e-6, Box())
        assert pacer.may_tick(10.0 + k * PERIOD + 1e-9 + late, Box())
    assert pacer.next_call(11.0) == pytest.approx(10.0 + 100 * PERIOD)
    assert pacer.lost_cycles == 0


def test_realtime_catches_up_short_delays_but_starts_anew_after_long_ones():
    pacer = RealtimePacer(PERIOD)
    pacer.may_tick(0.0, Box())
    ticks = 0
    while pacer.may_tick(0.1, Box()):
        ticks += 1
    assert ticks == int(0.1 / PERIOD)
    later = 0.1 + 10 * MAX_BACKLOG
    box, ticks = Box(), 0
    while pacer.may_tick(later, box):
        ticks += 1
    assert ticks < MAX_BACKLOG / PERIOD
    assert pacer.lost_cycles == pytest.approx(10 * MAX_BACKLOG / PERIOD, abs=2)
    assert box.cycles_behind == pacer.lost_cycles


def test_speed_divides_the_period():
    pacer = RealtimePacer(PERIOD, speed=4.0)
    pacer.may_tick(0.0, Box())
    assert pacer.next_call(0.0) == PERIOD / 4


def test_boxes_that_share_a_loop_take_turns():
    pacers = [RealtimePacer(PERIOD, phase=k / 4) for k in range(4)]
    ticks = [
        (step, k)
        for step in range(16)
        for k, pacer in enumerate(pacers)
        if pacer.may_tick(10.0 + step * PERIOD / 8 + 1e-9, Box())
    ]
    assert ticks == [(0, 0), (2, 1), (4, 2), (6, 3), (8, 0), (10, 1), (12, 2), (14, 3)]


def test_lockstep_ticks_at_once_while_something_goes_on_and_never_otherwise():
    pacer = LockstepPacer(PERIOD)
    assert all(pacer.may_tick(0.0, Box()) for _ in range(1000))
    assert not pacer.may_tick(1e6, Box(is_active=False))


def test_lockstep_holds_time_while_a_script_waits_and_lets_go_after_the_hang_limit_at_real_pace():
    pacer = LockstepPacer(PERIOD)
    box = Box(waits_outside=True)
    assert not pacer.may_tick(0.0, box)
    assert not pacer.may_tick(HANG_LIMIT - 1e-3, box)
    assert pacer.may_tick(HANG_LIMIT + 1e-3, box)
    assert not pacer.may_tick(HANG_LIMIT + 2e-3, box)
    assert pacer.may_tick(HANG_LIMIT + 2e-3 + PERIOD, box)
    box.waits_outside = False
    assert pacer.may_tick(HANG_LIMIT + 3e-3 + PERIOD, box)


def test_lockstep_waits_for_readers_but_not_for_ever():
    pacer = LockstepPacer(PERIOD)
    box = Box(readers_full=True)
    assert not pacer.may_tick(0.0, box)
    assert not pacer.may_tick(READER_LIMIT - 1e-3, box)
    assert box.given_up == 0
    assert pacer.may_tick(READER_LIMIT + 1e-3, box)
    assert box.given_up == 1


def test_the_limits_count_from_the_beginning_of_each_wait():
    pacer = LockstepPacer(PERIOD)
    assert not pacer.may_tick(0.0, Box(waits_outside=True))
    assert pacer.may_tick(1.0, Box())
    assert not pacer.may_tick(HANG_LIMIT + 0.5, Box(waits_outside=True))


def test_pacers_have_names():
    assert isinstance(make_pacer(Pace("realtime"), PERIOD), RealtimePacer)
    assert isinstance(make_pacer(Pace("lockstep"), PERIOD), LockstepPacer)
