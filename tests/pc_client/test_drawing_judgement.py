"""Runs mapped back: a perfect arm gives the plan itself, a delay and an offset are found and named."""

from __future__ import annotations

import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drawing_samples import two_parts_and_a_dot
from page_support import check_needs_nothing
from recording_samples import provenance

from pc_client.errors import RecordingError
from pc_client.kinematics.model import robot_model
from pc_client.results.figures import svg_text
from pc_client.results.tables import cells
from pc_client.studies.drawing.drawing import make_drawing
from pc_client.studies.drawing.figures import FIGURES, Shown, figures_of
from pc_client.studies.drawing.judgement import executed, judge, signals
from pc_client.studies.drawing.placement import PlacementOptions
from pc_client.studies.drawing.table import (
    COLUMNS,
    Entry,
    drawings_json,
    drawings_markdown,
    render_page,
    table_of,
)

CYCLE = 0.008


@pytest.fixture(scope="module")
def drawing():
    options = PlacementOptions(rotation=0.3, plane="inclined", size=0.12)
    return make_drawing(two_parts_and_a_dot(), "sample", robot_model("ur3"), options)


def run_of(drawing, late=0.0, offset=(0.0, 0.0, 0.0), cut=0.0):
    """A run whose clock began long ago; its movement phase begins half a cycle into the movement."""
    ref_t = np.arange(-25, round((drawing.movement.duration - cut + 0.2) / CYCLE)) * CYCLE + 0.5 * CYCLE
    moving = np.flatnonzero((ref_t >= 0.0) & (ref_t <= drawing.movement.duration))
    track = SimpleNamespace(
        t=4711.0 + ref_t,
        t_begin=4711.0,
        rows=np.arange(len(ref_t)),
        movement=slice(int(moving[0]), int(moving[-1]) + 1),
        p_actual=drawing.movement.sample(ref_t - late).p + np.array(offset),
    )
    recording = SimpleNamespace(column={"ref_t": ref_t}.__getitem__, path=Path("x.mcap"))
    snr = SimpleNamespace(velocity_lag_s=late, speed_db=30.0)
    return SimpleNamespace(
        recording=recording, track=track, provenance=provenance(movement="sample"), snr=snr
    )


def test_a_perfect_arm_gives_the_plan_itself(drawing):
    execution = executed(drawing, run_of(drawing))
    for mark, part, own in zip((0, 1), execution.parts, drawing.extraction.parts, strict=True):
        assert own.t[0] <= part.frame_t[0] <= part.frame_t[-1] <= own.t[-1]
        step = CYCLE / drawing.factor
        np.testing.assert_allclose(np.diff(part.frame_t), step, atol=1e-9)
        assert len(part.frame_t) >= math.floor((own.t[-1] - own.t[0]) / step)
        np.testing.assert_allclose(part.frame_p, drawing.planned(part.frame_t, mark).p, atol=1e-8)
    whole = judge(drawing, [execution])
    verdict = whole.runs[0]
    assert verdict.planned.snr_v_db > 120.0
    assert verdict.planned.snr_t_db > 120.0
    assert verdict.max_error < 1e-9
    assert verdict.human.snr_v_db == pytest.approx(whole.plan.snr_v_db, abs=2.0)  # as near as the plan is
    assert verdict.human.snr_t_db == pytest.approx(whole.plan.snr_t_db, abs=2.0)


def test_times_map_back_exactly(drawing):
    t = np.linspace(-0.3, 2.0, 40)
    for mark in range(len(drawing.marks)):
        np.testing.assert_allclose(drawing.recording_time(drawing.arm_time(t, mark), mark), t, atol=1e-12)
    begins = [drawing.arm_time(np.array([mark.begin]), index)[0] for index, mark in enumerate(drawing.marks)]
    np.testing.assert_allclose(begins, drawing.factor * drawing.joined.pen_down[:, 0])


def test_the_plan_reconstructs_the_person_as_well_as_the_strokes_do(drawing):
    """The recording is what its strokes say, so all that is left are the tails of neighbours and lifts."""
    verdict = judge(drawing, [])
    assert verdict.plan.snr_v_db > 40.0
    assert verdict.plan.snr_t_db > 50.0
    assert verdict.human == verdict.reconstructed
    for human, planned in zip(signals(drawing)["human"], signals(drawing)["planned"], strict=True):
        np.testing.assert_allclose(planned.speed, human.speed, atol=0.02 * human.speed.max())


