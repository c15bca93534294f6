"""What the arm did, mapped back: in the frame, the unit and the time of the recording.

The similarity and the scaling of time are undone exactly; nothing is shifted or fitted. Of each part that
moves there are two signals: the positions at the robot's own time stamps, as they were reported, for
signal-to-noise ratios; and the same on the grid of the recording, low-passed, for everything that is
differentiated. That low-pass removes only the encoders' noise: its cut-off is twice that of the recording's
low-pass, which would flatten the speed profiles a second time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from pc_client.analysis.run import MeasuredRun
from pc_client.drawing.drawing import Drawing
from pc_client.errors import RecordingError
from pc_client.extraction.smoothing import CUTOFF_HZ, RATE_HZ, velocity
from pc_client.movements.geometry import read_only

__all__ = ["ExecutedPart", "Execution", "executed"]

#: Cut-off of the low-pass, Hz in the time of the hand, and its order; it runs forwards and backwards.
_NOISE_HZ = 2.0 * CUTOFF_HZ
_ORDER = 4
#: This much of the movement (s of the hand) before and after a part goes through the low-pass with it.
_MARGIN_S = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class ExecutedPart:
    """One part as it was executed, in the recording's frame, unit and time.

    Attributes:
        t: the part's own grid, (n,), s.
        p: low-passed positions on it, (n, 3).
        v: their velocities, (n, 3), per second.
        frame_t: the robot's time stamps while the pen was down, (m,), s of the recording.
        frame_p: positions as reported then, (m, 3).
    """

    t: NDArray[np.float64]
    p: NDArray[np.float64]
    v: NDArray[np.float64]
    frame_t: NDArray[np.float64]
    frame_p: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Execution:
    """One run of a drawing.

    Attributes:
        run: the recording and what is measured on every movement.
        parts: those that move, in order.
        t: all of the movement on a uniform grid, (k,), s of the hand since it began.
        p: TCP positions then, through the same low-pass, (k, 3), m, base frame.
        v: their velocities, (k, 3), m per s of the hand.
    """

    run: MeasuredRun
    parts: tuple[ExecutedPart, ...]
    t: NDArray[np.float64]
    p: NDArray[np.float64]
    v: NDArray[np.float64]


def executed(drawing: Drawing, run: MeasuredRun, shift: float = 0.0) -> Execution:
    """Map a run back.

    Args:
        drawing: what the run executed.
        run: the recording.
        shift: take the arm's positions this much later, s of the arm; 0 judges it as it was.

    Raises:
        RecordingError: the run ended before the drawing did.
    """
    track = run.track
    t = track.t - track.t_begin
    if t[-1] < float(drawing.joined.pen_down[-1, 1]) * drawing.factor:
        raise RecordingError(f"{run.recording.path}: ends at {t[-1]:.1f} s, before the drawing was done")
    path = CubicSpline(t - shift, track.p_actual)
    moving = [index for index, mark in enumerate(drawing.marks) if mark.trajectory is not None]
    parts = tuple(
        _part(drawing, index, part.t, path)
        for index, part in zip(moving, drawing.extraction.parts, strict=True)
    )
    whole = np.arange(0.0, drawing.joined.trajectory.duration, 1.0 / RATE_HZ)
    p = _less_noise(path(np.clip(whole * drawing.factor, path.x[0], path.x[-1])), RATE_HZ)
    return Execution(run, parts, read_only(whole), read_only(p), read_only(velocity(whole, p)))


def _less_noise(p: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Positions (n, 3) at a uniform rate, Hz of the hand, without frequencies above those of a hand."""
    sections = butter(_ORDER, _NOISE_HZ, fs=rate, output="sos")
    padding = min(len(p) - 1, round(_MARGIN_S * rate))
    smooth: NDArray[np.float64] = sosfiltfilt(sections, p, axis=0, padtype="odd", padlen=padding)
    return smooth


def _part(drawing: Drawing, mark: int, grid: NDArray[np.float64], path: CubicSpline) -> ExecutedPart:
    def positions(t: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions of the arm at times of the recording; outside the run it rests."""
        at = np.clip(drawing.arm_time(t, mark), path.x[0], path.x[-1])
        return drawing.points_back(path(at))

    step = (grid[-1] - grid[0]) / (len(grid) - 1)
    margin = round(_MARGIN_S / step)
    wide = grid[0] + step * np.arange(-margin, len(grid) + margin)
    smooth = _less_noise(positions(wide), 1.0 / step)
    inside = slice(margin, margin + len(grid))
    frame_t = drawing.recording_time(path.x, mark)
    frame_t = frame_t[(frame_t >= grid[0]) & (frame_t <= grid[-1])]
    return ExecutedPart(
        grid,
        read_only(smooth[inside]),
        read_only(velocity(wide, smooth)[inside]),
        read_only(frame_t),
        read_only(positions(frame_t)),
    )
