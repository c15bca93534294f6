"""docs/theory.md and docs/movements.md are read and computed again: tables and figures in sentences, to the printed digit."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import erf, ndtr

from pc_client.movements.description import describe, outline, snr_of_delay
from pc_client.movements.durations import ISOCHRONY, Fitts, Isochrony
from pc_client.movements.generate import GENERATORS, uniform_twin
from pc_client.movements.library_sets import library_names
from pc_client.movements.lognormal import (
    FULL_COVERAGE,
    LiteralTiming,
    Lognormal,
    TwoSidedTiming,
    lead_from_k,
    sigma_for_k,
)
from pc_client.movements.minimum_jerk import stroke_shape
from pc_client.movements.movement import load_movement
from pc_client.movements.power_law import TORSION_EXPONENT, TWO_THIRDS
from pc_client.movements.recipes import HAND_STROKE
from pc_client.movements.sigma_lognormal import LEAD, SigmaLognormal, Stroke, sinc
from pc_client.movements.uniform import SmoothedSquareWave
from pc_client.movements.variability import HUMAN_STROKE, PUBLISHED
from pc_client.planning.plan import plan_movement
from pc_client.studies.comparison import COLUMNS, EXECUTED_COLUMNS, build_comparison, make_sets
from pc_client.studies.likeness import log_dimensionless_jerk, sparc, speed_peaks

PAGE = (Path(__file__).parents[2] / "docs" / "theory.md").read_text(encoding="utf-8")
SENTENCES = " ".join(PAGE.split())


def table(first_heading: str, second_heading: str = "") -> list[list[str]]:
    """The cells of the one table of docs/theory.md that begins with these headings."""
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
    assert lead_from_k(timing.k, 1.0) == pytest.approx(float(cells[0]), abs=1e-13)
    assert lognormal.mode == pytest.approx(0.5, abs=1e-12)
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
        lognormal.mode,
        lognormal.peak,
        three.lognormal.mode,
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


STROKE = np.linspace(0.0, 1.0, 1001)


def trapezoid(up: float, down: float) -> NDArray[np.float64]:
    return np.clip(np.minimum(STROKE / up, (1.0 - STROKE) / down), 0.0, 1.0) / (1.0 - 0.5 * (up + down))


def two_boxcars() -> NDArray[np.float64]:
    """As the figure of the page was made: a square of .8 s and two boxcars of .1 s, sampled with both ends."""
    boxcar = np.ones(101) / 101
    wave = np.convolve(np.convolve(np.ones(801), boxcar), boxcar)
    return wave / (wave.sum() / 1000.0)


def lognormal_profile(timing: LiteralTiming | TwoSidedTiming) -> NDArray[np.float64]:
    return timing.lognormal.evaluate(STROKE).rate


PROFILES = {
    "minimum jerk": stroke_shape(STROKE).rate,
    "lognormal, literal, lead 0": lognormal_profile(LiteralTiming(0.0, 1.0, 0.0)),
    "lognormal, two-sided, sigma .0426": lognormal_profile(TwoSidedTiming(0.0, 1.0, 0.0426)),
    "lognormal, two-sided, sigma .1": lognormal_profile(TwoSidedTiming(0.0, 1.0, 0.1)),
    "lognormal, two-sided c = 3, sigma .25": lognormal_profile(TwoSidedTiming(0.0, 1.0, 0.25, 3.0)),
    "trapezoid, ramps .2 and .2 s": trapezoid(0.2, 0.2),
    "trapezoid, ramps .1 and .1 s": trapezoid(0.1, 0.1),
    "trapezoid, ramps .05 and .05 s": trapezoid(0.05, 0.05),
    "trapezoid, ramps .15 and .25 s": trapezoid(0.15, 0.25),
    "square wave, two boxcars of 101 samples": two_boxcars(),
}


@pytest.mark.parametrize("cells", table("profile"), ids=lambda cells: cells[0])
def test_smoothness_of_strokes_of_one_second(cells: list[str]) -> None:
    speed = PROFILES[cells[0]]
    figures = (float(speed.max()), sparc(speed, 1000.0), log_dimensionless_jerk(speed, 1000.0))
    for value, text in zip(figures, cells[1:], strict=True):
        assert_printed(value, text)
    assert speed_peaks(speed) == 1


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
            (case, "share of D at the top speed"): float(lognormal.evaluate(lognormal.mode).done),
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
    ("b of .1 to .5; both sets of the library draw with {.3}", [ISOCHRONY]),
    (
        "a stroke of .1 s has a mu, {-1.89}, within the -2.2 to -1.6 of hands",
        [LiteralTiming(0.0, HAND_STROKE, LEAD * HAND_STROKE).lognormal.mu],
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
    # the page says: SNR within 3.1 dB for all, and the number of peaks that was planned
    executed = [row for row in cells if row[1] == "executed"]
    snr = [float(row[9]) for row in executed]
    assert "SNR values lie within 3.1 dB" in SENTENCES
    assert max(snr) - min(snr) == pytest.approx(3.1, abs=0.01)
    for plan, done in zip(wanted[1::2], executed, strict=True):
        assert plan[4] == done[4]
        assert float(plan[2]) == pytest.approx(float(done[2]), abs=0.055)
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


MOVEMENTS_PAGE = (Path(__file__).parents[2] / "docs" / "movements.md").read_text(encoding="utf-8")
SAID_OF_MOVEMENTS = " ".join(MOVEMENTS_PAGE.split())


def rows(first_cell: str) -> list[list[str]]:
    """Cells of the rows of docs/movements.md whose first cell matches a pattern, without their marks."""
    lines = [
        line.replace("`", "").replace("**", "")
        for line in MOVEMENTS_PAGE.splitlines()
        if line.startswith("|")
    ]
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
        f"{snr['20 ms']:.1f}, {snr['28 ms']:.1f}",
        f"{vector['20 ms']:.1f}, {vector['28 ms']:.1f}",
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
        max(outline(m)["peak_acceleration_m_s2"] for m in twins), rel=0.02
    )
    assert float(joint.split()[0]) == pytest.approx(
        max(plan_movement(m).report.joint_acceleration.value for m in twins), rel=0.02
    )
    off = [
        np.linalg.norm(m.sample(np.cumsum(m.stroke_durations)[:-1]).p - m.target_points[1:-1], axis=1).max()
        for m in twins
    ]
    assert float(missed.split()[0]) == pytest.approx(1e3 * max(off), abs=0.51)
    for printed, delay in zip(snr.removesuffix(" dB").split(", "), (0.020, 0.028), strict=True):
        assert float(printed) == pytest.approx(np.mean([snr_of_delay(m, delay) for m in twins]), abs=0.051)


def test_what_the_page_says_of_the_strokes_in_the_hands_time() -> None:
    mu, strokes, gaps = [], [], []
    for name in library_names("paper")[5:]:
        movement = load_movement(name)
        stretch = float(movement.provenance["time_stretch"])
        mu += [stroke["mu"] - math.log(stretch) for stroke in describe(movement)["strokes"]]
        strokes += (movement.stroke_durations / stretch).tolist()
        gaps += (movement.trajectory.speed_minima() - np.cumsum(movement.stroke_durations)[:-1]).tolist()
    assert f"mu does: {min(mu):.2f} to {max(mu):.2f} in the hand's time" in SAID_OF_MOVEMENTS
    assert f"at random: {min(strokes):.3f} to {max(strokes):.3f} s".replace("0.", ".") in SAID_OF_MOVEMENTS
    assert (
        f"{min(strokes) / 2:.3f} to {max(strokes) / 2:.3f} s after its start".replace("0.", ".")
        in SAID_OF_MOVEMENTS
    )
    assert f"{min(gaps):.1f} to {max(gaps):.2f} s on the robot".replace("0.", ".") in SAID_OF_MOVEMENTS
