"""docs/theory.md: its figures, from the functions that it describes.

`python -m docs.generate.theory_page out/compare/compare.json` takes over a new run of section 7.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf, ndtr

from docs.generate.templates import HERE, bare, rendered, table
from pc_client.analysis.inference import paired_difference
from pc_client.movements.durations import ISOCHRONY, Fitts
from pc_client.movements.lognormal import FULL_COVERAGE, LiteralTiming, Lognormal, TwoSidedTiming
from pc_client.movements.minimum_jerk import stroke_shape
from pc_client.movements.recipes import HAND_STROKE
from pc_client.movements.sigma_lognormal import LEAD, SigmaLognormal, Stroke, sinc
from pc_client.movements.uniform import SmoothedSquareWave
from pc_client.movements.variability import HUMAN_STROKE, PUBLISHED
from pc_client.results.tables import to_json
from pc_client.studies.comparison import COLUMNS, EXECUTED_COLUMNS, build_comparison, make_sets
from pc_client.studies.likeness import log_dimensionless_jerk, sparc

_DATA = HERE / "compare.json"
_STROKE = np.linspace(0.0, 1.0, 1001)
_FINE = np.linspace(0.0, 1.0, 20_001)


def render() -> str:
    """The page."""
    stroke = TwoSidedTiming(0.0, 1.0, 0.1).lognormal
    fine = stroke.evaluate(_FINE)
    rms_frequency = math.sqrt(float(fine.rate_change @ fine.rate_change) / float(fine.rate @ fine.rate))
    trapezoid = SmoothedSquareWave(np.array([[0.1, 0.9]]), np.array([1.25]), (0.2,))
    recipe = LiteralTiming(0.0, 1.0, LEAD)
    return rendered(
        "theory.md.j2",
        overlaps=_overlaps(),
        literal_windows=_literal_windows(),
        two_sided_windows=_two_sided_windows(),
        profiles=_profiles(),
        ranges=_ranges(),
        check_figures=_check_figures(),
        missing=0.5 * (1.0 - float(erf(3.0))),
        outside=2.0 * float(ndtr(-FULL_COVERAGE)),
        outside_3=2.0 * float(ndtr(-3.0)),
        stroke=stroke,
        acceleration=float(np.abs(fine.rate_change).max()),
        above_trapezoid=stroke.peak / float(trapezoid.evaluate(_STROKE).v.max()),
        rms_frequency=rms_frequency,
        cost_of_16_ms=-20.0 * math.log10(0.016 * rms_frequency),
        minimum_jerk_peak=float(stroke_shape(0.5).rate),
        exact_jerk=-math.log(204.8),
        isochrony=ISOCHRONY,
        fitts=Fitts(),
        hand=HUMAN_STROKE,
        mu_of_lead=[
            LiteralTiming(0.0, HAND_STROKE, lead * HAND_STROKE).lognormal.mu for lead in (LEAD, 0.5, 2.0)
        ],
        paces=[math.exp(-2.0 * change) for change in reversed(PUBLISHED.pace)],
        small_sigma=[math.ceil(1e3 * s) / 1e3 for s in (Lognormal(0.0, 0.0, 0.1).skewness,)]
        + [math.ceil(1e2 * Lognormal(0.0, 0.0, 0.1).kurtosis) / 1e2],
        human={
            "sigma": recipe.lognormal.sigma,
            "skewness": recipe.lognormal.skewness,
            "rest": recipe.lognormal.time_at_deviation(-FULL_COVERAGE),
        },
        **_comparison(),
    )


def _overlaps() -> str:
    heads = [
        "overlap",
        "corner missed by, sigma .10 [mm]",
        "sigma .25 [mm]",
        "speed there / top speed, sigma .10",
        "sigma .25",
    ]
    corner, rows = np.array([0.2, 0.0, 0.0]), []
    points = np.array([[0.0, 0.0, 0.0], corner, [0.2, 0.2, 0.0]])
    for overlap in (0.0, 0.3, 0.4, 0.5, 0.6):
        missed, speeds = [], []
        for sigma in (0.10, 0.25):
            strokes = tuple(Stroke(TwoSidedTiming(start, 1.0, sigma)) for start in (0.0, 1.0 - overlap))
            movement = SigmaLognormal(points, strokes, 2.0 - overlap)
            motion = movement.evaluate(2.0 * _FINE)
            least = np.linalg.norm(movement.evaluate(movement.speed_minima()).v)
            missed.append(f"{1e3 * np.linalg.norm(motion.p - corner, axis=1).min():.1f}")
            speeds.append(f"{least / np.linalg.norm(motion.v, axis=1).max():.3f}")
        rows.append([f"{overlap:.1f}", *missed, *speeds])
    return table(heads, rows)


def _literal_windows() -> str:
    heads = [
        "lead / T",
        "k",
        "sigma",
        "mu for T = 1 s",
        "share of D in the window",
        "visible from",
        "skewness",
        "kurtosis",
        "top speed T / D",
    ]
    rows = []
    for lead, k in ((0.0, "2"), (0.5, "3/2"), (1.0, "4/3"), (2.0, "6/5"), (5.0, "12/11")):
        one = LiteralTiming(0.0, 1.0, lead).lognormal
        done = one.evaluate([0.0, 1.0]).done
        figures = [(one.sigma, 9), (one.mu, 9), (float(done[1] - done[0]), 8)]
        figures += [(one.time_at_deviation(-FULL_COVERAGE), 3), (one.skewness, 3), (one.kurtosis, 3)]
        rows.append([f"{lead:g}", k, *(bare(*figure) for figure in [*figures, (one.peak, 3)])])
    return table(heads, rows)


def _two_sided_windows() -> str:
    heads = ["sigma", "top at, `c = 3 sqrt 2`", "top speed T / D", "top at, c = 3", "top speed T / D, c = 3"]
    rows = []
    for sigma in (0.05, 0.10, 0.15, 0.20, 0.25, 0.30):
        full, three = (TwoSidedTiming(0.0, 1.0, sigma, *c).lognormal for c in ((), (3.0,)))
        figures = (full.mode, full.peak, three.mode, three.peak, full.skewness, full.kurtosis)
        rows.append([bare(sigma, 2), *(bare(figure, 3) for figure in figures)])
    return table([*heads, "skewness", "kurtosis"], rows)


def _trapezoid(up: float, down: float) -> NDArray[np.float64]:
    ramps = np.minimum(_STROKE / up, (1.0 - _STROKE) / down)
    return np.clip(ramps, 0.0, 1.0) / (1.0 - 0.5 * (up + down))


def _two_boxcars() -> NDArray[np.float64]:
    """A square of .8 s and two boxcars of .1 s, sampled with both ends."""
    boxcar = np.ones(101) / 101
    wave = np.convolve(np.convolve(np.ones(801), boxcar), boxcar)
    shape: NDArray[np.float64] = wave / (wave.sum() / 1000.0)
    return shape


def _profiles() -> str:
    def lognormal(timing: LiteralTiming | TwoSidedTiming) -> NDArray[np.float64]:
        rate: NDArray[np.float64] = timing.lognormal.evaluate(_STROKE).rate
        return rate

    profiles = {
        "minimum jerk": (stroke_shape(_STROKE).rate, (4, 4, 3)),
        "lognormal, literal, lead 0": (lognormal(LiteralTiming(0.0, 1.0, 0.0)), (3, 4, 3)),
        "lognormal, two-sided, sigma .0426": (lognormal(TwoSidedTiming(0.0, 1.0, 0.0426)), (3, 4, 3)),
        "lognormal, two-sided, sigma .1": (lognormal(TwoSidedTiming(0.0, 1.0, 0.1)), (3, 4, 3)),
        "lognormal, two-sided c = 3, sigma .25": (lognormal(TwoSidedTiming(0.0, 1.0, 0.25, 3.0)), (3, 4, 3)),
        "trapezoid, ramps .2 and .2 s": (_trapezoid(0.2, 0.2), (2, 3, 1)),
        "trapezoid, ramps .1 and .1 s": (_trapezoid(0.1, 0.1), (3, 3, 1)),
        "trapezoid, ramps .05 and .05 s": (_trapezoid(0.05, 0.05), (3, 3, 1)),
        "trapezoid, ramps .15 and .25 s": (_trapezoid(0.15, 0.25), (2, 3, 1)),
        "square wave, two boxcars of 101 samples": (_two_boxcars(), (3, 3, 2)),
    }
    rows = [
        [name, *(f"{x:.{n}f}" for x, n in zip(_figures(speed), digits, strict=True))]
        for name, (speed, digits) in profiles.items()
    ]
    return table(["profile", "top speed", "SPARC", "LDJ"], rows)


def _figures(speed: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(speed.max()), sparc(speed, 1000.0), log_dimensionless_jerk(speed, 1000.0)


def _ranges() -> str:
    drawn = {
        "D": (PUBLISHED.length, "for each stroke"),
        "t0": (PUBLISHED.rhythm, "once a movement"),
        "mu": (PUBLISHED.pace, "once a movement"),
        "sigma": (PUBLISHED.sigma, "for each stroke"),
        "theta_s": (PUBLISHED.theta_start, "for each stroke"),
        "theta_e": (PUBLISHED.theta_end, "for each stroke"),
    }
    rows = [[name, f"{100 * low:g}", f"{100 * high:g}", when] for name, ((low, high), when) in drawn.items()]
    return table(["parameter", "from [%]", "to [%]", "drawn"], rows)


def _check_figures() -> str:
    cases = {
        "A": (Lognormal(0.0, -1.6, 0.25), 1.0),
        "B": (Lognormal(0.1, -1.6, 0.25), 0.2),
        "C": (LiteralTiming(0.0, 0.1, 0.0).lognormal, 0.1),
        "D": (Lognormal(0.5, -0.5, 0.3), 0.3),
    }
    shown = {
        "A": "z-3 first top second z3 v1 peak v2 s1 s2 s3 mean median std skewness kurtosis power",
        "B": "top peak power",
        "C": "sigma mu top share skewness kurtosis peak",
        "D": "top peak s2 std power",
    }
    rows: list[list[str]] = []
    for case, (one, length) in cases.items():
        first, second = one.inflections
        figures: dict[str, tuple[str, float]] = {
            "z-3": ("time at z = -3", one.time_at_deviation(-3.0)),
            "first": ("time of the first inflection", first),
            "top": ("time of the top speed", one.mode),
            "second": ("time of the second inflection", second),
            "z3": ("time at z = 3", one.time_at_deviation(3.0)),
            "v1": ("speed at the first inflection", length * float(one.evaluate(first).rate)),
            "peak": ("top speed", length * one.peak),
            "v2": ("speed at the second inflection", length * float(one.evaluate(second).rate)),
            "s1": ("share of D at the first inflection", float(one.evaluate(first).done)),
            "s2": ("share of D at the top speed", float(one.evaluate(one.mode).done)),
            "s3": ("share of D at the second inflection", float(one.evaluate(second).done)),
            "mean": ("mean", one.mean),
            "median": ("median", one.median),
            "std": ("std", one.std),
            "skewness": ("skewness", one.skewness),
            "kurtosis": ("kurtosis", one.kurtosis),
            "power": ("power", length**2 * one.power),
            "sigma": ("sigma", one.sigma),
            "mu": ("mu", one.mu),
            "share": ("share of D in the window", float(one.evaluate(0.1).done)),
        }
        rows += [[case, figures[key][0], bare(figures[key][1], 12)] for key in shown[case].split()]
    end = 0.2 * float(sinc(0.6)) * np.array([math.cos(0.9), math.sin(0.9)])
    start, goal = (0.25, -0.1, 0.2), (0.35, 0.1, 0.3)
    longer = Stroke(cases["B"][0], arc_angle=0.9).length(start, goal) / math.dist(start, goal)
    rows += [
        ["E", "end in the plane, x", bare(float(end[0]), 6)],
        ["E", "end in the plane, y", bare(float(end[1]), 6)],
        ["E", "chord in the plane", bare(float(np.hypot(*end)), 6)],
        ["E", "D / distance in space", bare(longer, 12)],
        ["-", "1 - erf(3)", bare(1.0 - float(erf(3.0)), 9)],
        ["-", "`Phi(3) - Phi(-3)`", bare(float(ndtr(3.0) - ndtr(-3.0)), 8)],
        ["-", "`Phi(3 sqrt 2) - Phi(-3 sqrt 2)`", bare(float(ndtr(FULL_COVERAGE) - ndtr(-FULL_COVERAGE)), 8)],
    ]
    return table(["case", "what", "value"], rows)


def _comparison() -> dict[str, Any]:
    """Planned and filtered signals are computed; executed ones are those of a run of `ur-client compare`."""
    run = json.loads(_DATA.read_text(encoding="utf-8"))
    columns, rows = (*COLUMNS, *EXECUTED_COLUMNS), []
    made = build_comparison(make_sets(4, 1, 5)).means.to_dicts()
    for row in made:
        first = row["signal"] == "planned"
        rows.append([row["generator"] if first else "", *(c.cell(row[c.name]) for c in columns[1:])])
        if not first:
            done = {"signal": "executed", **run[row["generator"]]["means"]}
            rows.append(
                ["", *(c.cell(math.nan if done[c.name] is None else done[c.name]) for c in columns[1:])]
            )
    snr = [one["means"]["snr_db"] for one in run.values()]
    filtered = next(row for row in made if (row["generator"], row["signal"]) == ("uniform", "filtered"))
    straight = run["minimum_jerk"]["means"]
    return {
        "comparison": table([column.heading for column in columns], rows, n_right=len(columns) - 2),
        "snr_range": max(snr) - min(snr),
        "speeds": {row["generator"]: row["peak_speed"] for row in made if row["signal"] == "planned"},
        "corners": (filtered["exponent"], filtered["r_squared"]),
        "straight": (straight["exponent"], straight["r_squared"]),
        "twin": paired_difference(run["lognormal"]["snr_db"], run["uniform"]["snr_db"]),
    }


def taken_over(compared: dict[str, Any]) -> dict[str, Any]:
    """What is shown of a `compare.json`: the means of executed signals, and the SNR of each set."""
    return {
        kind: {
            "means": {**mean["executed"], **{name: mean[name] for name in ("snr_db", "shifted_snr_db")}},
            "snr_db": [row["snr_db"] for row in compared["rows"] if row["kind"] == kind],
        }
        for kind, mean in compared["means"].items()
    }


if __name__ == "__main__":
    given = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    _DATA.write_text(to_json(taken_over(given)), encoding="utf-8")
