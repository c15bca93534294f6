"""docs/theory.md is read and computed again: every table and every figure in its sentences, to the printed digit."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erf, ndtr
from test_likeness import REFERENCE

from pc_client.movements.durations import Fitts, Isochrony
from pc_client.movements.generate import GENERATORS
from pc_client.movements.lognormal import FULL_COVERAGE, LiteralTiming, Lognormal, TwoSidedTiming
from pc_client.movements.minimum_jerk import stroke_shape
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS
from pc_client.movements.recipes import ARC_RULES, HAND
from pc_client.movements.sigma_lognormal import LEAD, SigmaLognormal, Stroke, sinc
from pc_client.movements.uniform import SmoothedSquareWave
from pc_client.movements.variability import HUMAN_STROKE, PUBLISHED
from pc_client.studies.comparison import COLUMNS, EXECUTED_COLUMNS, build_comparison, make_sets

PAGE = (Path(__file__).parents[2] / "docs" / "theory.md").read_text(encoding="utf-8")
SENTENCES = " ".join(PAGE.split())


def table(first_heading: str, second_heading: str = "") -> list[list[str]]:
    """The cells of the one table on the page that begins with these headings."""
    found = re.findall(
        rf"^\| {re.escape(first_heading)} \| {re.escape(second_heading)}.*\n\|[-:| ]+\n((?:\|.*\n)+)",
        PAGE,
        re.MULTILINE,
    )
    assert len(found) == 1, first_heading
    return [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in found[0].splitlines()]


def assert_printed(value: float, text: str) -> None:
    """`value` is printed as `text`, whatever stands before the decimal point."""
    digits = len(text.partition(".")[2])
    assert abs(value - float(text)) <= 0.5000001 * 10.0**-digits, (value, text)


@pytest.mark.parametrize("cells", table("overlap"), ids=lambda cells: cells[0])
def test_overlaps(cells: list[str]) -> None:
    overlap = float(cells[0])
    corner = np.array([0.2, 0.0, 0.0])
    points = np.array([[0.0, 0.0, 0.0], corner, [0.2, 0.2, 0.0]])
    for sigma, miss, junction in zip((0.10, 0.25), cells[1:3], cells[3:5], strict=True):
        strokes = tuple(Stroke(TwoSidedTiming(start, 1.0, sigma)) for start in (0.0, 1.0 - overlap))
        movement = SigmaLognormal(points, strokes, 2.0 - overlap)
        motion = movement.evaluate(np.linspace(0.0, 2.0, 20_001))
        assert_printed(1e3 * float(np.linalg.norm(motion.p - corner, axis=1).min()), miss)
        least = np.linalg.norm(movement.evaluate(movement.speed_minima()).v)
        assert_printed(float(least / np.linalg.norm(motion.v, axis=1).max()), junction)


@pytest.mark.parametrize("cells", table("lead / T"), ids=lambda cells: cells[0])
def test_literal_windows(cells: list[str]) -> None:
    timing = LiteralTiming(0.0, 1.0, float(cells[0]))
    lognormal = timing.lognormal
    over, _, under = cells[1].partition("/")
    assert timing.k == pytest.approx(float(over) / float(under or 1), rel=1e-14)
    done = lognormal.evaluate([0.0, 1.0]).done
    figures = (
        lognormal.sigma,
        lognormal.mu,
        float(done[1] - done[0]),
        lognormal.time_at_deviation(-FULL_COVERAGE),
        lognormal.skewness,
        lognormal.kurtosis,
        lognormal.peak,
    )
    for value, text in zip(figures, cells[2:], strict=True):
        assert_printed(value, text)


@pytest.mark.parametrize("cells", table("sigma", "top at"), ids=lambda cells: cells[0])
def test_two_sided_windows(cells: list[str]) -> None:
    full, three = TwoSidedTiming(0.0, 1.0, float(cells[0])), TwoSidedTiming(0.0, 1.0, float(cells[0]), 3.0)
    lognormal = full.lognormal
    figures = (
        full.mode_fraction,
        lognormal.peak,
        three.mode_fraction,
        three.lognormal.peak,
        lognormal.skewness,
        lognormal.kurtosis,
    )
    for value, text in zip(figures, cells[1:], strict=True):
        assert_printed(value, text)


def test_berios_letters_are_the_two_sided_window() -> None:
    for shape in (0.01, 0.1, 0.3):
        sigma = math.sqrt(-math.log(1.0 - shape))
        mu = 3.0 * sigma + math.log(0.7 / math.expm1(6.0 * sigma))
        lognormal = TwoSidedTiming(0.2, 0.7, sigma, 3.0).lognormal
        assert lognormal.mu == pytest.approx(mu, abs=1e-13)
        assert lognormal.t0 == pytest.approx(0.2 - math.exp(mu - 3.0 * sigma), abs=1e-13)


PRINTED_NAMES = {
    "minimum jerk": "minimum jerk",
    "lognormal, literal, lead 0": "lognormal k=2",
    "lognormal, two-sided, sigma .0426": "two-sided .0426",
    "lognormal, two-sided, sigma .1": "two-sided .1",
    "lognormal, two-sided c = 3, sigma .25": "two-sided c=3 .25",
    "trapezoid, ramps .2 and .2 s": "trapezoid .2/.2",
    "trapezoid, ramps .1 and .1 s": "trapezoid .1/.1",
    "trapezoid, ramps .05 and .05 s": "trapezoid .05/.05",
    "trapezoid, ramps .15 and .25 s": "trapezoid .15/.25",
    "square wave, two boxcars of 101 samples": "two boxcars",
}


def test_smoothness_is_the_reference_table() -> None:
    """Whose figures test_likeness.py computes."""
    printed = {cells[0]: tuple(cells[1:]) for cells in table("profile")}
    assert printed == {name: REFERENCE[key][1:] for name, key in PRINTED_NAMES.items()}
    assert len(REFERENCE) == len(printed)


def test_ranges_of_variability() -> None:
    printed = {cells[0]: cells[1:3] for cells in table("parameter")}
    ranges = {
        "D": PUBLISHED.length,
        "t0": PUBLISHED.rhythm,
        "mu": PUBLISHED.pace,
        "sigma": PUBLISHED.sigma,
        "theta_s": PUBLISHED.theta_start,
        "theta_e": PUBLISHED.theta_end,
    }
    assert printed == {name: [f"{100 * low:g}", f"{100 * high:g}"] for name, (low, high) in ranges.items()}


def check_figures() -> dict[tuple[str, str], float]:
    a, b, d = Lognormal(0.0, -1.6, 0.25), Lognormal(0.1, -1.6, 0.25), Lognormal(0.5, -0.5, 0.3)
    c = LiteralTiming(0.0, 0.1, 0.0).lognormal
    figures = {("-", "1 - erf(3)"): 1.0 - float(erf(3.0))}
    for z, name in ((3.0, "3"), (FULL_COVERAGE, "3 sqrt 2")):
        figures["-", f"Phi({name}) - Phi(-{name})"] = float(ndtr(z) - ndtr(-z))
    for case, lognormal, length in (("A", a, 1.0), ("B", b, 0.2), ("C", c, 0.1), ("D", d, 0.3)):
        first, second = lognormal.inflections
        figures |= {
            (case, "time at z = -3"): lognormal.time_at_deviation(-3.0),
            (case, "time of the first inflection"): first,
            (case, "time of the top speed"): lognormal.mode,
            (case, "time of the second inflection"): second,
            (case, "time at z = 3"): lognormal.time_at_deviation(3.0),
            (case, "speed at the first inflection"): length * float(lognormal.evaluate(first).rate),
            (case, "top speed"): length * lognormal.peak,
            (case, "speed at the second inflection"): length * float(lognormal.evaluate(second).rate),
            (case, "share of D at the first inflection"): float(lognormal.evaluate(first).done),
            (case, "share of D at the top speed"): lognormal.done_at_mode,
            (case, "share of D at the second inflection"): float(lognormal.evaluate(second).done),
            (case, "mean"): lognormal.mean,
            (case, "median"): lognormal.median,
            (case, "std"): lognormal.std,
            (case, "skewness"): lognormal.skewness,
            (case, "kurtosis"): lognormal.kurtosis,
            (case, "power"): length**2 * lognormal.power,
            (case, "sigma"): lognormal.sigma,
            (case, "mu"): lognormal.mu,
            (case, "share of D in the window"): float(lognormal.evaluate(0.1).done),
        }
    end = 0.2 * float(sinc(0.6)) * np.array([math.cos(0.9), math.sin(0.9)])
    start, goal = (0.25, -0.1, 0.2), (0.35, 0.1, 0.3)
    return figures | {
        ("E", "end in the plane, x"): float(end[0]),
        ("E", "end in the plane, y"): float(end[1]),
        ("E", "chord in the plane"): float(np.hypot(*end)),
        ("E", "D / distance in space"): Stroke(b, arc_angle=0.9).length(start, goal) / math.dist(start, goal),
    }


@pytest.mark.parametrize("cells", table("case"), ids=lambda cells: f"{cells[0]} {cells[1]}")
def test_check_figures(cells: list[str]) -> None:
    assert_printed(check_figures()[cells[0], cells[1]], cells[2])


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


def rms_frequency() -> float:
    lognormal = TwoSidedTiming(0.0, 1.0, 0.1).lognormal
    values = lognormal.evaluate(np.linspace(0.0, 1.0, 20_001))
    return math.sqrt(float(values.rate_change @ values.rate_change) / float(values.rate @ values.rate))


def textbook_error(d: float) -> float:
    """Of x = D / d (sin phi - sin theta_s) against the stable form, the worst over the stroke, in units of D."""
    done = np.linspace(0.01, 1.0, 500)
    stable = done * np.sinc(0.5 * d * done / math.pi) * np.cos(0.3 + 0.5 * d * done)
    textbook = (np.sin(0.3 + d * done) - math.sin(0.3)) / d
    return float(np.abs(textbook - stable).max())


LOGNORMAL = TwoSidedTiming(0.0, 1.0, 0.1).lognormal
T = np.linspace(0.0, 1.0, 100_001)
TRAPEZOID = SmoothedSquareWave(np.array([[0.1, 0.9]]), np.array([1.25]), (0.2,))
HUMAN_PACE = [math.exp(-2.0 * change) for change in (0.395, -0.3775)]

# What stands in a sentence, and the figures in it, computed; each is compared to the digits printed there.
SAID: list[tuple[str, list[float]]] = [
    ("The missing part of D is `(1 - erf 3) / 2 = {1.1045e-5}`", [0.5 * (1.0 - float(erf(3.0)))]),
    ("{2.2e-5} of the length lie outside", [2.0 * float(ndtr(-FULL_COVERAGE))]),
    ("leaves {.27} % outside", [200.0 * float(ndtr(-3.0))]),
    ("a top speed of {3.51} L / T", [LOGNORMAL.peak]),
    ("an acceleration of {20.8} L / T^2", [float(np.abs(LOGNORMAL.evaluate(T).rate_change).max())]),
    (
        "are {.70} m/s and {4.2} m/s^2",
        [0.2 * LOGNORMAL.peak, 0.2 * float(np.abs(LOGNORMAL.evaluate(T).rate_change).max())],
    ),
    (
        "needs {2.8} times the top speed of a trapezoid",
        [LOGNORMAL.peak / float(TRAPEZOID.evaluate(T).v.max())],
    ),
    ("has `w = {6.26} / T`", [rms_frequency()]),
    ("16 ms cost a stroke of 1 s {20.0} dB", [-20.0 * math.log10(0.016 * rms_frequency())]),
    ("top speed {1.875} A / T at T / 2", [float(stroke_shape(0.5).rate)]),
    ("-ln 204.8 = {-5.32203}", [-math.log(204.8)]),
    ("b of .1 to .5; both sets of the library draw with {.3}", [HAND.isochrony]),
    ("both sets of the library draw with {.3}", [ARC_RULES.isochrony]),
    (
        "a stroke of .1 s has a mu, {-1.89}, within the -2.2 to -1.6 of hands",
        [LiteralTiming(0.0, HAND.stroke, LEAD * HAND.stroke).lognormal.mu],
    ),
    (
        "a lead of half a window gives {-2.29}, of two {-1.38}",
        [LiteralTiming(0.0, 0.1, lead).lognormal.mu for lead in (0.05, 0.2)],
    ),
    ("`fitts` takes a = {.1} s, b = {.15} s/bit", [Fitts().intercept, Fitts().slope]),
    ("W = {20} mm", [1e3 * Fitts().width]),
    ("whose strokes last {.15} s", [HUMAN_STROKE]),
    ("a factor of {.45} to {2.13} in time", HUMAN_PACE),
]


@pytest.mark.parametrize(("sentence", "figures"), SAID, ids=[sentence for sentence, _ in SAID])
def test_figures_in_sentences(sentence: str, figures: list[float]) -> None:
    printed = re.findall(r"\{(.*?)\}", sentence)
    assert sentence.replace("{", "").replace("}", "") in SENTENCES
    for value, text in zip(figures, printed, strict=True):
        mantissa, _, power = text.partition("e")
        assert_printed(value / 10.0 ** int(power or 0), mantissa)


def test_small_sigma_is_a_small_skewness_and_a_kurtosis_near_three() -> None:
    assert "up to sigma = .1 the skewness stays below .303 and the kurtosis below 3.17" in SENTENCES
    lognormals = [Lognormal(0.0, 0.0, sigma) for sigma in np.linspace(1e-3, 0.1, 50).tolist()]
    assert 0.301 < max(lognormal.skewness for lognormal in lognormals) < 0.303
    assert 3.16 < max(lognormal.kurtosis for lognormal in lognormals) < 3.17
    assert min(lognormal.skewness for lognormal in lognormals) > 0.0


def test_textbook_form_loses_digits() -> None:
    assert "at d = 1e-9 rad it is wrong in the eighth digit, at 1e-12 in the fifth" in SENTENCES
    assert 1e-9 < textbook_error(1e-9) < 2e-7
    assert 1e-6 < textbook_error(1e-12) < 2e-4
    assert textbook_error(1.2) < 1e-15


def test_moments_by_quadrature_of_the_lognormal() -> None:
    """The page's closed forms, against quadrature of Lambda alone, for a wide lognormal."""
    lognormal = Lognormal(0.0, 0.2, 0.4)
    mean = quad(lambda t: t * float(lognormal.evaluate(t).rate), 0.0, 60.0, limit=300, points=[1.0])[0]
    assert mean == pytest.approx(math.exp(0.2 + 0.08), rel=1e-9)
    power = quad(lambda t: float(lognormal.evaluate(t).rate) ** 2, 0.0, 60.0, limit=300, points=[1.0])[0]
    assert power == pytest.approx(math.exp(-0.2 + 0.04) / (0.8 * math.sqrt(math.pi)), rel=1e-9)


