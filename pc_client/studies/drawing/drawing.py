"""`drawing`: what a hand drew, as a movement of an arm.

The strokes of a recording are extracted, placed in the workspace, joined with lifts between them, and slowed
down as far as the arm needs it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import find_peaks

from pc_client.arm import Arm
from pc_client.arrays import Array
from pc_client.errors import MovementError, RecordingError
from pc_client.kinematics.model import RobotModel
from pc_client.movements.movement import Movement
from pc_client.movements.sigma_lognormal import SigmaLognormal
from pc_client.movements.trajectory import Motion
from pc_client.studies.drawing.joining import Joined, factor_needed, least_factor, least_gaps, paced
from pc_client.studies.drawing.placement import Mark, Placement, PlacementOptions, inverse, marks_of, place
from pc_client.studies.extraction.extract import Extraction, extract
from pc_client.studies.extraction.pen import PenRecording, on_one_axis, ordered_part, read_recording


def drawing(
    source: str | Path | Sequence[tuple[ArrayLike, ArrayLike]],
    arm: Arm,
    *,
    name: str = "drawing",
    plane: str = "vertical",
    size: float = 0.1,
    slower: float = 1.0,
) -> Drawing:
    """Extract the lognormal strokes of a drawing and make them a movement of an arm.

    Args:
        source: a file of pen samples (docs/extraction.md), or its parts: for each time that the pen was down,
            times (n,) [s] and positions (n, 2) or (n, 3) in any unit.
        arm: that shall execute it.
        name: of the movement.
        plane: of the sheet: "vertical", "horizontal" or "inclined".
        size: longest side of the drawing [m]; never larger than the workspace.
        slower: factor of time beyond the limits of the arm, >= 1.

    Returns:
        The drawing; `arm.run(drawing.movement)` executes it.

    Raises:
        ClientError: the file or the samples are not valid, or the arm cannot execute it.
    """
    recording = read_recording(source) if isinstance(source, str | Path) else _recording(name, source)
    options = PlacementOptions(plane=plane, size=size, box=arm.model.description.working_box)
    return make_drawing(extract(recording), name, arm.model, options, slower)


def _recording(name: str, parts: Sequence[tuple[ArrayLike, ArrayLike]]) -> PenRecording:
    ordered = [ordered_part(t, p) for t, p in parts]
    kept = [part for part, _ in ordered if part is not None]
    if not kept:
        raise RecordingError(f"{name}: no samples; give parts of times (n,) and positions (n, 2)")
    return on_one_axis(name, kept, [remark for _, remarks in ordered for remark in remarks])


@dataclass(frozen=True, slots=True, eq=False)
class Drawing:
    """A drawing as the arm executes it.

    Attributes:
        marks: its parts and dots, in the recording's frame and time.
        joined: all of it in one movement, base frame, as fast as the hand was.
        factor: how many times slower than the hand the arm is.
        movement: what the arm shall do.
    """

    extraction: Extraction
    marks: tuple[Mark, ...]
    placement: Placement
    joined: Joined
    factor: float
    movement: Movement

    @property
    def flat(self) -> bool:
        """Whether the recording is flat."""
        return _is_flat(self.extraction)

    @property
    def moving(self) -> list[int]:
        """Indices of the marks that move: those of the extraction's parts, in their order."""
        return [index for index, mark in enumerate(self.marks) if mark.trajectory is not None]

    @property
    def drawn(self) -> Array:
        """What the pen draws, dots included, in the recording's frame and unit, (n, 3)."""
        return _drawn(self.extraction, self.marks)

    @property
    def trajectory(self) -> SigmaLognormal:
        """The movement's trajectory, in the time of the arm."""
        return self.joined.trajectory.stretched(self.factor)

    @property
    def delays(self) -> Array:
        """How much later after the first mark each one comes than recorded, (n_marks,), s of the hand."""
        at: Array = self.joined.shifts - self.joined.shifts[0]
        return at

    def arm_time(self, t: Array, mark: int) -> Array:
        """Time of the movement (s, arm) at times of the recording (s) that belong to a mark."""
        at: Array = (t + self.joined.shifts[mark]) * self.factor
        return at

    def recording_time(self, t: Array, mark: int) -> Array:
        """Time of the recording (s) at times of the movement (s, arm), for a mark; inverse of `arm_time`."""
        at: Array = t / self.factor - self.joined.shifts[mark]
        return at

    def points_back(self, p: Array) -> Array:
        """Points of the base frame (n, 3), m, in the recording's frame and unit."""
        return inverse(self.placement.similarity).points(p)

    def planned(self, t: Array, mark: int) -> Motion:
        """The plan at times of the recording that belong to a mark, in its frame, unit and time."""
        motion = self.joined.trajectory.evaluate(t + self.joined.shifts[mark])
        back = inverse(self.placement.similarity)
        return Motion(back.points(motion.p), back.vectors(motion.v), back.vectors(motion.a))


