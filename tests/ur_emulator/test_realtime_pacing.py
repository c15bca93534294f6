"""When the next cycle of a box begins, in real time and in lockstep; the clock is a number."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from ur_emulator.host.pacing import (
    FIRST_READ_LIMIT,
    HANG_LIMIT,
    MAX_BACKLOG,
    READER_LIMIT,
    LockstepPacer,
    RealtimePacer,
)
from ur_emulator.host.served_box import ServedBox
from ur_emulator.machine.commands.programs import SetSpeedSlider
from ur_emulator.machine.commands.safety import TriggerFault
from ur_emulator.machine.controller.events import SafetyModeChanged
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robots import robot_by_name

PERIOD = 0.008


@dataclass
class Box:
    is_active: bool = True
    waits_outside: bool = False
    readers_full: bool = False
    reader_limit: float = READER_LIMIT
    given_up: int = 0
    cycles_behind: int = 0

    def give_up_readers(self, waited):
        if waited >= self.reader_limit:
            self.given_up += 1
            self.readers_full = False

    def fell_behind(self, n_cycles):
        self.cycles_behind += n_cycles


def test_realtime_ticks_at_absolute_deadlines_so_lateness_does_not_add_up():
    pacer, box = RealtimePacer(PERIOD), Box()
    assert pacer.may_tick(10.0, box)
    for k in range(1, 100):
        late = 0.003 if k % 7 == 0 else 0.0
        assert not pacer.may_tick(10.0 + k * PERIOD - 1e-6, box)
        assert pacer.may_tick(10.0 + k * PERIOD + 1e-9 + late, box)
    assert pacer.next_call(11.0) == pytest.approx(10.0 + 100 * PERIOD)
    assert box.cycles_behind == 0


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
    assert box.cycles_behind == pytest.approx(10 * MAX_BACKLOG / PERIOD, abs=2)


def test_a_cycle_may_be_computed_a_little_before_its_deadline_without_moving_the_next():
    pacer = RealtimePacer(PERIOD, lead=0.0004)
    assert pacer.may_tick(10.0, Box())
    for k in range(1, 50):
        deadline = 10.0 + k * PERIOD
        assert pacer.next_call(0.0) == pytest.approx(deadline)
        assert not pacer.may_tick(deadline - 0.0005, Box())
        assert pacer.may_tick(deadline - 0.0003, Box())
        assert pacer.publish_at == pytest.approx(deadline)


def test_the_lead_is_at_most_a_quarter_of_a_short_period():
    pacer = RealtimePacer(PERIOD, speed=100.0, lead=0.0004)
    pacer.may_tick(0.0, Box())
    assert pacer.next_call(0.0) == PERIOD / 100
    assert not pacer.may_tick(0.70 * PERIOD / 100, Box())
    assert pacer.may_tick(0.76 * PERIOD / 100, Box())


def served_box():
    """A box in real time, alone in its loop."""
    machine = Machine(robot_by_name("ur3"), CB3.fidelity("exact"), 0)
    return ServedBox(machine, None, RealtimePacer(PERIOD, lead=0.0004), None, pytest.fail)


def test_what_was_computed_early_leaves_at_the_deadline_and_later_commands_count_in_the_next_cycle():
    box = served_box()
    seen = []
    box.attach([SimpleNamespace(publish=seen.append)])
    assert box.advance(10.0) == pytest.approx(10.0 + PERIOD)
    assert len(seen) == 1
    deadline = box.advance(10.0 + PERIOD - 0.0003)
    assert deadline == pytest.approx(10.0 + PERIOD)
    box.submit(SetSpeedSlider(0.25))
    assert box.advance(deadline - 0.0001) == deadline
    assert len(seen) == 1
    assert box.advance(deadline) == pytest.approx(10.0 + 2 * PERIOD)
    box.advance(10.0 + 2 * PERIOD)
    assert [snapshot.tick - seen[0].tick for snapshot in seen] == [0, 1, 2]
    assert [snapshot.target_speed_fraction for snapshot in seen] == [1.0, 1.0, 0.25]


def test_messages_of_a_cycle_that_was_computed_early_are_sent_before_anybody_can_see_its_state():
    box = served_box()
    seen = []
    box.attach([SimpleNamespace(publish=lambda snapshot: seen.append("state"))], [seen.append])
    box.advance(10.0)
    seen.clear()
    box.submit(TriggerFault())
    box.advance(10.0 + PERIOD - 0.0003)
    assert SafetyModeChanged(int(box.controller.snapshot.safety_mode)) in seen
    assert "state" not in seen
    box.advance(10.0 + PERIOD)
    assert seen[-1] == "state"


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


def wait(pacer, box, seconds, begin=0.0):
    """Ask as often as the loop does; returns after how many seconds the first cycle may begin, or None."""
    for k in range(round(seconds / PERIOD)):
        if pacer.may_tick(begin + k * PERIOD, box):
            return k * PERIOD
    return None


def test_lockstep_holds_time_while_a_script_waits_and_lets_go_after_the_hang_limit_at_real_pace():
    pacer = LockstepPacer(PERIOD)
    box = Box(waits_outside=True)
    let_go = wait(pacer, box, 2 * HANG_LIMIT)
    assert let_go == pytest.approx(HANG_LIMIT, abs=2 * PERIOD)
    assert not pacer.may_tick(let_go + 0.5 * PERIOD, box)
    assert pacer.may_tick(let_go + 1.01 * PERIOD, box)
    box.waits_outside = False
    assert pacer.may_tick(let_go + 1.02 * PERIOD, box)


@pytest.mark.parametrize("limit", [READER_LIMIT, FIRST_READ_LIMIT])
def test_lockstep_waits_for_readers_but_not_for_ever(limit):
    box = Box(readers_full=True, reader_limit=limit)
    assert wait(LockstepPacer(PERIOD), box, 2 * READER_LIMIT) == pytest.approx(limit, abs=2 * PERIOD)
    assert box.given_up == 1


@dataclass(frozen=True)
class Client:
    peer: str
    has_read: bool


@pytest.mark.parametrize(
    ("waited", "given_up"),
    [
        (FIRST_READ_LIMIT - 0.1, set()),
        (FIRST_READ_LIMIT, {"sender"}),
        (READER_LIMIT - 0.1, {"sender"}),
        (READER_LIMIT, {"sender", "reader"}),
    ],
)
def test_a_client_that_has_never_read_is_given_up_before_a_reader(waited, given_up):
    box = served_box()
    box.backlog = {Client("sender", has_read=False), Client("reader", has_read=True)}
    box.submit(SetSpeedSlider(0.5))
    box.give_up_readers(waited)
    assert {entry.text.partition(" does not read")[0] for entry in box.log.entries} == given_up
    assert box.readers_full is (len(given_up) < 2)


def test_the_limits_count_from_the_beginning_of_each_wait():
    pacer = LockstepPacer(PERIOD)
    for begin in (0.0, HANG_LIMIT, 2 * HANG_LIMIT):
        assert wait(pacer, Box(waits_outside=True), 0.6 * HANG_LIMIT, begin) is None
        assert pacer.may_tick(begin + 0.7 * HANG_LIMIT, Box())
    for begin in (0.0, READER_LIMIT):
        assert wait(pacer, Box(readers_full=True), 0.6 * READER_LIMIT, begin) is None
        assert pacer.may_tick(begin + 0.7 * READER_LIMIT, Box())


@pytest.mark.parametrize("waiting", [{"waits_outside": True}, {"readers_full": True}])
def test_a_box_that_was_stopped_does_not_lose_patience_with_its_clients(waiting):
    pacer, box = LockstepPacer(PERIOD), Box(**waiting)
    for hour in range(4):
        assert wait(pacer, box, 1.0, 3600.0 * hour) is None
    assert box.given_up == 0


def test_while_a_script_waits_nobody_loses_patience_with_readers():
    pacer, box = LockstepPacer(PERIOD), Box(waits_outside=True, readers_full=True)
    assert wait(pacer, box, HANG_LIMIT - 1.0) is None
    box.waits_outside = False  # the client goes on: it sends first and reads then
    assert wait(pacer, box, READER_LIMIT - 1.0, HANG_LIMIT) is None
    assert box.given_up == 0


def test_a_script_that_hangs_is_not_held_up_by_readers_as_well():
    box = Box(waits_outside=True, readers_full=True)
    assert wait(LockstepPacer(PERIOD), box, 2 * HANG_LIMIT) == pytest.approx(HANG_LIMIT, abs=2 * PERIOD)
    assert box.given_up == 1
