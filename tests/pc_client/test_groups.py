"""Intervals and tests on values whose answer is known, and which runs are one unit, a pair, or a group."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
import pytest
from recording_samples import provenance, record_movement
from scipy.special import stdtrit

import pc_client as ur
from pc_client.analysis.inference import mean_interval, paired_difference
from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.table import PAPER_SNR_DB, papers_finding
from pc_client.errors import ClientError
from pc_client.recording.recording import load_recording


class Level(MeasuredRun):
    """A run of which nothing is known but whose it is and its level."""

    def __init__(self, level, **whose):
        object.__setattr__(self, "whose", provenance(**whose))
        object.__setattr__(self, "level", float(level))

    @property
    def provenance(self):
        return self.whose

    @property
    def figures(self):
        return {"name": "", "n_targets": 2, "snr_db": self.level}


@pytest.mark.nightly
@pytest.mark.parametrize(("n", "share"), [(5, 0.81), (10, 0.93)])
def test_the_interval_holds_the_mean_as_often_as_is_said(n, share):
    random = np.random.default_rng(1)
    found = [mean_interval(random.normal(size=n)) for _ in range(400)]
    assert np.mean([one.low < 0.0 < one.high for one in found]) == pytest.approx(share, abs=0.05)


def test_an_interval_lies_about_the_mean_and_few_or_endless_values_have_none():
    found = mean_interval([30.0, 32.0, 31.0, 33.0, 34.0])
    assert (found.mean, found.spread) == (32.0, pytest.approx(math.sqrt(2.5)))
    assert 30.0 < found.low < 31.5 < 32.5 < found.high < 34.0
    assert mean_interval([30.0, 32.0, 31.0, 33.0, 34.0]) == found  # the same draws each time
    assert math.isnan(mean_interval([30.0, 32.0]).low)
    assert math.isnan(mean_interval([30.0, 32.0, math.inf]).low)
    assert mean_interval([2.0, 2.0, 2.0]).high == 2.0


def test_p_counts_the_signs_that_give_as_much():
    base = np.array([20.0, 22.0, 25.0, 21.0, 23.0])
    all_up = paired_difference(base + np.arange(1.0, 6.0), base)
    assert (all_up.mean, all_up.n_pairs, all_up.p) == (3.0, 5, 2 / 2**5)
    assert 1.0 < all_up.low < all_up.high < 5.0
    assert paired_difference(base + np.array([1, -1, 2, -2, 0]), base).p == 1.0
    assert math.isnan(paired_difference([1.0, 2.0], [0.0, 0.0]).p)


def test_the_papers_values_show_no_difference():
    """Welch's interval by hand: both means, the error of their difference, its degrees of freedom."""
    values = np.array([*PAPER_SNR_DB.values()])
    a, b = values[5:], values[:5]
    errors = np.array([np.var(x, ddof=1) / 5 for x in (a, b)])
    df = errors.sum() ** 2 / np.sum(errors**2 / 4)
    half = stdtrit(df, 0.975) * math.sqrt(errors.sum())
    lead = a.mean() - b.mean()
    assert f"{lead:.1f} dB (95 %: {lead - half:.1f} to {lead + half:.1f} dB, Welch)" in papers_finding()
    assert "do not show a difference" in papers_finding()
    assert lead - half < 0.0 < lead + half


def of_movements(level, *, kind="lognormal", n=4, seeds=(7,), **whose):
    """Runs of n movements, three of each on each arm; they differ by their numbers, arms by their seeds."""
    return [
        Level(
            level + k + 0.1 * seed + 0.02 * repetition,
            **{"movement": f"{kind}_{k}", "kind": kind, "target_points": ((0.1 * k, 0.0, 0.0),), **whose},
            repetition=repetition,
            seed=seed,
            serial=str(seed),
        )
        for k in range(n)
        for seed in seeds
        for repetition in (1, 2, 3)
    ]


SEEDS = range(6)