def make_drawing(
    extraction: Extraction,
    name: str,
    arm: RobotModel,
    options: PlacementOptions | None = None,
    slower: float = 1.0,
) -> Drawing:
    """Make a drawing ready for an arm.

    Args:
        slower: times slower than the arm's limits ask, >= 1: leaves room for a controller's corrections.

    Raises:
        MovementError: nothing in it moves, or `slower` is below 1.
        PlanningError: the arm cannot do it at any speed; the message is planning's.
    """
    if not (math.isfinite(slower) and slower >= 1.0):
        raise MovementError(f"{slower:g} times slower than the limits ask: give 1 or more")
    options = options or PlacementOptions()
    marks = marks_of(extraction)
    drawn = _drawn(extraction, marks)
    flat = _is_flat(extraction)
    placement = place(marks, drawn, options, flat=flat)
    on_arm = [mark.transformed(placement.similarity) for mark in marks]
    size = placement.similarity.scale * float(np.ptp(drawn, axis=0).max())
    joined = paced(name, on_arm, least_gaps(on_arm, size), placement.lift, arm)
    guess = float(factor_needed(name, joined, arm)[1].max())
    facts = _facts(extraction, placement, joined)

    def slowed(factor: float) -> Movement:
        trajectory = joined.trajectory.stretched(factor)
        return Movement(
            name, trajectory, _between_slow_moments(trajectory), {**facts, "slower_than_the_hand": factor}
        )

    factor = slower * least_factor(slowed, guess, arm)
    return Drawing(extraction, marks, placement, joined, factor, slowed(factor))


def spatial(p: Array) -> Array:
    """Points (n, 2) with a third coordinate 0; points (n, 3) as they are."""
    return p if p.shape[1] == 3 else np.column_stack((p, np.zeros(len(p))))


def _drawn(extraction: Extraction, marks: Sequence[Mark]) -> Array:
    lines = [spatial(part.p) for part in extraction.parts]
    return np.vstack([*lines, *(mark.first for mark in marks if mark.trajectory is None)])


def _is_flat(extraction: Extraction) -> bool:
    return bool(extraction.parts[0].p.shape[1] == 2)


def _facts(extraction: Extraction, placement: Placement, joined: Joined) -> dict[str, str | int | float]:
    return {
        "drawing": extraction.name.rpartition("/")[2],
        "plane": placement.plane,
        "metres_per_unit": placement.similarity.scale,
        "rotation_deg": float(np.degrees(placement.rotation)),
        "marks": len(joined.shifts),
        "lift_m": float(np.linalg.norm(placement.lift)),
    }


def _between_slow_moments(trajectory: SigmaLognormal) -> Array:
    """Times (s) between the speed minima of a movement, its start and its end."""
    t = np.linspace(0.0, trajectory.duration, max(200, int(500 * trajectory.duration)))
    slow, _ = find_peaks(-np.linalg.norm(trajectory.evaluate(t).v, axis=1))
    return np.diff(np.concatenate(([0.0], t[slow], [trajectory.duration])))
