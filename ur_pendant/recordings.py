"""Recordings in place of a robot: the arm, its reference and their speeds, with a bar of time.

Several recordings stand beside each other and begin their movements together. Without a server the same scene
is a page: `save_page` writes the motion into it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import viser

from pc_client.analysis.signals import Run
from pc_client.arrays import Array
from pc_client.files import FILE_KINDS
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import RobotModel, robot_model
from ur_hil.cell import NO_CELL, parse_cell
from ur_pendant.drawing import ArmDrawing
from ur_pendant.server import WindowError


class _Colour(NamedTuple):
    name: str
    rgb: tuple[int, int, int]

    @property
    def css(self) -> str:
        return f"rgb{self.rgb}"


_COLOURS = tuple(
    _Colour(*row)
    for row in (
        ("blue", (0, 90, 160)),
        ("orange", (200, 90, 0)),
        ("green", (0, 130, 80)),
        ("purple", (150, 60, 140)),
    )
)
"""Of what was measured, a recording each; the reference is grey."""

_GREY = _Colour("grey", (150, 150, 150))
_BESIDE = 1.0
"""From one arm to the next [m]."""

_MOST_POINTS = 600
"""Of a curve: a panel is hardly wider."""

_FRAMES = 25.0
"""A second, in a page without a server."""

_SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1/1": 1.0, "2/1": 2.0}


class Track(NamedTuple):
    """What is shown of a recording; times since its movement began [s], positions in the base frame [m].

    Attributes:
        speed: (n,) of the TCP [m/s].
        desired_speed: (n,) of the reference [m/s].
        error: (n,) distance between TCP and reference [mm].
    """

    title: str
    model: RobotModel
    t: Array
    q: Array
    desired_q: Array
    path: Array
    desired_path: Array
    speed: Array
    desired_speed: Array
    error: Array


def load_track(path: Path) -> Track:
    """Load a recording.

    Raises:
        RecordingError: it cannot be read, or holds too little.
        WindowError: the arm is none that the client knows.
    """
    run = Run.from_file(path)
    whose = run.recording.provenance
    name = whose.robot_model.lower()
    if name not in ROBOTS:
        raise WindowError(
            f"{path}: the arm {whose.robot_model!r} has no model; known are {', '.join(ROBOTS)}"
        )
    kind = FILE_KINDS["cell"]
    cell = parse_cell(whose.cell_text, f"cell of {path}", kind) if whose.cell_text else NO_CELL
    actual, desired = run.tcp_pose[:, :3], run.ref_tcp_position
    velocity = np.gradient(desired, run.t, axis=0) if len(run.t) > 1 else np.zeros_like(desired)
    return Track(
        f"{whose.movement} {whose.repetition}, {whose.controller}, {whose.arm}",
        robot_model(name, cell),
        run.t,
        run.q,
        run.ref_q,
        actual,
        desired,
        run.tcp_speed,
        np.linalg.norm(velocity, axis=1),
        1e3 * np.linalg.norm(actual - desired, axis=1),
    )


class RecordingsWindow:
    """The scene and the controls of recordings; `update` lets time pass."""

    def __init__(self, server: viser.ViserServer, tracks: Sequence[Track]) -> None:
        self._tracks = tracks
        self._arms = [self._draw(server.scene, k, track) for k, track in enumerate(tracks)]
        self._begin = min(float(track.t[0]) for track in tracks)
        self._end = max(float(track.t[-1]) for track in tracks)
        gui = server.gui
        for k, track in enumerate(tracks):
            gui.add_text(_COLOURS[k % len(_COLOURS)].name, initial_value=track.title[:200], disabled=True)
        begin = max(0.0, self._begin)
        self._bar = gui.add_slider(
            "time [s]", min=self._begin, max=self._end, step=0.001, initial_value=begin
        )
        self._plays = gui.add_checkbox("play", initial_value=False)
        self._speed = gui.add_dropdown("speed", tuple(_SPEEDS), initial_value="1/1")
        self._plots = [
            _Plot(server, f"{what} [{unit}]", tracks, curves)
            for what, unit, curves in (
                ("TCP speed", "m/s", lambda track: (track.desired_speed, track.speed)),
                ("distance to the reference", "mm", lambda track: (track.error,)),
            )
        ]
        self._last = time.monotonic()
        self.show(self._bar.value)

    def update(self) -> None:
        """Show the moment of the bar; while it plays, the bar moves on."""
        now = time.monotonic()
        passed, self._last = now - self._last, now
        if self._plays.value:
            moment = self._bar.value + passed * _SPEEDS[self._speed.value]
            self._bar.value = self._begin if moment > self._end else moment
        self.show(self._bar.value)

    def show(self, moment: float) -> None:
        """Show a moment [s]."""
        for track, (actual, desired) in zip(self._tracks, self._arms, strict=True):
            k = min(int(np.searchsorted(track.t, moment)), len(track.t) - 1)
            actual.show(track.q[k])
            desired.show(track.desired_q[k])
        for plot in self._plots:
            plot.mark(moment)

    def save_page(self, server: viser.ViserServer, path: Path) -> None:
        """Write the scene with its motion as a page that needs no server. WindowError if that fails."""
        page = server.get_scene_serializer()
        for moment in np.arange(self._begin, self._end, 1.0 / _FRAMES):
            self.show(float(moment))
            page.insert_sleep(1.0 / _FRAMES)
        try:
            path.write_text(page.as_html(), "utf-8")
        except OSError as error:
            raise WindowError(f"{path} cannot be written: {error.strerror}") from None

    def _draw(self, scene: viser.SceneApi, k: int, track: Track) -> tuple[ArmDrawing, ArmDrawing]:
        """Draw a recording's arm, its reference, and both paths."""
        colour = _COLOURS[k % len(_COLOURS)].rgb
        root = f"/recording{k}"
        scene.add_grid("/floor", 4.0, 4.0, cell_size=0.1, section_size=0.5)
        scene.add_frame(root, show_axes=False, position=(0.0, -_BESIDE * k, 0.0))
        for name, path, own in (
            ("path", track.path, colour),
            ("desired_path", track.desired_path, _GREY.rgb),
        ):
            points = path[_thinned(len(path))]
            segments = np.stack((points[:-1], points[1:]), axis=1)
            scene.add_line_segments(f"{root}/{name}", segments, own, thickness=2.0, thickness_units="screen")
        actual = ArmDrawing(scene, f"{root}/arm", track.model, colour)
        return actual, ArmDrawing(scene, f"{root}/desired", track.model, _GREY.rgb, 0.25)


