"""The noise floor: from rest to Eq. 10, checked against perfect arms with known noise."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from recording_samples import N_VALUES, PERIOD, SIGNALS, lognormal, provenance, record_movement

from pc_client.analysis.measures import speed_noise
from pc_client.analysis.noise_floor import floor_db, step_covariance, unrepeatable_power
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.table import build_table
from pc_client.control.loop_model import LoopModel, velocity_response
from pc_client.kinematics.forward import tcp_positions
from pc_client.kinematics.robot_model import robot_model
from pc_client.recording.recorder import Recorder
from pc_client.recording.recording import load_recording
from pc_client.recording.rows import Phase

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
    assert snr == pytest.approx(floor_db(perfect[0], np.diag(2 * SIGMA**2)), abs=0.2)
    assert snr == pytest.approx(floor_db(perfect[0], covariance), abs=0.5)


def test_an_error_that_repeats_is_not_in_the_floor(tmp_path: Path, perfect: list[MeasuredRun]) -> None:
    spoilt = [record_joints(tmp_path / f"a_r{k}.mcap", k, ripple=8e-4) for k in range(1, 7)]
    clean, ours = (floor_db(runs[0], step_covariance(runs)) for runs in (perfect, spoilt))
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


def test_table_shows_the_floor(perfect: list[MeasuredRun]) -> None:
    table = build_table(perfect)
    row = table.to_json()["rows"][0]
    assert row["noise_floor_db"] == pytest.approx(table.frame["noise_floor_db"][0], abs=1e-6)
    assert row["unrepeatable_db"] is not None
    assert f"| {table.frame['noise_floor_db'][0]:.2f} |" in table.to_markdown()


def test_an_endless_margin_is_null_in_json(tmp_path: Path) -> None:
    loop = {"dead_time_s": 0.02, "lag_s": 0.01, "gain_margin": math.inf, "learning_limited_by": "noise"}
    path = record_movement(tmp_path / "a.mcap", prov=provenance(loop=loop))
    written = build_table([analyse_run(load_recording(path))]).to_json()["loop"]
    assert json.dumps(written, allow_nan=False)
    assert written == {**loop, "gain_margin": None}


def test_without_rest_or_a_known_arm_there_is_no_floor(tmp_path: Path, perfect: list[MeasuredRun]) -> None:
    short = analyse_run(load_recording(record_movement(tmp_path / "a.mcap", rest=0.1)))
    assert step_covariance([short]) is None
    assert floor_db(perfect[0], None) is None
    strange = analyse_run(
        load_recording(record_movement(tmp_path / "b.mcap", prov=provenance(robot_model="unknown")))
    )
    assert floor_db(strange, step_covariance(perfect)) is None
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


def test_fast_motion_feels_the_noise_along_it_alone() -> None:
    covariance = np.diag([1e-6, 9e-6, 4e-6])
    mean, variance = speed_noise(np.array([[0.3, 0.0, 0.0]]), covariance)
    assert variance[0] == pytest.approx(1e-6, rel=1e-3)
    assert abs(mean[0]) < 1e-4
