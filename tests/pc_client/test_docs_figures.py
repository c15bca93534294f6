"""What docs/theory.md and docs/movements.md say beside their generated figures: formulas, constants, kinds."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr
from typer.testing import CliRunner

from pc_client.cli import app
from pc_client.movements.description import describe
from pc_client.movements.durations import Isochrony
from pc_client.movements.generate import GENERATORS
from pc_client.movements.lognormal import LiteralTiming, Lognormal, TwoSidedTiming, lead_from_k
from pc_client.movements.movement import Movement
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS
from pc_client.studies.comparison import make_sets

DOCS = Path(__file__).parents[2] / "docs"
SENTENCES = " ".join((DOCS / "theory.md").read_text(encoding="utf-8").split())


def test_berios_letters_are_the_two_sided_window() -> None:
    for shape in (0.01, 0.1, 0.3):
        sigma = math.sqrt(-math.log(1.0 - shape))
        mu = 3.0 * sigma + math.log(0.7 / math.expm1(6.0 * sigma))
        lognormal = TwoSidedTiming(0.2, 0.7, sigma, 3.0).lognormal
        assert lognormal.mu == pytest.approx(mu, abs=1e-13)
        assert lognormal.t0 == pytest.approx(0.2 - math.exp(mu - 3.0 * sigma), abs=1e-13)


def test_inflections_of_the_page() -> None:
    """The formulas as they stand there, against the code: times, shares of D, and ratios of speeds."""
    s = 0.25
    lognormal = Lognormal(0.0, -1.6, s)
    root = s * math.sqrt(0.25 * s * s + 1.0)
    for sign, time, ratio in (
        (1.0, lognormal.inflections.before, 0.526450600870),
        (-1.0, lognormal.inflections.after, 0.677292380471),
    ):
        a = 1.5 * s * s + sign * root
        assert time == pytest.approx(math.exp(-1.6 - a), rel=1e-14)
        assert float(lognormal.evaluate(time).done) == pytest.approx(float(ndtr(-a / s)), abs=1e-14)
        found = float(lognormal.evaluate(time).rate) / lognormal.peak
        assert found == pytest.approx(ratio, abs=5e-13)
        assert found == pytest.approx(
            math.exp(-(s * s + sign * s * math.sqrt(s * s + 4.0) + 2.0) / 4.0), rel=1e-12
        )
        b = math.log(found)  # and back: how an extractor finds sigma
        assert -2.0 - 2.0 * b - 1.0 / (2.0 * b) == pytest.approx(s * s, rel=1e-11)


def textbook_error(d: float) -> float:
    """Of x = D / d (sin phi - sin theta_s) against the stable form, the worst over the stroke, in units of D."""
    done = np.linspace(0.01, 1.0, 500)
    stable = done * np.sinc(0.5 * d * done / math.pi) * np.cos(0.3 + 0.5 * d * done)
    textbook = (np.sin(0.3 + d * done) - math.sin(0.3)) / d
    return float(np.abs(textbook - stable).max())


def test_textbook_form_loses_digits() -> None:
    assert "at d = 1e-9 rad it is wrong in the eighth digit, at 1e-12 in the fifth" in SENTENCES
    assert 1e-9 < textbook_error(1e-9) < 2e-7
    assert 1e-6 < textbook_error(1e-12) < 2e-4
    assert textbook_error(1.2) < 1e-15


def test_exponents_of_the_page() -> None:
    assert "curvature^(-1/3)" in SENTENCES
    assert "`gamma = 1/6`" in SENTENCES
    assert (TWO_THIRDS, TORSION_EXPONENT) == (1.0 / 3.0, 1.0 / 6.0)
    assert "the pure case, b = 0" in SENTENCES
    assert Isochrony().exponent == 0.0
    made = make_sets(4, 1, 1)[0]["power_law"]
    assert "R is 1 m here" in SENTENCES
    assert made.trajectory.largest_radius == 1.0


def test_the_table_of_kinds_is_that_of_the_generators() -> None:
    lines = (DOCS / "movements.md").read_text(encoding="utf-8").replace("`", "").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    table = [row for row in cells if row[0] in GENERATORS and len(row) == 5]
    assert [row[0] for row in table] == list(GENERATORS)
    for kind, _, targets, strokes, _ in table:
        assert targets == ("yes" if GENERATORS[kind].same_targets else "no: only the first")
        assert strokes == ("yes" if GENERATORS[kind].same_strokes else "only the whole")


@pytest.mark.parametrize(
    ("lead", "k"), [(0.0, 2.0), (0.5, 3 / 2), (1.0, 4 / 3), (2.0, 6 / 5), (5.0, 12 / 11)]
)
def test_a_literal_window_has_its_top_speed_in_the_middle_and_k_tells_its_lead(lead: float, k: float) -> None:
    timing = LiteralTiming(0.0, 1.0, lead)
    assert timing.k == pytest.approx(k, rel=1e-14)
    assert lead_from_k(timing.k, 1.0) == pytest.approx(lead, abs=1e-13)
    assert timing.lognormal.mode == pytest.approx(0.5, abs=1e-12)


def test_every_source_of_the_theory_is_cited_and_every_citation_has_its_source() -> None:
    text, _, sources = (
        (DOCS / "theory.md").read_text(encoding="utf-8").replace("\\", "").partition("## 9. Sources")
    )
    cited = {
        int(n) for numbers in re.findall(r"(?<!\!)\[([\d, ]+)\](?!\()", text) for n in numbers.split(",")
    }
    assert cited == {int(n) for n in re.findall(r"^(\d+)\. ", sources, re.MULTILINE)}


def test_what_human_is_stands_where_people_choose_it() -> None:
    movement = Movement.through([[0.3, -0.1, 0.2], [0.35, 0.0, 0.25], [0.3, 0.1, 0.2]], style="human")
    sigmas = [stroke["sigma"] for stroke in describe(movement)["strokes"]]
    assert sigmas == pytest.approx([0.067] * 2, abs=5e-4)
    at = np.cumsum(movement.stroke_durations)[:1]
    assert movement.speed(at)[0] < 1e-3
    help_text = CliRunner().invoke(app, ["movements", "new", "--help"], env={"COLUMNS": "200"}).output
    shown = [
        Movement.through.__doc__,
        help_text,
        *((DOCS / page).read_text() for page in ("movements.md", "library.md")),
    ]
    for text in shown:
        words = " ".join(re.sub(r"[│|]", " ", text or "").split())
        assert "sigma .067" in words
        assert "at rest at each" in words
