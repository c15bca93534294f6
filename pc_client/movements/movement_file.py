"""The records of movement files, one a kind: their fields are read, and written with their units.

What the fields mean is described in `docs/movements.md`.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, field, fields, is_dataclass
from typing import Annotated, Any, Literal, NamedTuple, get_type_hints

import numpy as np

from pc_client.arrays import Array
from pc_client.errors import MovementError
from pc_client.movements.lognormal import (
    FULL_COVERAGE,
    LiteralTiming,
    Lognormal,
    Timing,
    TwoSidedTiming,
    lead_from_k,
)
from pc_client.movements.minimum_jerk import MinimumJerk, Passing
from pc_client.movements.power_law import TWO_THIRDS, PowerLaw
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
from pc_client.movements.trajectory import LONGEST_DURATION, Trajectory
from pc_client.movements.uniform import Corners, Uniform
from ur_hil.records import Field, Finite, Items, checked, fields_of, number, record, text, word

_MOST_POINTS = 1000
"""Most target points of a file: a page of handwriting has some 500."""

_Seconds = Annotated[float, number(unit="s")]
_Metres = Annotated[float, number(unit="m")]
_Coordinate = Annotated[float, number(unit="m, robot base frame")]
_Angle = Annotated[float, number(unit="rad")]
_Ramps = Annotated[tuple[_Seconds, ...], Items(1, 100)]
_Durations = Annotated[tuple[_Seconds, ...], Items(1, _MOST_POINTS)]
_FACTS = [{"type": kind, "strict": True} for kind in ("str", "int", "float")]
_Fact = Annotated[Any, Field("a text or a number", object, {"type": "union", "choices": _FACTS})]


@record
class MovementFile:
    """What the files of all kinds have in common."""

    format: Literal[1]
    name: Annotated[str, text()]
    kind: str
    duration: Annotated[float, number(0.0, LONGEST_DURATION, "s")]
    stroke_durations: _Durations | None = None
    target_points: Annotated[tuple[tuple[_Coordinate, _Coordinate, _Coordinate], ...], Items(2, _MOST_POINTS)]
    provenance: Mapping[str, _Fact] = field(default_factory=dict)


@record
class _Stroke:
    start: _Seconds | None = None
    duration: _Seconds | None = None
    t0: _Seconds | None = None
    mu: Annotated[float, number(unit="ln s")] | None = None
    sigma: Finite | None = None
    coverage: Finite | None = None
    lead: _Seconds | None = None
    k: Finite | None = None
    arc_angle: _Angle = 0.0
    tilt: _Angle = 0.0


@record
class _LognormalFile(MovementFile):
    strokes: Annotated[tuple[_Stroke, ...], Items(1, _MOST_POINTS)]


@record
class _PowerLawProfile:
    ramps: _Ramps
    largest_radius: _Metres
    exponent: Finite = TWO_THIRDS
    torsion_exponent: Finite = 0.0


@record
class _PowerLawFile(MovementFile):
    profile: _PowerLawProfile


@record
class _UniformProfile:
    corners: Corners
    ramps: _Ramps
    blend: _Metres | None = None


@record
class _UniformFile(MovementFile):
    stroke_durations: _Durations
    profile: _UniformProfile


@record
class _MinimumJerkProfile:
    passing: Passing


@record
class _MinimumJerkFile(MovementFile):
    stroke_durations: _Durations
    profile: _MinimumJerkProfile


class _Made(NamedTuple):
    """What a file says of a kind of movement, the trajectory that it makes, and its record."""

    words: str
    trajectory: type[Trajectory]
    record: type[MovementFile]


_KINDS: Mapping[str, _Made] = {
    "lognormal": _Made("human-like: lognormal strokes", SigmaLognormal, _LognormalFile),
    "uniform": _Made("robot-like: constant speed with ramps", Uniform, _UniformFile),
    "minimum_jerk": _Made("human-like: least jerk", MinimumJerk, _MinimumJerkFile),
    "power_law": _Made("human-like: the two-thirds power law", PowerLaw, _PowerLawFile),
}
_KIND = word(_KINDS)

#: What makes the timing of a stroke, by the fields that are given.
_TIMINGS: Mapping[frozenset[str], Callable[..., Timing]] = {
    frozenset(("t0", "mu", "sigma")): Lognormal,
    frozenset(("start", "duration", "sigma")): TwoSidedTiming,
    frozenset(("start", "duration", "sigma", "coverage")): TwoSidedTiming,
    frozenset(("start", "duration", "lead")): LiteralTiming,
    frozenset(("start", "duration", "k")): lambda start, duration, k: LiteralTiming(
        start, duration, lead_from_k(k, duration)
    ),
}


def kind_of(trajectory: Trajectory) -> str:
    """Which model made a trajectory, as its file says it; "samples" are given."""
    return next((kind for kind, made in _KINDS.items() if isinstance(trajectory, made.trajectory)), "samples")


def read_record(values: Mapping[str, Any], source: str) -> MovementFile:
    """The record of a file.

    Raises:
        MovementError: a field is wrong.
    """
    kind = checked(_KIND, values.get("kind"), f"{source}: kind", MovementError)
    return checked(_KINDS[kind].record, values, source, MovementError)


def file_text(
    name: str, trajectory: Trajectory, stroke_durations: Array, provenance: Mapping[str, str | int | float]
) -> str:
    """The TOML file of a movement in closed form, complete and readable."""
    kind = kind_of(trajectory)
    made = _KINDS[kind]
    if isinstance(trajectory, SigmaLognormal):
        shape: dict[str, Any] = {"strokes": tuple(map(_stroke_table, trajectory.strokes))}
    else:
        profile = get_type_hints(made.record)["profile"]
        shape = {"profile": profile(**{row.name: getattr(trajectory, row.name) for row in fields(profile)})}
    file = made.record(
        format=1,
        name=name,
        kind=kind,
        duration=trajectory.duration,
        stroke_durations=tuple(stroke_durations.tolist()),
        target_points=tuple(trajectory.target_points.tolist()),
        provenance=provenance,
        **shape,
    )
    comment = (
        f"A movement of the TCP, {made.words}.\n# x, y, z over t derive from it; docs/movements.md explains"
    )
    return "\n".join((f"# {comment} the fields.", *_lines(file), ""))


def toml_value(value: Any) -> str:
    """A text, a number or a (nested) list as TOML; floats to the last digit, so that they come back equal."""
    if isinstance(value, str):
        # A TOML basic string is a JSON string, but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} has no place in a movement file")
    return repr(value)


def trajectory_of(file: MovementFile) -> tuple[Trajectory, Array]:
    """The trajectory of a file and the durations of its strokes, (n,), s; MovementError if there is none."""
    points, durations = np.array(file.target_points), np.array(file.stroke_durations or ())
    if isinstance(file, _LognormalFile):
        lognormal = SigmaLognormal(points, tuple(map(_stroke, file.strokes)), file.duration)
        edges = [0.0, *lognormal.speed_minima(), file.duration]
        return lognormal, durations if file.stroke_durations else np.diff(edges)
    if isinstance(file, _PowerLawFile):
        power = PowerLaw(points, file.duration, **_given(file.profile))
        return power, durations if file.stroke_durations else np.diff(power.passages)
    total = sum(durations.tolist())
    if abs(total - file.duration) > 1e-6:
        raise MovementError(f"duration: {file.duration} s; the stroke durations add up to {total:.6f} s")
    if isinstance(file, _UniformFile):
        return Uniform(points, durations, **_given(file.profile)), durations
    assert isinstance(file, _MinimumJerkFile)
    return MinimumJerk(points, durations, file.profile.passing), durations


def _stroke(table: _Stroke) -> Stroke:
    timing = _given(table)
    place = timing.pop("arc_angle"), timing.pop("tilt")
    if frozenset(timing) not in _TIMINGS:
        raise MovementError(
            f"a stroke with {', '.join(timing) or 'no times'}; give start, duration, sigma (and coverage), "
            "or start, duration, lead (or k), or t0, mu, sigma"
        )
    return Stroke(_TIMINGS[frozenset(timing)](**timing), *place)


def _stroke_table(stroke: Stroke) -> _Stroke:
    timing = stroke.timing
    numbers = asdict(timing if isinstance(timing, TwoSidedTiming | LiteralTiming) else timing.lognormal)
    if numbers.get("coverage") == FULL_COVERAGE:
        del numbers["coverage"]
    return _Stroke(arc_angle=stroke.arc_angle, tilt=stroke.tilt, **numbers)


def _given(table: Any) -> dict[str, Any]:
    return {name: value for name, value in asdict(table).items() if value is not None}


def _lines(table: Any) -> Iterator[str]:
    """The lines of a record or mapping: its own fields with their units, then the tables in it."""
    is_record = is_dataclass(table)
    units = fields_of(type(table)) if is_record else {}
    for name in (row.name for row in fields(table)) if is_record else table:
        value = getattr(table, name) if is_record else table[name]
        unit = f"  # {units[name].unit}" if name in units and units[name].unit else ""
        if isinstance(value, Mapping) or is_dataclass(value):
            yield from ("", f"[{name}]", *_lines(value)) if value else ()
        elif name == "strokes":
            for stroke in value:
                yield from ("", "[[strokes]]", *_lines(stroke))
        elif name == "target_points":
            yield from (f"{name} = [{unit}", *(f"    {toml_value(point)}," for point in value), "]")
        elif value is not None and (name, value) != ("blend", 0.0):
            key = name if re.fullmatch("[A-Za-z0-9_-]+", name) else toml_value(name)
            yield f"{key} = {toml_value(value)}{unit}"