def test_exponents_of_the_page() -> None:
    assert "curvature^(-1/3)" in SENTENCES
    assert "`gamma = 1/6`" in SENTENCES
    assert (TWO_THIRDS, TORSION_EXPONENT) == (1.0 / 3.0, 1.0 / 6.0)
    assert "the pure case, b = 0" in SENTENCES
    assert Isochrony().exponent == 0.0
    made = make_sets(4, 1, 1)[0]["power_law"]
    assert "R is 1 m here" in SENTENCES
    assert made.trajectory.largest_radius == 1.0


def test_comparison_is_that_of_the_command() -> None:
    """Planned and filtered rows are computed again; the executed ones need a robot."""
    cells = table("generator")
    head = next(line for line in PAGE.splitlines() if line.startswith("| generator"))
    headings = [column.heading for column in (*COLUMNS, *EXECUTED_COLUMNS)]
    assert [cell.strip() for cell in head.strip("|").split("|")] == headings
    lines = build_comparison(make_sets(4, 1, 5)).to_markdown().splitlines()
    wanted = [[c.strip() for c in line[1:-1].split("|")] for line in lines if line.startswith("|")][2:]
    assert [row[:9] for row in cells if row[1] != "executed"] == wanted
    assert [row[1] for row in cells] == ["planned", "filtered", "executed"] * len(GENERATORS)
    # the page says: SNR within 3 dB for all, and the number of peaks that was planned
    executed = [row for row in cells if row[1] == "executed"]
    snr = [float(row[9]) for row in executed]
    assert max(snr) - min(snr) < 3.0
    for plan, done in zip(wanted[1::2], executed, strict=True):
        assert plan[4] == done[4]
        assert float(plan[2]) == pytest.approx(float(done[2]), abs=0.025)
    filtered = wanted[2 * list(GENERATORS).index("uniform") + 1]
    assert "shows .32 with an R² of .86" in SENTENCES
    assert_printed(float(filtered[5]), ".32")
    assert_printed(float(filtered[6]), ".86")
    straight = executed[list(GENERATORS).index("minimum_jerk")]
    assert f"shows {straight[5]} as executed, with an R² of {straight[6]}" in SENTENCES
    speeds = {row[0]: float(row[7]) for row in cells if row[1] == "planned"}
    assert max((k for k in GENERATORS if GENERATORS[k].same_targets), key=speeds.__getitem__) == "lognormal"
    assert "3.7 times that of its robot-like twin" in SENTENCES
    assert_printed(speeds["lognormal"] / speeds["uniform"], "3.7")
    assert "Arcs that overlap need .66 of it" in SENTENCES
    assert_printed(speeds["arcs"] / speeds["lognormal"], ".66")
