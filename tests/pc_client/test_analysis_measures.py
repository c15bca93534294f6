"""Eq. 10 and its companions, errors, budget and noise floor on signals whose figures are known beforehand."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording_samples import N_VALUES, PERIOD, SIGNALS, append_rows, lognormal, provenance, record_movement

from pc_client.analysis.measures import (
    PARTS,
    Snr,
    measure_snr,
    snr_db,
    speed,
    steps_of,
    track_of,
    velocity,
)
from pc_client.analysis.noise_floor import speed_noise, step_covariance, unrepeatable_power
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.table import build_table
from pc_client.control.loop import LoopModel, velocity_response
from pc_client.errors import RecordingError
from pc_client.kinematics.model import robot_model, tcp_positions
from pc_client.recording.recorder import Recorder
from pc_client.recording.recording import load_recording
from pc_client.recording.rows import Phase


def measured(path: Path) -> Snr:
    return measure_snr(track_of(load_recording(path)))


@given(st.floats(0.001, 0.1), st.integers(1, 8))
def test_delayed_sine(delay: float, periods: int) -> None:
    t = np.arange(1000) / 1000.0
    omega = 2.0 * math.pi * periods
    reference, actual = np.sin(omega * t), np.sin(omega * (t - delay))
    expected = -10.0 * math.log10(2.0 * (1.0 - math.cos(omega * delay)))
    assert snr_db(reference, actual) == pytest.approx(expected, abs=1e-6)


def test_extremes() -> None:
    assert snr_db(np.ones(3), np.ones(3)) == math.inf
    assert snr_db(np.zeros(3), np.ones(3)) == -math.inf


def test_a_lost_frame_makes_one_step_longer_and_moves_no_other() -> None:
    """At 125 Hz a step is of neighbours; at 500 Hz each sample from the fifth on ends one, 8 ms long."""
    for period, each in ((0.008, 1), (0.002, 4)):
        t = np.delete(period * np.arange(40), 17)
        p = np.column_stack([0.3 * t, 0.4 * t, np.zeros(39)])
        np.testing.assert_allclose(speed(t, p), 0.5)
        begins, ends = steps_of(t)
        lengths = t[ends] - t[begins]
        assert len(lengths) == 39 - each
        longer = np.flatnonzero(lengths > 0.0081)
        np.testing.assert_allclose(np.delete(lengths, longer), 0.008)
        np.testing.assert_allclose(lengths[longer], [0.008 + period])


def test_all_samples_of_a_fast_arm_count_and_its_noise_weighs_as_at_125_hz() -> None:
    t = 0.002 * np.arange(4000)
    p = np.random.default_rng(3).normal(0.0, 1e-5, (4000, 3))
    every_fourth = velocity(t[::4], p[::4])
    assert np.std(velocity(t, p)) == pytest.approx(np.std(every_fourth), rel=0.05)
    np.testing.assert_array_equal(velocity(t, p)[::4], every_fourth)


@pytest.mark.parametrize("lag", [-0.013, 0.0213, 0.25])
def test_delay_is_found_below_one_sample_and_costs_what_the_integral_says(tmp_path: Path, lag: float) -> None:
    snr = measured(record_movement(tmp_path / "a.mcap", lag=lag))
    assert snr.speed_lag_s == pytest.approx(lag, abs=1e-5)
    assert snr.velocity_lag_s == pytest.approx(lag, abs=1e-5)
    assert snr.speed_shifted_db > 60.0
    t = np.linspace(0.0, 2.0, 20_001)
    reference, actual = (np.gradient(lognormal(x, 2.0), t) for x in (t, t - lag))
    assert snr.speed_db == pytest.approx(snr_db(reference, actual), abs=0.1)
    assert snr.velocity_db == pytest.approx(snr.speed_db, abs=1e-9)  # a straight line: no wrong direction


def test_scale_error_is_not_healed_by_a_shift(tmp_path: Path) -> None:
    snr = measured(record_movement(tmp_path / "a.mcap", gain=0.9))
    assert snr.speed_db == pytest.approx(20.0, abs=1e-6)
    assert snr.speed_shifted_db == pytest.approx(20.0, abs=0.01)


def test_position_noise(tmp_path: Path) -> None:
    sigma = 1.5e-5
    path = record_movement(tmp_path / "a.mcap", noise=sigma, duration=12.0, length=1.0)
    t = np.arange(0.0, 12.0, PERIOD)
    power = np.mean(np.square(np.gradient(lognormal(t, 12.0), t)))
    expected = 10.0 * math.log10(power / (2.0 * sigma**2 / PERIOD**2))
    snr = measured(path)
    assert snr.speed_db == pytest.approx(expected, abs=0.3)
    # The vector sees the noise of all three axes.
    assert snr.velocity_db == pytest.approx(expected - 10.0 * math.log10(3.0), abs=0.3)


def test_only_the_vector_sees_a_wrong_direction(tmp_path: Path) -> None:
    def along_z(t: np.ndarray) -> np.ndarray:
        return np.column_stack([0.0 * t, 0.0 * t, 0.3 * lognormal(t, 2.0)])

    snr = measured(record_movement(tmp_path / "a.mcap", gain=0.0, distort=along_z))
    assert snr.speed_db > 200.0
    assert snr.velocity_db == pytest.approx(-10.0 * math.log10(2.0), abs=1e-6)


def test_only_the_movement_counts(tmp_path: Path) -> None:
    def nudge_at_rest(t: np.ndarray) -> np.ndarray:
        return np.outer((t < -0.1) * 1e-3 * np.sin(40.0 * t), [1.0, 0.0, 0.0])

    assert measured(record_movement(tmp_path / "a.mcap", distort=nudge_at_rest)).speed_db == math.inf


def test_heartbeats_do_not_count(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS) as recorder:
        for i in range(120):
            frame = np.zeros(14)
            frame[0] = PERIOD * (i // 2)  # every stamp comes twice
            frame[7] = 0.25 * frame[0]
            p = (frame[7], 0.0, 0.0)
            recorder.append(frame, 0.0, frame[1:7], frame[1:7], p, p, frame[1:7], Phase.MOVEMENT)
    track = track_of(load_recording(tmp_path / "a.mcap"))
    assert len(track.t) == 60
    np.testing.assert_allclose(speed(track.t, track.p_actual), 0.25)


@pytest.mark.parametrize("late", [0.0, 0.3, 0.9])
def test_a_movement_begins_where_its_reference_does_not_at_its_first_sample(
    tmp_path: Path, late: float
) -> None:
    """Frames fall anywhere in a cycle of the reference; `late` is the part of a cycle after its begin."""
    with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS) as recorder:
        for i in range(-20, 60):
            frame = np.zeros(14)
            frame[0] = 50.0 + PERIOD * (i + late)
            phase = Phase.MOVEMENT if i >= 0 else Phase.SETTLE_BEFORE
            p = (0.01 * i, 0.0, 0.0)
            recorder.append(frame, PERIOD * (i + late), frame[1:7], frame[1:7], p, p, frame[1:7], phase)
    track = track_of(load_recording(tmp_path / "a.mcap"))
    assert track.t_begin == pytest.approx(50.0, abs=1e-9)
    assert track.t_start == pytest.approx(50.0 + late * PERIOD, abs=1e-9)


def test_a_recording_without_movement_is_refused(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS) as recorder:
        append_rows(recorder, 12)
    with pytest.raises(RecordingError, match="has 4 samples of movement; at least 10"):
        track_of(load_recording(tmp_path / "a.mcap"))


def analysed(tmp_path: Path, **fault: Any) -> MeasuredRun:
    return analyse_run(load_recording(record_movement(tmp_path / "a.mcap", **fault)))


def wave(frequency: float, amplitude: float) -> Any:
    """A ripple of the position along the movement."""
    return lambda t: np.outer(amplitude * np.sin(2.0 * math.pi * frequency * t), [0.0, 1.0, 0.0])


def test_constant_offset_is_named_and_taken_out_only_under_its_own_name(tmp_path: Path) -> None:
    errors = analysed(tmp_path, offset=(0.003, 0.004, 0.0)).errors
    assert errors.max_position_error_mm == pytest.approx(5.0)
    assert errors.rms_position_error_mm == pytest.approx(5.0)
    assert errors.max_path_error_mm == pytest.approx(0.0, abs=1e-3)
    assert errors.offset_mm == pytest.approx((3.0, 4.0, 0.0), abs=1e-3)
    assert errors.max_joint_error_mrad == pytest.approx((4.0,) * 6)
    assert errors.rms_joint_error_mrad == pytest.approx((4.0,) * 6)


def test_lag_costs_position_but_not_path(tmp_path: Path) -> None:
    errors = analysed(tmp_path, lag=0.02).errors
    assert errors.peak_speed_mm_s == pytest.approx(0.3 / 2.0 * 1.875 * 1e3, rel=1e-3)
    assert errors.max_position_error_mm == pytest.approx(0.02 * errors.peak_speed_mm_s, rel=1e-2)
    assert errors.max_path_error_mm < 0.01
    assert errors.duration_s == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("part", "fault"),
    [
        ("delay", {"lag": 0.016}),
        ("scale and ramp", {"gain": 0.93}),
        ("slow rest", {"distort": wave(3.1, 1e-3)}),
        ("fast rest", {"distort": wave(14.0, 2e-4)}),
    ],
)
def test_each_fault_lands_in_its_part_of_the_budget(tmp_path: Path, part: str, fault: dict[str, Any]) -> None:
    # Ripple only while moving, else the phases of rest would call it noise.
    if "distort" in fault:
        ripple = fault["distort"]
        fault = {"distort": lambda t: ripple(t) * ((t > 0.0) & (t < 2.0))[:, None]}
    run = analysed(tmp_path, **fault)
    assert run.budget.share(part) > 0.8
    assert run.budget.alone_db(part) == pytest.approx(run.snr.speed_db, abs=1.0)


def test_a_perfect_arm_has_no_error(tmp_path: Path) -> None:
    run = analysed(tmp_path)
    assert run.snr.speed_db == run.snr.velocity_db == math.inf
    assert abs(run.snr.speed_lag_s) < 1e-6
    assert run.budget.error_power == 0.0
    assert all(run.budget.share(part) == 0.0 for part in PARTS)
    assert run.budget.alone_db("delay") == math.inf


def test_the_parts_add_up(tmp_path: Path) -> None:
    run = analysed(tmp_path, lag=0.012, gain=0.98, noise=2e-5, distort=wave(9.0, 1e-4))
    assert tuple(run.budget.parts) == PARTS
    assert min(run.budget.parts.values()) >= 0.0
    assert sum(run.budget.parts.values()) == pytest.approx(run.budget.error_power, rel=1e-12)
    assert sum(run.budget.share(part) for part in PARTS) == pytest.approx(1.0)
    snr = 10.0 * math.log10(run.budget.signal_power / run.budget.error_power)
    assert snr == pytest.approx(run.snr.speed_db, abs=1e-9)


SIGMA = np.array((1.1e-5, 1.1e-5, 1.45e-5, 1.45e-5, 1.75e-5, 1.75e-5))
Q0 = np.array((0.4, -1.77, -2.1, -0.1, 1.3, 1.86))
DISPLACEMENT = np.array((0.5, 0.3, -0.4, 0.2, -0.1, 0.3))


def record_joints(path: Path, seed: int, *, ripple: float = 0.0, push: float = 0.0) -> MeasuredRun:
    """A joint movement on a UR3 whose only fault is the noise of its encoders (and a ripple that repeats).

    `push` [rad/s] is the size of a command beside those that make it perfect, and of its effect.
    """
    model, random = robot_model("ur3"), np.random.default_rng(seed)
    rest, duration = 0.8, 6.0
    t = PERIOD * np.arange(-round(rest / PERIOD), round((duration + rest) / PERIOD) + 1)
    q_ref = Q0 + lognormal(t, duration)[:, None] * DISPLACEMENT
    q = q_ref + ripple * np.sin(101 * q_ref) * np.square(np.sin(np.pi * np.clip(t / duration, 0, 1)))[:, None]
    cmd_qd = push * np.sin(2 * np.pi * 2.0 * t)[:, None] * ((t > 0.5) & (t < 4.5))[:, None] * np.ones(6)
    response = velocity_response(LoopModel(0.02, 0.01, 0.0, 0.0), PERIOD) * PERIOD
    q = q + np.cumsum([np.convolve(column, response)[: len(t)] for column in cmd_qd.T], axis=1).T
    q = q + random.normal(0.0, SIGMA, q.shape)
    p_ref, p = tcp_positions(model, q_ref), tcp_positions(model, q)
    prov = provenance(
        robot_model="UR3", repetition=seed, loop={"dead_time_s": 0.02, "lag_s": 0.01, "joint_spread_s": 0.0}
    )
    with Recorder(path, prov, SIGNALS) as recorder:
        for i, now in enumerate(t):
            frame = np.zeros(N_VALUES)
            frame[0], frame[1:7], frame[7:10] = 10.0 + PERIOD * i, q[i], p[i]
            phase = Phase.SETTLE_BEFORE if now < -1e-9 else Phase.MOVEMENT
            phase = Phase.SETTLE_AFTER if now > duration + 1e-9 else phase
            recorder.append(frame, now, q_ref[i], np.zeros(6), p_ref[i], np.zeros(3), cmd_qd[i], phase)
    return analyse_run(load_recording(path))


def floor_of(runs: list[MeasuredRun]) -> float | None:
    return replace(runs[0], covariance=step_covariance(runs)).floor_db


@pytest.fixture(scope="module")
def perfect(tmp_path_factory: pytest.TempPathFactory) -> list[MeasuredRun]:
    folder = tmp_path_factory.mktemp("perfect")
    return [record_joints(folder / f"a_r{k}.mcap", k) for k in range(1, 7)]


def test_a_perfect_arm_stands_on_its_floor(perfect: list[MeasuredRun]) -> None:
    covariance = step_covariance(perfect)
    assert covariance is not None
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), math.sqrt(2) * SIGMA, rtol=0.15)
    snr = np.mean([run.snr.speed_db for run in perfect])
    # the derivation, and then with what so few frames at rest tell of the noise
    assert snr == pytest.approx(replace(perfect[0], covariance=np.diag(2 * SIGMA**2)).floor_db, abs=0.2)
    assert snr == pytest.approx(floor_of(perfect), abs=0.5)


def test_the_noise_of_the_budget_is_that_of_the_floor(perfect: list[MeasuredRun]) -> None:
    table = build_table(perfect)
    for run in table.all_runs:
        assert run.budget.share("noise") > 0.75
        assert run.budget.alone_db("noise") == pytest.approx(table.frame["noise_floor_db"][0], abs=0.8)
    row = table.to_json()["rows"][0]
    assert row["noise_floor_db"] == pytest.approx(table.frame["noise_floor_db"][0], abs=1e-6)
    assert row["unrepeatable_db"] is not None
    assert f"| {table.frame['noise_floor_db'][0]:.2f} |" in table.to_markdown()


def test_an_error_that_repeats_is_not_in_the_floor(tmp_path: Path, perfect: list[MeasuredRun]) -> None:
    spoilt = [record_joints(tmp_path / f"a_r{k}.mcap", k, ripple=8e-4) for k in range(1, 7)]
    clean, ours = floor_of(perfect), floor_of(spoilt)
    assert clean is not None
    assert ours == pytest.approx(clean, abs=0.1)
    assert spoilt[0].snr.speed_db < ours - 3.0
    # nor is it in what does not repeat; the noise's mean near rest is missing there, so it is a little less
    power = unrepeatable_power(spoilt)
    assert power is not None
    unrepeatable = 10.0 * math.log10(spoilt[0].budget.signal_power / power)
    assert ours - 0.3 < unrepeatable < ours + 2.0


def test_what_the_commands_differ_by_is_taken_out(tmp_path: Path, perfect: list[MeasuredRun]) -> None:
    pushed = [record_joints(tmp_path / f"a_r{k}.mcap", k, push=0.005 * k) for k in (1, 2, 3)]
    alike, driven = unrepeatable_power(perfect[:3]), unrepeatable_power(pushed)
    assert alike is not None
    assert driven == pytest.approx(alike, rel=0.06)
    differ = [np.diff(run.track.p_actual, axis=0) for run in pushed]
    same = [np.diff(run.track.p_actual, axis=0) for run in perfect[:2]]
    assert np.std(differ[1] - differ[0]) > 1.2 * np.std(same[1] - same[0])


def test_of_old_recordings_and_single_runs_nothing_is_known(
    tmp_path: Path, perfect: list[MeasuredRun]
) -> None:
    assert unrepeatable_power(perfect[:1]) is None
    old = [record_movement(tmp_path / f"b_r{k}.mcap", prov=provenance(repetition=k)) for k in (1, 2)]
    assert unrepeatable_power([analyse_run(load_recording(path)) for path in old]) is None


def test_an_endless_margin_is_null_in_json(tmp_path: Path) -> None:
    loop = {"dead_time_s": 0.02, "lag_s": 0.01, "gain_margin": math.inf, "learning_limited_by": "noise"}
    path = record_movement(tmp_path / "a.mcap", prov=provenance(loop=loop))
    written = build_table([analyse_run(load_recording(path))]).to_json()["loop"]
    assert json.dumps(written, allow_nan=False)
    assert written == {**loop, "gain_margin": None}


def test_without_rest_or_a_known_arm_there_is_no_floor(tmp_path: Path, perfect: list[MeasuredRun]) -> None:
    short = analyse_run(load_recording(record_movement(tmp_path / "a.mcap", rest=0.1)))
    assert step_covariance([short]) is None
    assert short.floor_db is None
    strange = analyse_run(
        load_recording(record_movement(tmp_path / "b.mcap", prov=provenance(robot_model="unknown")))
    )
    assert replace(strange, covariance=step_covariance(perfect)).floor_db is None
    assert build_table([strange]).to_json()["rows"][0]["noise_floor_db"] is None


@pytest.mark.parametrize("speed", [0.0, 5e-4, 2e-3, 0.2])
def test_expectation_against_draws(speed: float) -> None:
    root = np.array([[1.2e-3, 0, 0], [3e-4, 8e-4, 0], [-2e-4, 1e-4, 1e-3]])
    v = np.array([[speed, 0.0, 0.0]])
    mean, variance = speed_noise(v, root @ root.T)
    draws = np.random.default_rng(0).normal(size=(400_000, 3)) @ root.T
    excess = np.linalg.norm(v + draws, axis=1) - speed
    power = float(np.mean(excess**2))
    assert mean[0] ** 2 + variance[0] == pytest.approx(power, rel=0.05)
    assert mean[0] == pytest.approx(excess.mean(), abs=0.06 * math.sqrt(power))