def test_a_delay_and_an_offset_count_until_they_are_named(drawing):
    perfect = judge(drawing, [executed(drawing, run_of(drawing))]).runs[0]
    offset = (0.001, 0.0, -0.002)
    moved = judge(drawing, [executed(drawing, run_of(drawing, offset=offset))]).runs[0]
    assert moved.planned.snr_v_db > 100.0  # an offset alone does not touch the velocity
    assert moved.planned.snr_t_db < 40.0
    verdict = judge(drawing, [executed(drawing, run_of(drawing, late=0.02, offset=offset))]).runs[0]
    assert verdict.planned.snr_v_db < 30.0
    assert verdict.planned.snr_t_db < 40.0
    assert verdict.planned_aligned.snr_v_db > 60.0
    assert verdict.planned_aligned.snr_t_db > 60.0
    assert verdict.offset == pytest.approx(math.hypot(0.001, 0.002), rel=1e-3)
    assert verdict.off_sheet == pytest.approx(0.003 * math.sqrt(0.5), rel=0.1)
    assert verdict.human_aligned.snr_v_db == pytest.approx(perfect.human.snr_v_db, abs=1.5)


def test_a_run_that_ended_early_is_refused(drawing):
    with pytest.raises(RecordingError, match="before the drawing was done"):
        executed(drawing, run_of(drawing, cut=1.0))


@pytest.fixture(scope="module")
def entry(drawing):
    executions = (executed(drawing, run_of(drawing, late=0.004)),)
    return Entry(drawing, executions, judge(drawing, executions))


def test_pictures_are_svg_and_the_same_each_time(entry):
    paths = figures_of(Shown(entry.drawing, entry.executions[0]))["paths"]
    text = svg_text(paths)
    assert ET.fromstring(text).tag.endswith("svg")
    assert "SIMULATED" in text
    assert svg_text(paths) == text


def test_what_is_drawn_lies_on_the_page_and_dots_are_drawn(entry):
    shown = Shown(entry.drawing, entry.executions[0])
    np.testing.assert_array_equal(entry.drawing.drawn[-1], [50.0, 95.0, 0.0])
    page = shown.on_page(entry.drawing.drawn)
    np.testing.assert_allclose(page.max(axis=0), -page.min(axis=0))  # in its middle
    assert np.ptp(page, axis=0).max() == pytest.approx(120.0)  # mm, as was asked
    top = shown.on_page(np.array([[50.0, 0.0, 0.0]]))[0]
    assert top[1] > page[:, 1].max()  # y of pixels points down: row 0 is above all that is drawn


def test_the_page_needs_no_network_and_holds_every_figure(entry):
    sheets = {"sample": figures_of(Shown(entry.drawing, entry.executions[0]))}
    page = render_page([entry], sheets)
    assert list(sheets["sample"]) == list(FIGURES)
    assert page.count('<img src="data:image/svg+xml') == len(FIGURES)
    check_needs_nothing(page)
    assert "SIMULATED" in page
    assert "seed 7" in page
    for row in cells(table_of(entry.verdict), COLUMNS):
        for cell in row:
            assert cell in page


def test_the_tables_agree(entry):
    written = json.loads(json.dumps(drawings_json([entry]), allow_nan=False))
    one = written["drawings"][0]
    assert written["simulated"] is True
    assert one["slower_than_the_hand"] == entry.drawing.factor
    assert one["runs"][0]["planned"]["snr_v_db"] == entry.verdict.runs[0].planned.snr_v_db
    markdown = drawings_markdown([entry])
    assert f"{entry.verdict.runs[0].human.snr_v_db:.2f}" in markdown
    assert f"{entry.drawing.factor:.3f} times" in markdown
    assert "- remark 1: a gap" in markdown
    twice = 2 * entry.executions
    assert "executed r1" in drawings_markdown([Entry(entry.drawing, twice, judge(entry.drawing, twice))])
