"""Movement files: TOML for movements with a law, CSV for samples; and the library of ten.

The format is described in `docs/movements.md`. Reading checks everything and names file and field (or line)
of what is wrong.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pc_client.errors import MovementError
from pc_client.movements.lognormal import Lognormal
from pc_client.movements.movement import Movement
from pc_client.movements.robotic import RoboticLaw
from pc_client.movements.samples import SampledLaw, parse_samples, write_samples
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.stroke import Stroke
from pc_client.movements.tables import TableReader, toml_value
from pc_client.movements.timing import FULL_COVERAGE, LiteralTiming, Timing, TwoSidedTiming, lead_from_k

__all__ = [
    "LIBRARY_FOLDER",
    "LIBRARY_NAMES",
    "library_names",
    "load_movement",
    "movement_text",
    "save_movement",
]

LIBRARY_FOLDER = Path(__file__).parent / "library"
#: The ten movements of the paper's Table I, in its order.
LIBRARY_NAMES = tuple(
    f"{kind}_{number}" for kind in ("uniform", "lognorm") for number in ("4_1", "4_2", "5_1", "5_2", "5_3")
)

_FORMAT = 1
_FIELDS = (
    "format, name, kind, duration, stroke_durations, target_points, provenance, "
    "strokes (lognormal), profile (uniform)"
)
_STROKE_FIELDS = (
    "turn, tilt, and one of: start, duration, sigma, coverage; start, duration, lead (or k); t0, mu, sigma"
)


def library_names() -> list[str]:
    """Names of the movements that come with the package, in the order of Table I."""
    return list(LIBRARY_NAMES)


def load_movement(name_or_path: str | Path) -> Movement:
    """A movement of the library by its name, or one from a .toml or .csv file by its path.

    Raises:
        MovementError: unknown name, unreachable file, or content that makes no sense, naming file and field
            or line.
    """
    if isinstance(name_or_path, str) and name_or_path in LIBRARY_NAMES:
        return _read(LIBRARY_FOLDER / f"{name_or_path}.toml")
    path = Path(name_or_path)
    if not path.suffix and not path.exists():
        near = difflib.get_close_matches(str(name_or_path), LIBRARY_NAMES, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise MovementError(
            f'no movement "{name_or_path}": {hint}give the path of a .toml or .csv file, '
            f"or one of {', '.join(LIBRARY_NAMES)}"
        )
    return _read(path)


def save_movement(movement: Movement, path: str | Path) -> None:
    """Write a movement file: .toml for one with a law, .csv for samples.

    Raises:
        MovementError: wrong suffix for the kind of movement, or the file cannot be written.
    """
    path = Path(path)
    law = movement.law
    wanted = ".csv" if isinstance(law, SampledLaw) else ".toml"
    if path.suffix.lower() != wanted:
        raise MovementError(f"{path}: a movement of kind {movement.kind} is saved as a {wanted} file")
    try:
        if isinstance(law, SampledLaw):
            write_samples(path, law.t, law.points)
        else:
            path.write_text(movement_text(movement), encoding="utf-8")
    except OSError as error:
        raise MovementError(
            f"{path}: cannot be written ({error.strerror or error}); give a place that can be"
        ) from error


def movement_text(movement: Movement) -> str:
    """The TOML file of a movement with a law, complete and readable."""
    law = movement.law
    what = {
        "lognormal": "human-like: overlapping lognormal strokes",
        "uniform": "robot-like: constant speed with ramps",
    }
    if movement.kind not in what:
        raise MovementError(f"movement {movement.name} is made of samples: save it as a .csv file")
    lines = [
        f"# A movement of the TCP, {what[movement.kind]}.",
        "# x, y, z over t derive from it; docs/movements.md explains the fields.",
        f"format = {_FORMAT}",
        f"name = {toml_value(movement.name)}",
        f"kind = {toml_value(movement.kind)}",
        f"duration = {toml_value(movement.duration)}  # s",
        f"stroke_durations = {toml_value(movement.stroke_durations.tolist())}  # s",
        "target_points = [  # m, robot base frame",
        *(f"    {toml_value(point)}," for point in movement.target_points.tolist()),
        "]",
    ]
    if movement.provenance:
        lines += ["", "[provenance]"]
        lines += [f"{_toml_key(key)} = {toml_value(value)}" for key, value in movement.provenance.items()]
    if isinstance(law, RoboticLaw):
        lines += [
            "",
            "[profile]",
            f"corners = {toml_value(law.corners)}",
            f"ramps = {toml_value(list(law.ramps))}  # s",
        ]
        lines += [f"blend = {toml_value(law.blend)}  # m"] if law.blend else []
    elif isinstance(law, SigmaLognormal):
        for stroke in law.strokes:
            lines += ["", "[[strokes]]"]
            lines += [f"{key} = {toml_value(value)}{unit}" for key, value, unit in _stroke_fields(stroke)]
    return "\n".join(lines) + "\n"


def _toml_key(key: str) -> str:
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else toml_value(key)


def _stroke_fields(stroke: Stroke) -> list[tuple[str, float, str]]:
    fields: list[tuple[str, float, str]]
    match stroke.timing:
        case TwoSidedTiming(start, duration, sigma, coverage):
            fields = [("start", start, "  # s"), ("duration", duration, "  # s"), ("sigma", sigma, "")]
            fields += [("coverage", coverage, "")] if coverage != FULL_COVERAGE else []
        case LiteralTiming(start, duration, lead):
            fields = [("start", start, "  # s"), ("duration", duration, "  # s"), ("lead", lead, "  # s")]
        case other:
            bell = other.lognormal
            fields = [("t0", bell.t0, "  # s"), ("mu", bell.mu, "  # ln s"), ("sigma", bell.sigma, "")]
    return [*fields, ("turn", stroke.turn, "  # rad"), ("tilt", stroke.tilt, "  # rad")]


def _read(path: Path) -> Movement:
    suffix = path.suffix.lower()
    if suffix not in (".toml", ".csv"):
        raise MovementError(f"{path}: movement files are .toml (parameters) or .csv (x, y, z, t samples)")
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise MovementError(
            f"{path}: byte {error.start} is not UTF-8; save the file as UTF-8 text"
        ) from error
    except OSError as error:
        raise MovementError(
            f"{path}: cannot be read ({error.strerror or error}); give a file that exists"
        ) from error
    if suffix == ".csv":
        law = parse_samples(text, str(path))
        return Movement(path.stem, law, np.array([law.duration]), {"file": path.name})
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise MovementError(f"{path}: not TOML: {error}") from error
    return _parse_movement(TableReader(values, str(path)), str(path))


def _parse_movement(table: TableReader, source: str) -> Movement:
    version = table.number("format")
    if version != _FORMAT:
        raise table.error("format", f"{version:g}; this program reads format {_FORMAT}")
    name, kind = table.text("name"), table.text("kind")
    points = table.points("target_points")
    provenance = table.table("provenance").facts() if "provenance" in table else {}
    duration = table.number("duration")
    durations = np.array(table.numbers("stroke_durations")) if "stroke_durations" in table else None
    law: SigmaLognormal | RoboticLaw
    with _naming(source):
        if kind == "lognormal":
            strokes = tuple(_parse_stroke(stroke) for stroke in table.tables("strokes"))
            law = SigmaLognormal(points, strokes, duration)
            if durations is None:
                durations = np.diff(np.concatenate(([0.0], law.speed_minima(), [duration])))
        elif kind == "uniform":
            if durations is None:
                raise table.error("stroke_durations", "missing; give a list of numbers")
            law = _parse_robotic(table.table("profile"), points, durations)
            if abs(law.duration - duration) > 1e-6:
                raise table.error(
                    "duration", f"{duration} s; the stroke durations add up to {law.duration:.6f} s"
                )
        else:
            raise table.error("kind", f'"{kind}"; give "lognormal" or "uniform" (samples are .csv files)')
        table.finish(_FIELDS)
        return Movement(name, law, durations, provenance)


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
    stroke = Stroke(timing, table.number("turn", 0.0), table.number("tilt", 0.0))
    table.finish(_STROKE_FIELDS)
    return stroke


def _parse_robotic(
    table: TableReader, points: NDArray[np.float64], durations: NDArray[np.float64]
) -> RoboticLaw:
    corners = table.text("corners")
    if corners not in ("stop", "blend"):
        raise table.error("corners", f'"{corners}"; give "stop" or "blend"')
    ramps = tuple(table.numbers("ramps"))
    law = RoboticLaw(
        points, durations, ramps, "stop" if corners == "stop" else "blend", table.number("blend", 0.0)
    )
    table.finish("corners, ramps, blend")
    return law


@contextmanager
def _naming(source: str) -> Iterator[None]:
    """Put the file's name before messages of those who do not know it."""
    try:
        yield
    except MovementError as error:
        if str(error).startswith(source):
            raise
        raise MovementError(f"{source}: {error}") from error
