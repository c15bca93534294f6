"""Position errors, joint errors, noise floor and error budget on faults that are known beforehand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_samples import PERIOD, record_movement

from pc_client.analysis.measures import PARTS, rest_noise
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.recording.recording import load_recording


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


def test_noise_at_rest(tmp_path: Path) -> None:
    sigma = 1e-5
    run = analysed(tmp_path, noise=sigma, rest=4.0)
    covariance = rest_noise(run.recording, run.track)
    assert covariance is not None
    expected = 2.0 * sigma**2 / PERIOD**2
    assert run.errors.noise_floor_mm_s == pytest.approx(1e3 * math.sqrt(expected), rel=0.05)
    assert np.trace(covariance) / 3.0 == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(
    ("part", "fault"),
    [
        ("delay", {"lag": 0.016}),
        ("scale and ramp", {"gain": 0.93}),
        ("slow rest", {"distort": wave(3.1, 1e-3)}),
        ("fast rest", {"distort": wave(14.0, 2e-4)}),
        ("noise", {"noise": 2e-5, "rest": 4.0}),
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


def test_the_parts_add_up(tmp_path: Path) -> None:
    run = analysed(tmp_path, lag=0.012, gain=0.98, noise=2e-5, distort=wave(9.0, 1e-4))
    assert tuple(run.budget.parts) == PARTS
    assert min(run.budget.parts.values()) >= 0.0
    assert sum(run.budget.parts.values()) == pytest.approx(run.budget.error_power, rel=1e-12)
    assert sum(run.budget.share(part) for part in PARTS) == pytest.approx(1.0)
    snr = 10.0 * math.log10(run.budget.signal_power / run.budget.error_power)
    assert snr == pytest.approx(run.snr.speed_db, abs=1e-9)


def test_budget_of_a_perfect_arm(tmp_path: Path) -> None:
    run = analysed(tmp_path)
    assert run.budget.error_power == 0.0
    assert all(run.budget.share(part) == 0.0 for part in PARTS)
    assert run.budget.alone_db("delay") == math.inf