class _Plot:
    """Curves of all recordings against time, and a line at the moment that is shown."""

    def __init__(
        self,
        server: viser.ViserServer,
        title: str,
        tracks: Sequence[Track],
        curves: Callable[[Track], tuple[Array, ...]],
    ) -> None:
        begin, end = min(t.t[0] for t in tracks), max(t.t[-1] for t in tracks)
        self._t = np.linspace(begin, end, _MOST_POINTS)
        rows, series = [], [{"label": "t"}]
        for track, colour in zip(tracks, _COLOURS * len(tracks), strict=False):
            ours = curves(track)
            for values in ours:
                is_desired = len(ours) > 1 and values is ours[0]
                drawn = _GREY if is_desired else colour
                rows.append(np.interp(self._t, track.t, values))
                series.append({"label": "reference" if is_desired else colour.name, "stroke": drawn.css})
        self._rows = tuple(rows)
        self._top = float(np.max(rows))
        series.append({"label": "now", "stroke": "black"})
        self._shown = -1
        self._plot = server.gui.add_uplot(
            (self._t, *self._rows, np.zeros_like(self._t)),
            tuple(series),
            title=title,
            scales={"x": {"time": False}, "y": {"auto": True}},
            aspect=1.6,
        )

    def mark(self, moment: float) -> None:
        """Draw the line at a moment [s]."""
        at = min(int(np.searchsorted(self._t, moment)), len(self._t) - 1)
        if at == self._shown:
            return
        self._shown = at
        line = np.zeros_like(self._t)
        line[at] = self._top
        self._plot.data = (self._t, *self._rows, line)


def _thinned(n: int) -> Array:
    """Indices of at most so many of n rows, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, _MOST_POINTS)).round().astype(int))
