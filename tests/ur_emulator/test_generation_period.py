"""Robots with other control cycles: the same times in seconds, and frames, packages and steps at the new period."""

from dataclasses import replace

import numpy as np
import pytest
from box_support import Bench, FrameReader, MessageReader, connect
from generation_support import SECOND
from rtde_support import RtdeClient

from protocol.primary.layout import RobotModeData
from ur_emulator import ControlBox
from ur_emulator.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.errors import EmulatorError
from ur_emulator.models.generations import CB3

# Control cycle and physics step [us].
CYCLES = [(8_000, 2_000), (4_000, 2_000), (4_000, 1_000), (2_000, 2_000)]
OTHERS = [*(replace(CB3, period_us=period, substep_us=substep) for period, substep in CYCLES), SECOND]
HOME = "[0, -1.57, -1.57, -1.57, 1.57, 0]"
# Two cycles of a CB3 [s]: by so much a script that waits for a whole cycle may differ.
SLACK = 0.016

every_generation = pytest.mark.parametrize(
    "generation", OTHERS, ids=lambda g: f"{g.name}-{g.period_us}us-{g.substep_us}us"
)


def body(text):
    return "def p():\n" + "".join(f"  {line}\n" for line in text.splitlines()) + "end\n"


def time_of(bench, text):
    """Run a program to its end; return how long it took [s]."""
    begin = bench.now.timestamp
    bench.start(body(text))
    while bench.controller.programs.is_running:
        bench.tick()
    return bench.now.timestamp - begin


@every_generation
def test_a_box_begins_a_minute_after_its_start_and_counts_in_its_own_cycles(generation):
    bench = Bench(generation=generation)
    assert bench.now.timestamp == pytest.approx(60.0, abs=SLACK)
    bench.tick(100)
    stamps = [snapshot.timestamp for snapshot in bench.snapshots]
    assert np.diff(stamps) == pytest.approx(generation.period_s)


@every_generation
def test_programs_get_the_cycle_and_sync_takes_one(generation):
    bench = Bench(generation=generation)
    assert bench.run(body("textmsg(get_steptime())")) == [f"{generation.period_s:g}"]
    took = time_of(bench, "i = 0\nwhile i < 50:\n  i = i + 1\n  sync()\nend")
    assert took == pytest.approx(50 * generation.period_s, abs=2 * generation.period_s)


@every_generation
@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("sleep(0.5)", 0.5),
        ("speedj([0.2, 0, 0, 0, 0, 0], 2, 0.5)", 0.5),
        (f"movej({HOME})\nmovej([0.3, -1.57, -1.57, -1.57, 1.57, 0], t=1)", None),
        (f"movej({HOME})\nmovel(p[0.2, -0.2, 0.3, 0, 3.14, 0], a=0.5, v=0.1)", None),
    ],
    ids=["sleep", "speedj", "movej", "movel"],
)
def test_what_takes_time_takes_the_same_time(generation, text, seconds):
    if seconds is None:
        seconds = time_of(Bench(generation=CB3), text)
    assert time_of(Bench(generation=generation), text) == pytest.approx(seconds, abs=2 * SLACK)


@every_generation
def test_a_stream_of_speedj_reaches_its_speed_and_goes_as_far(generation):
    bench = Bench(generation=generation, fidelity="ideal")
    q_before = bench.now.actual_q[0]
    bench.start(body("while True:\n  speedj([0.2, 0, 0, 0, 0, 0], 1, get_steptime())\nend"))
    bench.tick(generation.cycles(1.0))
    assert bench.now.actual_qd[0] == pytest.approx(0.2, abs=0.005)
    # 0.2 s of acceleration at 1 rad/s^2, then 0.2 rad/s.
    assert bench.now.target_q[0] - q_before == pytest.approx(0.02 + 0.2 * 0.8, abs=0.2 * SLACK)
    assert bench.now.actual_q[0] == pytest.approx(bench.now.target_q[0], abs=0.01)


@every_generation
def test_a_stream_of_servoj_follows_in_the_same_time(generation):
    bench = Bench(generation=generation, fidelity="ideal")
    q_before = bench.now.actual_q[0]
    bench.start(
        body(
            "q = get_actual_joint_positions()\nwhile True:\n"
            "  q[0] = q[0] + 0.2 * get_steptime()\n  servoj(q, t=get_steptime(), lookahead_time=0.1, gain=300)\nend"
        )
    )
    bench.tick(generation.cycles(1.0))
    # The lag is the lookahead time.
    assert bench.now.target_q[0] - q_before == pytest.approx(0.2 * (1.0 - 0.1), abs=0.2 * SLACK)
    assert bench.now.target_qd[0] == pytest.approx(0.2, abs=0.005)


