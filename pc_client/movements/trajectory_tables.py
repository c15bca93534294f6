"""The trajectory of a movement as part of its TOML file: how each kind is written and read.

What the fields mean is described in `docs/movements.md`; the frame around them is the business of `files.py`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import MovementError
from pc_client.movements.lognormal import Lognormal
from pc_client.movements.minimum_jerk import MinimumJerk
from pc_client.movements.movement import Trajectory
from pc_client.movements.power_law import TWO_THIRDS, PowerLaw
from pc_client.movements.robotic import RoboticTrajectory
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.stroke import Stroke
from pc_client.movements.timing import FULL_COVERAGE, LiteralTiming, Timing, TwoSidedTiming, lead_from_k
from pc_client.toml_tables import TableReader, toml_value

__all__ = ["KIND_WORDS", "TRAJECTORY_FIELDS", "parse_trajectory", "trajectory_lines"]

#: What a file says of its kind of movement.
KIND_WORDS = {
    "lognormal": "human-like: lognormal strokes",
    "uniform": "robot-like: constant speed with ramps",
    "minimum_jerk": "human-like: least jerk",
    "power_law": "human-like: the two-thirds power law",
}
#: Fields of a file that belong to its trajectory, for messages.
TRAJECTORY_FIELDS = "strokes (lognormal), profile (uniform, minimum_jerk, power_law)"

_STROKE_FIELDS = (
    "arc_angle, tilt, and one of: start, duration, sigma, coverage; start, duration, lead (or k); "
    "t0, mu, sigma"
)


def trajectory_lines(trajectory: Trajectory) -> list[str]:
    """The lines of a file that state a trajectory, after those that every file has."""
    match trajectory:
        case RoboticTrajectory():
            lines = [
                f"corners = {toml_value(trajectory.corners)}",
                f"ramps = {toml_value(list(trajectory.ramps))}  # s",
            ]
            lines += [f"blend = {toml_value(trajectory.blend)}  # m"] if trajectory.blend else []
        case MinimumJerk():
            lines = [f"passing = {toml_value(trajectory.passing)}"]
        case PowerLaw():
            lines = [
                f"ramps = {toml_value(list(trajectory.ramps))}  # s",
                f"largest_radius = {toml_value(trajectory.largest_radius)}  # m",
                f"exponent = {toml_value(trajectory.exponent)}",
                f"torsion_exponent = {toml_value(trajectory.torsion_exponent)}",
            ]
        case SigmaLognormal():
            return [line for stroke in trajectory.strokes for line in _stroke_lines(stroke)]
        case _:
            raise MovementError(
                f"a trajectory of type {type(trajectory).__name__} has no place in a movement file"
            )
    return ["", "[profile]", *lines]


def parse_trajectory(
    kind: str,
    table: TableReader,
    points: NDArray[np.float64],
    duration: float,
    stroke_durations: NDArray[np.float64] | None,
) -> tuple[Trajectory, NDArray[np.float64]]:
    """The trajectory of a file and the durations of its strokes.

    Args:
        kind: as the file says it.
        table: the file; the fields of the trajectory are taken out of it.
        points: target points, (n, 3), m.
        duration: as the file says it, s.
        stroke_durations: (n - 1,), s, or None where the file has none.

    Raises:
        MovementError: naming the field.
    """
    if kind == "lognormal":
        strokes = tuple(_parse_stroke(stroke) for stroke in table.tables("strokes"))
        lognormal = SigmaLognormal(points, strokes, duration)
        if stroke_durations is None:
            stroke_durations = np.diff(np.concatenate(([0.0], lognormal.speed_minima(), [duration])))
        return lognormal, stroke_durations
    if kind == "power_law":
        power = _parse_power_law(table.table("profile"), points, duration)
        return power, np.diff(power.passages) if stroke_durations is None else stroke_durations
    if kind not in ("uniform", "minimum_jerk"):
        kinds = ", ".join(f'"{known}"' for known in KIND_WORDS)
        raise table.error("kind", f'"{kind}"; give one of {kinds} (samples are .csv files)')
    if stroke_durations is None:
        raise table.error("stroke_durations", "missing; give a list of numbers")
    total = sum(stroke_durations.tolist())
    if abs(total - duration) > 1e-6:
        raise table.error("duration", f"{duration} s; the stroke durations add up to {total:.6f} s")
    parse = _parse_robotic if kind == "uniform" else _parse_minimum_jerk
    return parse(table.table("profile"), points, stroke_durations), stroke_durations


def _stroke_lines(stroke: Stroke) -> list[str]:
    fields: list[tuple[str, float, str]]
    match stroke.timing:
        case TwoSidedTiming(start, duration, sigma, coverage):
            fields = [("start", start, "  # s"), ("duration", duration, "  # s"), ("sigma", sigma, "")]
            fields += [("coverage", coverage, "")] if coverage != FULL_COVERAGE else []
        case LiteralTiming(start, duration, lead):
            fields = [("start", start, "  # s"), ("duration", duration, "  # s"), ("lead", lead, "  # s")]
        case other:
            lognormal = other.lognormal
            fields = [
                ("t0", lognormal.t0, "  # s"),
                ("mu", lognormal.mu, "  # ln s"),
                ("sigma", lognormal.sigma, ""),
            ]
    fields += [("arc_angle", stroke.arc_angle, "  # rad"), ("tilt", stroke.tilt, "  # rad")]
    return ["", "[[strokes]]", *(f"{key} = {toml_value(value)}{unit}" for key, value, unit in fields)]


def _parse_stroke(table: TableReader) -> Stroke:
    timing: Timing
    if "mu" in table:
        timing = Lognormal(table.number("t0"), table.number("mu"), table.number("sigma"))
    elif "sigma" in table:
        coverage = table.number("coverage", FULL_COVERAGE)
        timing = TwoSidedTiming(
            table.number("start"), table.number("duration"), table.number("sigma"), coverage
        )
    else:
        start, duration = table.number("start"), table.number("duration")
        lead = lead_from_k(table.number("k"), duration) if "k" in table else table.number("lead")
        timing = LiteralTiming(start, duration, lead)
    stroke = Stroke(timing, table.number("arc_angle", 0.0), table.number("tilt", 0.0))
    table.finish(_STROKE_FIELDS)
    return stroke


def _parse_robotic(
    table: TableReader, points: NDArray[np.float64], durations: NDArray[np.float64]
) -> RoboticTrajectory:
    corners = table.text("corners")
    if corners not in ("stop", "blend"):
        raise table.error("corners", f'"{corners}"; give "stop" or "blend"')
    ramps = tuple(table.numbers("ramps"))
    trajectory = RoboticTrajectory(
        points, durations, ramps, "stop" if corners == "stop" else "blend", table.number("blend", 0.0)
    )
    table.finish("corners, ramps, blend")
    return trajectory


def _parse_minimum_jerk(
    table: TableReader, points: NDArray[np.float64], durations: NDArray[np.float64]
) -> MinimumJerk:
    passing = table.text("passing")
    if passing not in ("stop", "via"):
        raise table.error("passing", f'"{passing}"; give "stop" or "via"')
    table.finish("passing")
    return MinimumJerk(points, durations, "stop" if passing == "stop" else "via")


def _parse_power_law(table: TableReader, points: NDArray[np.float64], duration: float) -> PowerLaw:
    trajectory = PowerLaw(
        points,
        duration,
        tuple(table.numbers("ramps")),
        table.number("largest_radius"),
        table.number("exponent", TWO_THIRDS),
        table.number("torsion_exponent", 0.0),
    )
    table.finish("ramps, largest_radius, exponent, torsion_exponent")
    return trajectory
