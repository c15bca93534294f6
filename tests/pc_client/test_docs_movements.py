"""docs/movements.md is read and computed again: its tables of movements, of kinds, of k and of corners."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from pc_client.movements.description import describe, snr_of_delay
from pc_client.movements.generate import GENERATORS, uniform_twin
from pc_client.movements.library_sets import library_names
from pc_client.movements.lognormal import FULL_COVERAGE, Lognormal, sigma_for_k
from pc_client.movements.movement import load_movement
from pc_client.planning.plan import plan_movement

PAGE = (Path(__file__).parents[2] / "docs" / "movements.md").read_text(encoding="utf-8")
SENTENCES = " ".join(PAGE.split())


def rows(first_cell: str) -> list[list[str]]:
    """Cells of the rows whose first cell matches a pattern, without their marks."""
    lines = [line.replace("`", "").replace("**", "") for line in PAGE.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if re.fullmatch(first_cell, row[0])]


@pytest.mark.parametrize("name", library_names("paper") + library_names("arcs"))
def test_the_row_of_a_movement_is_what_it_is(name: str) -> None:
    (row,) = [row for row in rows(re.escape(name)) if len(row) == 11]
    movement = load_movement(name)
    figures, report = describe(movement), plan_movement(movement).report
    snr, vector = figures["expected_snr_db"], figures["expected_vector_snr_db"]
    wanted = [
        f"{movement.duration:.3f}",
        ", ".join(f"{duration:.3f}" for duration in movement.stroke_durations),
        f"{1e3 * figures['path_length_m']:.0f}",
        f"{figures['peak_speed_m_s']:.3f}",
        f"{figures['peak_acceleration_m_s2']:.2f}",
        f"{report.joint_speed.value:.2f}",
        f"{report.joint_acceleration.value:.1f}",
        f"{figures['speed_rms_frequency_rad_s']:.2f}",
        f"{snr['22 ms']:.1f}, {snr['35 ms']:.1f}",
        f"{vector['22 ms']:.1f}, {vector['35 ms']:.1f}",
    ]
    assert row[1:] == wanted


def test_the_table_of_kinds_is_that_of_the_generators() -> None:
    table = [row for row in rows("|".join(GENERATORS)) if len(row) == 5]
    assert [row[0] for row in table] == list(GENERATORS)
    for kind, _, targets, strokes, _ in table:
        assert targets == ("yes" if GENERATORS[kind].same_targets else "no: only the first")
        assert strokes == ("yes" if GENERATORS[kind].same_strokes else "only the whole")


def test_k_decides_skewness_and_kurtosis() -> None:
    table = [row for row in rows(r"[\d/]+") if len(row) == 6 and row[1] != "k"]
    assert [row[1] for row in table] == ["2", "3/2", "4/3", "6/5", "12/11"]
    for lead, k, *figures in table:
        lead_in_windows = 0.5 if lead == "1/2" else float(lead)
        ratio = (lead_in_windows + 1.0) / (lead_in_windows + 0.5)
        top, _, bottom = k.partition("/")
        assert ratio == pytest.approx(float(top) / float(bottom or 1))
        sigma = sigma_for_k(ratio)
        lognormal = Lognormal(0.0, math.log(0.1 * (1.0 + lead_in_windows)) - FULL_COVERAGE * sigma, sigma)
        for printed, value in zip(
            figures, (sigma, lognormal.skewness, lognormal.kurtosis, lognormal.mu), strict=True
        ):
            assert float(printed) == pytest.approx(value, abs=0.51 * 10.0 ** -len(printed.partition(".")[2]))


@pytest.mark.parametrize(
    ("label", "setback"), [("stop", 0.0), ("blend, setback 30 mm", 0.03), ("blend, setback 10 mm", 0.01)]
)
def test_what_corners_cost(label: str, setback: float) -> None:
    ((_, acceleration, joint, missed, snr),) = rows(label)
    twins = [
        uniform_twin(load_movement(name), "twin", "blend" if setback else "stop", setback)
        for name in library_names("paper")[5:]
    ]
    assert float(acceleration.split()[0]) == pytest.approx(
        max(describe(m)["peak_acceleration_m_s2"] for m in twins), rel=0.02
    )
    assert float(joint.split()[0]) == pytest.approx(
        max(plan_movement(m).report.joint_acceleration.value for m in twins), rel=0.02
    )
    off = [
        np.linalg.norm(m.sample(np.cumsum(m.stroke_durations)[:-1]).p - m.target_points[1:-1], axis=1).max()
        for m in twins
    ]
    assert float(missed.split()[0]) == pytest.approx(1e3 * max(off), abs=0.51)
    for printed, delay in zip(snr.removesuffix(" dB").split(", "), (0.022, 0.035), strict=True):
        assert float(printed) == pytest.approx(np.mean([snr_of_delay(m, delay) for m in twins]), abs=0.051)


def test_what_the_page_says_of_the_strokes_in_the_hands_time() -> None:
    mu, strokes, gaps = [], [], []
    for name in library_names("paper")[5:]:
        movement = load_movement(name)
        stretch = float(movement.provenance["time_stretch"])
        mu += [stroke["mu"] - math.log(stretch) for stroke in describe(movement)["strokes"]]
        strokes += (movement.stroke_durations / stretch).tolist()
        gaps += (movement.trajectory.speed_minima() - np.cumsum(movement.stroke_durations)[:-1]).tolist()
    assert f"mu does: {min(mu):.2f} to {max(mu):.2f} in the hand's time" in SENTENCES
    assert f"at random: {min(strokes):.3f} to {max(strokes):.3f} s".replace("0.", ".") in SENTENCES
    assert (
        f"{min(strokes) / 2:.3f} to {max(strokes) / 2:.3f} s after its start".replace("0.", ".") in SENTENCES
    )
    assert f"{min(gaps):.1f} to {max(gaps):.2f} s on the robot".replace("0.", ".") in SENTENCES
