"""The comparison of generators: sets, filter, figures of signals, the table, and the command on a robot in memory."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

import pc_client.studies.comparison as comparison
from pc_client import cli
from pc_client.errors import ClientError
from pc_client.movements.generate import GENERATORS
from pc_client.movements.movement import load_movement
from pc_client.results.figures import svg_text
from pc_client.studies.comparison import (
    COLUMNS,
    CUTOFF_HZ,
    EXECUTED_COLUMNS,
    Comparison,
    build_comparison,
    comparison_figure,
    executed_signal,
    filtered,
    filtered_signal,
    make_sets,
    measured,
    planned_signal,
    save_sets,
)

RATE = 125.0


@pytest.fixture(scope="module")
def sets():
    return make_sets(4, 1, 2)


@pytest.fixture(scope="module")
def table(sets):
    return build_comparison(sets)


def test_sets_have_every_generator_on_the_same_points(sets):
    assert len(sets) == 2
    for seed, one in enumerate(sets, start=1):
        assert list(one) == list(GENERATORS)
        human = one["lognormal"]
        for kind, movement in one.items():
            assert movement.name == f"{kind}_4_seed{seed}"
            assert movement.duration == pytest.approx(human.duration, abs=1e-9)
            if GENERATORS[kind].same_targets:
                np.testing.assert_array_equal(movement.target_points, human.target_points)
    assert not np.allclose(sets[0]["uniform"].target_points, sets[1]["uniform"].target_points)


def test_the_first_seed_is_the_first_pair_of_the_library(sets):
    np.testing.assert_array_equal(
        sets[0]["uniform"].trajectory.evaluate(1.0).p,
        load_movement("uniform_4_1").trajectory.evaluate(1.0).p,
    )


def test_saved_sets_can_be_run_one_by_one(sets, tmp_path):
    save_sets(sets, tmp_path / "movements")
    assert len(list((tmp_path / "movements").glob("*.toml"))) == 2 * len(GENERATORS)
    assert load_movement(tmp_path / "movements" / "power_law_4_seed2.toml").kind == "power_law"
    with pytest.raises(ClientError, match="at least one"):
        make_sets(4, 1, 0)
    (tmp_path / "file").write_text("")
    with pytest.raises(ClientError, match="cannot use the folder"):
        save_sets(sets, tmp_path / "file" / "movements")


def wave(frequency, t):
    """Swings that begin and end at rest."""
    return np.sin(2 * math.pi * frequency * t) * np.exp(-((t - 10.0) ** 2) / 12.0)


@pytest.mark.parametrize(("frequency", "gain"), [(0.5, 1.0), (CUTOFF_HZ, 0.5), (25.0, 0.0)])
def test_filter_passes_movements_halves_at_its_cutoff_and_shifts_nothing(frequency, gain):
    t = np.arange(2500) / RATE
    swing = np.outer(wave(frequency, t), [1.0, -2.0, 0.5])
    start = np.array([0.3, 0.1, 0.2])
    np.testing.assert_allclose(filtered(t, start + swing).p - start, gain * swing, atol=0.02)


def test_noise_leaves_little_jerk_behind_the_filter():
    """5 micrometres on each axis, on a straight movement at .1 m/s: without the filter it would be 10 m/s^3 and more."""
    t = np.arange(1000) / RATE
    noise = 5e-6 * np.random.default_rng(1).standard_normal((1000, 3))
    motion = filtered(t, np.outer(0.1 * t, [1.0, 0.0, 0.0]) + noise)
    speed = np.linalg.norm(motion.v, axis=1)[200:-200]
    assert np.sqrt(np.mean(np.square(np.diff(speed, 2) * RATE**2))) < 0.05
    raw = np.linalg.norm(np.diff(np.outer(0.1 * t, [1.0, 0.0, 0.0]) + noise, axis=0), axis=1) * RATE
    assert np.sqrt(np.mean(np.square(np.diff(raw, 2) * RATE**2))) > 10.0


def test_filtered_plan_is_the_plan_but_for_corners(sets):
    """Lognormals survive the filter; the square ramps of a trapezoid lose their jerk."""
    human = sets[0]["lognormal"]
    plan, smooth = planned_signal(human), filtered_signal(human)
    assert smooth.t[0] == 0.0
    assert len(smooth.t) == math.floor(human.duration * RATE + 1e-9) + 1
    np.testing.assert_allclose(smooth.speed, np.interp(smooth.t, plan.t, plan.speed), atol=2e-3)
    lognormal, trapezoid = (
        [measured(signal)["log_jerk"] for signal in (planned_signal(m), filtered_signal(m))]
        for m in (human, sets[0]["uniform"])
    )
    assert lognormal[0] == pytest.approx(lognormal[1], abs=0.05)
    assert trapezoid[1] - trapezoid[0] > 0.3


def test_means_of_the_power_law_leave_out_those_without():
    with_law = (-2.0, -9.0, 3.0, 0.3, 0.9, 0.2, 0.5)
    without = (-3.0, -11.0, 4.0, math.nan, math.nan, 0.4, 0.7)
    names = [column.name for column in (*COLUMNS, *EXECUTED_COLUMNS)]
    rows = [
        dict(zip(names, (name, "planned", *figures, None, None), strict=True))
        for name, figures in (("both", with_law), ("both", without), ("straight", without))
    ]
    both, straight = Comparison(pl.DataFrame(rows), 3, None).means.to_dicts()
    assert [both[name] for name in names[2:9]] == pytest.approx([-2.5, -10.0, 3.5, 0.3, 0.9, 0.3, 0.6])
    assert math.isnan(straight["exponent"])


def test_the_table_has_the_figures_that_the_models_imply(table):
    """One speed peak a stroke, exponents of a third where the law imposes it, none on straight lines."""
    means = {row["generator"]: row for row in table.means.filter(signal="planned").to_dicts()}
    for kind in ("lognormal", "arcs", "isochronous", "fitts", "minimum_jerk", "uniform"):
        assert means[kind]["peaks"] == 3.0
    assert means["uniform_blend"]["peaks"] < 3.0
    assert means["power_law"]["exponent"] == pytest.approx(1 / 3, abs=0.02)  # R is 1 m
    assert means["power_law"]["r_squared"] > 0.99
    for kind in ("lognormal", "minimum_jerk", "uniform"):
        assert math.isnan(means[kind]["exponent"])
    # the robot's profile is the least smooth by its jerk, the movement of least jerk through the points the smoothest
    jerk = {kind: figures["log_jerk"] for kind, figures in means.items()}
    assert max(jerk, key=jerk.get) == "minimum_jerk_via"
    assert sorted(jerk, key=jerk.get)[:2] == ["uniform", "uniform_blend"]
    # and it needs the lowest top speed for the same length in the same time
    assert min(means, key=lambda kind: means[kind]["peak_speed"]) == "uniform_blend"


def test_table_in_three_forms(table):
    data = table.to_json()
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert data["robot"] is None
    assert len(data["rows"]) == 2 * len(GENERATORS)
    assert data["means"]["uniform"]["planned"]["exponent"] is None
    assert set(data["means"]["uniform"]) == {"planned", "filtered", "snr_db", "shifted_snr_db"}
    lines = table.to_markdown().splitlines()
    assert lines[0].endswith("3 strokes each, means over 2 sets of target points: planned only")
    rows = [line for line in lines if line.startswith("|")]
    assert len(rows) == 2 + 2 * len(GENERATORS)
    assert {line.count("|") for line in rows} == {len(COLUMNS) + 1}
    assert len(table.to_rich().columns) == len(COLUMNS)


def test_a_perfect_run_is_the_filtered_plan_wherever_its_frames_fall_in_a_cycle():
    movement = load_movement("uniform_4_1")
    t = (np.arange(-60, round(movement.duration * RATE) + 60) + 0.5) / RATE
    track = SimpleNamespace(t=4711.0 + t, t_begin=4711.0, p_actual=movement.sample(t).p)
    run = SimpleNamespace(
        track=track,
        snr=SimpleNamespace(speed_lag_s=0.0),
    )
    done, wanted = executed_signal(run, movement.duration), filtered_signal(movement)
    np.testing.assert_allclose(done.p, wanted.p, atol=2e-6)


def test_page_shows_every_generator(sets):
    root = ET.fromstring(svg_text(comparison_figure(sets[0])))
    assert root.tag.endswith("svg")
    panels = [node for node in root.iter() if (node.get("id") or "").startswith("axes_")]
    assert len(panels) == 2 * len(GENERATORS)


def test_command_executes_measures_and_writes(robot, tmp_path, capsys, monkeypatch):
    few = {kind: GENERATORS[kind] for kind in ("lognormal", "uniform")}
    monkeypatch.setattr(comparison, "GENERATORS", few)
    out = tmp_path / "out"
    arguments = ["compare", "--robot", "127.0.0.1", "--out", str(out), "--targets", "2", "--seed", "5"]
    assert cli.run(arguments) == 0
    assert len(list(out.glob("*.mcap"))) == len(list((out / "movements").glob("*.toml"))) == len(few)
    assert "compare.svg" in capsys.readouterr().out
    data = json.loads((out / "compare.json").read_text())
    assert data["robot"] == "SIMULATED UR3 3.15.8, seed 7, controller preview"
    for row in data["rows"]:
        # a robot in memory that is late and does nothing else wrong is as human as its plan
        assert row["snr_db"] > 15.0
        assert row["executed"]["sparc"] == pytest.approx(row["filtered"]["sparc"], abs=0.02)
        assert row["executed"]["peaks"] == row["filtered"]["peaks"] == 1.0
        assert row["executed"]["peak_speed"] == pytest.approx(row["filtered"]["peak_speed"], rel=0.02)
        assert row["executed"]["log_jerk"] == pytest.approx(row["filtered"]["log_jerk"], abs=0.4)
    markdown = (out / "compare.md").read_text()
    assert markdown.count("executed |") == len(few)
    assert all(column.heading in markdown for column in (*COLUMNS, *EXECUTED_COLUMNS))
    assert (out / "compare.svg").stat().st_size > 10_000


def test_command_without_a_robot_plans_only(tmp_path, capsys):
    assert cli.run(["compare", "--out", str(tmp_path / "out"), "--targets", "3"]) == 0
    assert "planned only" in capsys.readouterr().out
    assert not list((tmp_path / "out").glob("*.mcap"))


def test_a_movement_without_a_recording_is_named(sets):
    another = SimpleNamespace(provenance=SimpleNamespace(arm="UR3", controller="preview"))
    with pytest.raises(ClientError, match="no recording of lognormal_4_seed1"):
        build_comparison(sets[:1], {"another": another})
