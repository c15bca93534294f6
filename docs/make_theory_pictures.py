"""The picture of docs/theory.md: a lognormal stroke with its points, and one stroke by several models.

`python -m docs.make_theory_pictures` writes docs/img/theory.svg. docs/img/compare.svg is made by the
command in theory.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from pc_client.movements.lognormal import LiteralTiming, Lognormal, TwoSidedTiming
from pc_client.movements.minimum_jerk import stroke_shape
from pc_client.movements.uniform import SmoothedSquareWave
from pc_client.results.figures import BLUE, GREEN, ORANGE, PURPLE, RED, REFERENCE_GREY, figure, svg_text

IMG = Path(__file__).parent / "img"
LOGNORMAL = Lognormal(0.0, -1.6, 0.25)


def draw_lognormal(axes: Axes) -> None:
    t = np.linspace(0.0, 0.55, 1101)
    axes.plot(t, LOGNORMAL.evaluate(t).rate, color=BLUE, lw=2.0)
    before, after = LOGNORMAL.inflections
    points = {
        "inflection": (before, (-8, 6), "right"),
        "top: exp(mu − sigma²)": (LOGNORMAL.mode, (0, 7), "center"),
        "half the length: exp(mu)": (LOGNORMAL.median, (10, 2), "left"),
        "mean": (LOGNORMAL.mean, (10, -8), "left"),
        "inflection ": (after, (10, 0), "left"),
    }
    for label, (time, offset, side) in points.items():
        height = float(LOGNORMAL.evaluate(time).rate)
        axes.plot([time], [height], "o", color=RED, ms=5)
        axes.annotate(label, (time, height), offset, textcoords="offset points", ha=side, fontsize=8)
    for z, name in ((-3.0, "z = −3"), (3.0, "z = 3")):
        time = LOGNORMAL.time_at_deviation(z)
        axes.axvline(time, color=REFERENCE_GREY, lw=0.9, ls=":")
        axes.annotate(name, (time, 6.2), (3, 0), textcoords="offset points", fontsize=8)
    done = LOGNORMAL.evaluate(t).done
    axes.plot(t, 8.0 * done, color=REFERENCE_GREY, lw=1.2)
    axes.annotate(
        "F, 0 to 1",
        (0.435, 7.9),
        (0, -11),
        textcoords="offset points",
        fontsize=8,
        color="#666666",
    )
    axes.set(xlim=(0.0, 0.55), ylim=(0.0, 9.0), xlabel="t − t0 [s]", ylabel="Lambda [1/s]")
    axes.set_title("A stroke: mu = −1.6, sigma = .25")


def draw_profiles(axes: Axes) -> None:
    t = np.linspace(0.0, 1.0, 1001)
    trapezoid = SmoothedSquareWave(np.array([[0.1, 0.9]]), np.array([1.25]), (0.2,))
    profiles = {
        "lognormal, literal, lead 0": (LiteralTiming(0.0, 1.0, 0.0).lognormal.evaluate(t).rate, RED),
        "lognormal, literal, lead T": (LiteralTiming(0.0, 1.0, 1.0).lognormal.evaluate(t).rate, ORANGE),
        "lognormal, two-sided, sigma .1": (TwoSidedTiming(0.0, 1.0, 0.1).lognormal.evaluate(t).rate, BLUE),
        "lognormal, two-sided c = 3, sigma .25": (
            TwoSidedTiming(0.0, 1.0, 0.25, 3.0).lognormal.evaluate(t).rate,
            PURPLE,
        ),
        "minimum jerk": (stroke_shape(t).rate, GREEN),
        "trapezoid, ramps .2": (trapezoid.evaluate(t).v, "#444444"),
    }
    for label, (speed, colour) in profiles.items():
        axes.plot(t, speed, color=colour, lw=1.7, label=label)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 7.0), xlabel="t / T", ylabel="speed T / D")
    axes.set_title("One stroke, six models: the same length in the same window")
    axes.legend(loc="upper left", ncols=2)


def main() -> None:
    with figure(3.6) as page:
        left, right = page.subplots(1, 2)
        draw_lognormal(left)
        draw_profiles(right)
    (IMG / "theory.svg").write_text(svg_text(page), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