@every_generation
def test_the_loop_from_command_to_measurement_takes_the_same_time(generation):
    bench = Bench(generation=generation)
    bench.start(body("speedj([0.2, 0, 0, 0, 0, 0], 1, 2)"))
    bench.tick(generation.cycles(1.0))
    lag = (bench.now.target_q[0] - bench.now.actual_q[0]) / 0.2
    fidelity, plant = bench.controller.plant.fidelity, bench.controller.plant
    # A target holds for the end of its cycle, so the cycle itself is no part of the lag.
    assert lag == pytest.approx(plant.dead_time + fidelity.drive_lag + fidelity.feedback_age, abs=SLACK)


@every_generation
def test_a_watchdog_counts_seconds(generation):
    bench = Bench(generation=generation)
    text = 'rtde_set_watchdog("input_int_register_24", 10, "stop")\nwhile True:\n  sync()\nend'
    assert 0.1 <= time_of(bench, text) <= 0.1 + 3 * generation.period_s


@every_generation
def test_a_protective_stop_may_be_unlocked_after_its_delay_and_time_passes_until_then(generation):
    bench = Bench(generation=generation)
    bench.tick(1, TriggerProtectiveStop())
    begin = bench.now.timestamp
    while bench.controller.is_active:
        bench.tick()
    assert bench.now.timestamp - begin >= 5.0
    bench.tick(1, UnlockProtectiveStop())
    assert bench.now.safety_mode == 1


@every_generation
def test_joint_positions_are_remembered_for_a_second(generation):
    bench = Bench(generation=generation)
    bench.tick(generation.cycles(1.5))
    allowed = generation.cycles(1.0) - 1
    (text,) = bench.run(body(f"textmsg(get_actual_joint_positions_history({allowed}))"))
    assert text.startswith("[")


@every_generation
def test_frames_and_packages_come_at_the_period(generation):
    period, rate = generation.period_s, generation.cycle_rate
    with (
        ControlBox(in_process=True, pace="lockstep", port_base=None, generation=generation) as box,
        connect(box, "realtime") as sock,
        connect(box, "primary") as sender,
    ):
        frames, states = FrameReader(sock), MessageReader(sender)
        sender.sendall(body("sleep(1.2)").encode())
        stamps = [frames.until(lambda frame: frame.runtime_state == 2).timestamp]
        stamps += [frames.next().timestamp for _ in range(rate)]
        assert np.diff(stamps) == pytest.approx(period)
        # Before the program is compiled time stands still, and states repeat themselves.
        while not (state := states.state().find(RobotModeData)).is_program_running:
            pass
        times = [state.timestamp, *(states.state().find(RobotModeData).timestamp for _ in range(8))]
        assert np.diff(times) == pytest.approx(100_000, abs=generation.period_us)


@every_generation
@pytest.mark.parametrize(("frequency", "seconds"), [(None, None), (125.0, 0.008), (10.0, 0.1)])
def test_rtde_has_the_full_rate_and_whole_parts_of_it(generation, frequency, seconds):
    with (
        ControlBox(in_process=True, pace="lockstep", port_base=None, generation=generation) as box,
        connect(box, "rtde") as sock,
    ):
        client = RtdeClient(sock)
        client.subscribe("timestamp", "runtime_state", frequency=frequency or float(generation.cycle_rate))
        with connect(box, "secondary") as sender:
            sender.sendall(body("sleep(2)").encode())
            while client.data()["runtime_state"] != 2:
                pass
            stamps = [client.data()["timestamp"] for _ in range(10)]
    # The rate is a whole part of the cycle's: 10 of 125 a second are every twelfth.
    cycles = 1 if seconds is None else int(generation.cycle_rate / frequency)
    assert np.diff(stamps) == pytest.approx(cycles * generation.period_s)


def test_a_box_of_another_generation_names_its_software():
    other = replace(CB3, name="test series", major=4)
    with pytest.raises(EmulatorError, match=r"software of the test series is 4\.x"):
        ControlBox(in_process=True, generation=other)
