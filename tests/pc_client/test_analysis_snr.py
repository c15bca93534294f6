"""Eq. 10 and its companions on signals whose figures are known beforehand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recording_samples import PERIOD, SIGNALS, append_rows, lognormal, provenance, record_movement

from pc_client.analysis.measures import Snr, measure_snr, snr_db
from pc_client.analysis.track import speed, track_of
from pc_client.errors import RecordingError
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


@given(st.floats(-0.9, 3.0).filter(lambda g: abs(g - 1.0) > 1e-3))
def test_scaled_signal(gain: float) -> None:
    reference = np.array([0.0, 1.0, 4.0, 2.0])
    assert snr_db(reference, gain * reference) == pytest.approx(-20.0 * math.log10(abs(gain - 1.0)))


def test_noise_of_known_power() -> None:
    rng = np.random.default_rng(1)
    reference = np.sin(np.arange(100_000) * 0.01)
    actual = reference + rng.normal(0.0, 0.05, reference.shape)
    assert snr_db(reference, actual) == pytest.approx(10.0 * math.log10(0.5 / 0.05**2), abs=0.05)


def test_extremes() -> None:
    assert snr_db(np.ones(3), np.ones(3)) == math.inf
    assert snr_db(np.zeros(3), np.ones(3)) == -math.inf


def test_speed_comes_from_first_differences_over_the_real_time_between_frames() -> None:
    t = np.array([0.0, 0.008, 0.024, 0.032])  # a frame is missing after the second
    p = np.column_stack([0.3 * t, 0.4 * t, np.zeros(4)])
    np.testing.assert_allclose(speed(t, p), 0.5)


def test_perfect_arm(tmp_path: Path) -> None:
    snr = measured(record_movement(tmp_path / "a.mcap"))
    assert snr.speed_db == math.inf
    assert snr.velocity_db == math.inf
    assert abs(snr.speed_lag_s) < 1e-6


@pytest.mark.parametrize("lag", [-0.013, 0.004, 0.008, 0.0213, 0.1, 0.25])
def test_delay_is_found_below_one_sample_and_costs_what_the_integral_says(tmp_path: Path, lag: float) -> None:
    snr = measured(record_movement(tmp_path / "a.mcap", lag=lag))
    assert snr.speed_lag_s == pytest.approx(lag, abs=1e-5)
    assert snr.velocity_lag_s == pytest.approx(lag, abs=1e-5)
    assert snr.speed_shifted_db > 60.0
    t = np.linspace(0.0, 2.0, 20_001)
    reference, actual = (np.gradient(lognormal(x, 2.0), t) for x in (t, t - lag))
    assert snr.speed_db == pytest.approx(snr_db(reference, actual), abs=0.1)
    assert snr.velocity_db == pytest.approx(snr.speed_db, abs=1e-9)  # a straight line: no wrong direction


@pytest.mark.parametrize("gain", [0.9, 1.05])
def test_scale_error_is_not_healed_by_a_shift(tmp_path: Path, gain: float) -> None:
    snr = measured(record_movement(tmp_path / "a.mcap", gain=gain))
    expected = -20.0 * math.log10(abs(gain - 1.0))
    assert snr.speed_db == pytest.approx(expected, abs=1e-6)
    assert snr.speed_shifted_db == pytest.approx(expected, abs=0.01)


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
