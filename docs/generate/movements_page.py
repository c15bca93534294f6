"""docs/movements.md: the figures of the library's movements."""

from __future__ import annotations

import math

import numpy as np

from docs.generate.templates import bare, rendered, table
from pc_client.movements.description import describe, outline, snr_of_delay
from pc_client.movements.generate import uniform_twin
from pc_client.movements.library_sets import library_names
from pc_client.movements.lognormal import LiteralTiming
from pc_client.movements.movement import load_movement
from pc_client.movements.recipes import HAND_STROKE
from pc_client.movements.sigma_lognormal import LEAD, SigmaLognormal
from pc_client.planning.plan import plan_movement

_DELAYS = (0.020, 0.028)
"""Of a loop, s: two that were measured."""


def render() -> str:
    """The page."""
    return rendered(
        "movements.md.j2",
        rows_paper=_rows("paper"),
        rows_arcs=_rows("arcs"),
        leads=_leads(),
        corner_costs=_corner_costs(),
        hand=_hand(),
        human_sigma=LiteralTiming(0.0, 1.0, LEAD).lognormal.sigma,
    )


def _rows(of: str) -> str:
    heads = [
        "name",
        "duration s",
        "strokes s",
        "path mm",
        "top speed m/s",
        "top acc. m/s²",
        "joint speed rad/s",
    ]
    heads += ["joint acc. rad/s²", "w rad/s", "SNR dB at 20, 28 ms", "same, vector"]
    rows = []
    for name in library_names(of):
        movement = load_movement(name)
        figures, report = describe(movement), plan_movement(movement).report
        levels = [figures[f"expected_{kind}"] for kind in ("snr_db", "vector_snr_db")]
        rows.append(
            [
                f"`{name}`",
                f"{movement.duration:.3f}",
                ", ".join(f"{duration:.3f}" for duration in movement.stroke_durations),
                f"{1e3 * figures['path_length_m']:.0f}",
                f"{figures['peak_speed_m_s']:.3f}",
                f"{figures['peak_acceleration_m_s2']:.2f}",
                f"{report.joint_speed.value:.2f}",
                f"{report.joint_acceleration.value:.1f}",
                f"{figures['speed_rms_frequency_rad_s']:.2f}",
                *(", ".join(f"{level[f'{1e3 * d:.0f} ms']:.1f}" for d in _DELAYS) for level in levels),
            ]
        )
    return table(heads, rows)


def _leads() -> str:
    rows = []
    for lead, shown, k in (
        (0.0, "0", "2"),
        (0.5, "1/2", "3/2"),
        (1.0, "1", "4/3"),
        (2.0, "2", "6/5"),
        (5.0, "5", "12/11"),
    ):
        one = LiteralTiming(0.0, HAND_STROKE, lead * HAND_STROKE).lognormal
        figures = (bare(one.sigma, 3), bare(one.skewness, 3), f"{one.kurtosis:.2f}", f"{one.mu:.2f}")
        cells = [shown, k, *figures]
        rows.append([f"**{cell}**" for cell in cells] if lead == LEAD else cells)
    return table(["lead / T", "k", "sigma", "skewness", "kurtosis", "mu of a stroke of .1 s"], rows)


def _corner_costs() -> str:
    heads = ["the five robot-like movements", "path acceleration", "largest joint acceleration"]
    heads += ["target points missed by", "SNR after a pure delay of 20, 28 ms"]
    rows = []
    for label, setback in (("stop", 0.0), ("blend, setback 30 mm", 0.03), ("blend, setback 10 mm", 0.01)):
        twins = [
            uniform_twin(load_movement(name), "twin", "blend" if setback else "stop", setback)
            for name in library_names("paper")[5:]
        ]
        off = [
            np.linalg.norm(
                m.sample(np.cumsum(m.stroke_durations)[:-1]).p - m.target_points[1:-1], axis=1
            ).max()
            for m in twins
        ]
        snr = [np.mean([snr_of_delay(m, delay) for m in twins]) for delay in _DELAYS]
        rows.append(
            [
                label,
                f"{max(outline(m)['peak_acceleration_m_s2'] for m in twins):.2g} m/s²",
                f"{max(plan_movement(m).report.joint_acceleration.value for m in twins):.1f} rad/s²",
                f"{1e3 * max(off):.0f} mm",
                ", ".join(f"{level:.1f}" for level in snr) + " dB",
            ]
        )
    return table(heads, rows)


def _hand() -> dict[str, tuple[float, float]]:
    """Least and largest of all strokes of the set, in the hand's time: mu, durations; gaps on the robot."""
    found: dict[str, list[float]] = {"mu": [], "strokes": [], "gaps": []}
    for name in library_names("paper")[5:]:
        movement = load_movement(name)
        assert isinstance(movement.trajectory, SigmaLognormal)
        stretch = float(movement.provenance["time_stretch"])
        found["mu"] += [stroke["mu"] - math.log(stretch) for stroke in describe(movement)["strokes"]]
        found["strokes"] += (movement.stroke_durations / stretch).tolist()
        ends = np.cumsum(movement.stroke_durations)[:-1]
        found["gaps"] += (movement.trajectory.speed_minima() - ends).tolist()
    return {name: (min(values), max(values)) for name, values in found.items()}