@pytest.mark.parametrize(
    ("first", "second", "unit", "n"),
    [
        (of_movements(30), of_movements(20, controller="paper"), "movement", 4),
        (of_movements(30), of_movements(20, kind="uniform"), "target points", 4),
        (of_movements(30, n=1, seeds=SEEDS), of_movements(20, n=1, seeds=SEEDS), "arm", 6),
        (of_movements(30, seeds=(1, 2)), of_movements(20, seeds=(1, 2)), "movement", 4),
        (of_movements(30, n=5), of_movements(20, n=4), "movement", 4),
    ],
    ids=["controllers", "kinds", "seeds of one movement", "more movements than seeds", "one is missing"],
)
def test_repetitions_are_no_units_and_pairs_are_what_belongs_together(first, second, unit, n):
    groups = ur.compare({"first": first, "second": second})
    a, b, pair = groups.frame.to_dicts()
    assert (a["n"], a["mean"]) == (
        len(first) // 3 // (2 if len(first) == 24 else 1),
        pytest.approx(np.mean([run.level for run in first])),
    )
    assert (pair["group"], pair["minus"], pair["unit"], pair["n"]) == ("first", "second", unit, n)
    assert [pair[x] for x in ("mean", "low", "high")] == pytest.approx([10.0] * 3)
    assert pair["p"] == pytest.approx(2 / 2**n)
    assert b["spread"] == pytest.approx(np.std([k if unit != "arm" else 0.1 * k for k in range(n)], ddof=1))


def test_what_shares_nothing_is_not_paired():
    """Other movements on other arms; those without target points share none."""
    first, second = (
        of_movements(30, target_points=()),
        of_movements(20, n=1, movement="x", seeds=(8,), target_points=()),
    )
    (*_, pair) = ur.compare({"a": first, "b": second}).frame.to_dicts()
    assert (pair["n"], pair["mean"], pair["p"]) == (0, None, None)


def test_two_perfect_arms_differ_by_nothing_that_is_known():
    (*_, pair) = ur.compare(
        {"a": of_movements(math.inf), "b": of_movements(math.inf, controller="paper")}
    ).frame.to_dicts()
    assert (pair["n"], pair["mean"], pair["p"]) == (4, None, None)


@pytest.mark.parametrize(
    ("second", "labels"),
    [
        ({"controller": "paper"}, ["preview", "paper"]),
        ({"kind": "uniform"}, ["lognormal", "uniform"]),
        ({"robot_model": "UR5", "controller": "paper"}, ["preview, UR3 3.15.8", "paper, UR5 3.15.8"]),
        ({"seeds": (8,)}, ["7", "8"]),
        ({}, ["preview"]),
    ],
)
def test_a_sequence_is_grouped_by_what_differs(second, labels):
    frame = ur.compare(of_movements(30) + of_movements(20, **second)).frame
    assert frame.filter(frame["minus"].is_null())["group"].to_list() == labels


def test_csv_has_all_digits_and_latex_is_a_tabular():
    groups = ur.compare({"50 % & more": of_movements(30), "a_b": of_movements(20)})
    rows = list(csv.DictReader(io.StringIO(groups.to_csv())))
    assert [row["group"] for row in rows] == ["50 % & more", "a_b", "50 % & more"]
    assert float(rows[0]["low"]) == groups.frame["low"][0]
    lines = groups.to_latex().splitlines()
    assert lines[0] == r"\begin{tabular}{lllrrrrrr}"
    assert lines[4].startswith(r"50 \% \& more &  & movement & 4 & 32.24 & 1.29 & ")
    assert lines[5].startswith(r"a\_b &")
    assert {line.count(" & ") for line in lines if line.endswith(r"\\")} == {8}


def test_files_and_folders_stand_for_their_runs(tmp_path):
    for k, folder in ((1, "slow"), (2, "quick")):
        (tmp_path / folder).mkdir()
        record_movement(tmp_path / folder / "a_r1.mcap", lag=0.01 * k, prov=provenance(target_points=()))
    groups = ur.compare({"slow": tmp_path / "slow", "quick": [str(tmp_path / "quick" / "a_r1.mcap")]})
    level, *_ = groups.frame["mean"]
    assert level == analyse_run(load_recording(tmp_path / "slow" / "a_r1.mcap")).snr.speed_db
    assert groups.frame["n"].to_list() == [1, 1, 1]
    with pytest.raises(ClientError, match='figure "name" is none of snr_db'):
        ur.compare(of_movements(1), "name")
    with pytest.raises(ClientError, match="no run to compare"):
        ur.compare({"empty": tmp_path})


def test_an_arm_that_repeated_more_often_weighs_no_more():
    often, once = of_movements(30, seeds=(1,)), of_movements(20, seeds=(2,))[::3]
    (group,) = ur.compare({"both": often + once}).frame.to_dicts()
    assert group["mean"] == pytest.approx(
        np.mean([np.mean([r.level for r in runs]) for runs in (often, once)])
    )
