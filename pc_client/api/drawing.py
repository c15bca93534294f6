"""`drawing`: a human drawing as strokes, placed and slowed down for an arm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from pc_client.arm import Arm
from pc_client.drawing.drawing import Drawing, make_drawing
from pc_client.drawing.placement import PlacementOptions
from pc_client.errors import RecordingError
from pc_client.extraction.extract import extract
from pc_client.extraction.pen import PenRecording, on_one_axis, ordered_part, read_recording
from pc_client.movements.geometry import WORKING_BOXES

__all__ = ["drawing"]


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
    options = PlacementOptions(plane=plane, size=size, box=WORKING_BOXES[arm.model.name])
    return make_drawing(extract(recording), name, arm.model, options, slower)


def _recording(name: str, parts: Sequence[tuple[ArrayLike, ArrayLike]]) -> PenRecording:
    ordered = [ordered_part(t, p) for t, p in parts]
    kept = [part for part, _ in ordered if part is not None]
    if not kept:
        raise RecordingError(f"{name}: no samples; give parts of times (n,) and positions (n, 2)")
    return on_one_axis(name, kept, [remark for _, remarks in ordered for remark in remarks])
