"""Recordings in place of a robot: the arm, its reference and their speeds, with a bar of time.

Several recordings stand beside each other and begin their movements together. Without a server the same scene
is a page: `save_page` writes the motion into it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
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
from ur_pendant.drawing import ArmDrawing, Colour
from ur_pendant.server import WindowError

_COLOURS = (
    ("blue", (0, 90, 160)),
    ("orange", (200, 90, 0)),
    ("green", (0, 130, 80)),
    ("purple", (150, 60, 140)),
)
"""Of what was measured, a recording each; the reference is grey."""
_GREY = (150, 150, 150)
_BESIDE = 1.0  # from one arm to the next [m]
_MOST_POINTS = 600  # of a curve: a panel is hardly wider
_FRAMES = 25.0  # a second, in a page without a server
_SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1/1": 1.0, "2/1": 2.0}


class Track(NamedTuple):
    """What is shown of a recording.

    Attributes:
        desired_speed: (n,) of the reference's TCP [m/s].
        error: (n,) distance between TCP and reference [mm].
    """

    title: str
    model: RobotModel
    run: Run
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
    desired = run.ref_tcp_position
    velocity = np.gradient(desired, run.t, axis=0) if len(run.t) > 1 else np.zeros_like(desired)
    return Track(
        f"{whose.movement} {whose.repetition}, {whose.controller}, {whose.arm}",
        robot_model(name, cell),
        run,
        np.linalg.norm(velocity, axis=1),
        1e3 * np.linalg.norm(run.tcp_pose[:, :3] - desired, axis=1),
    )


class RecordingsWindow:
    """The scene and the controls of recordings; `update` lets time pass."""

    def __init__(self, server: viser.ViserServer, tracks: Sequence[Track]) -> None:
        self._tracks, gui = tracks, server.gui
        self._begin = min(float(track.run.t[0]) for track in tracks)
        self._end = max(float(track.run.t[-1]) for track in tracks)
        self._arms: list[tuple[ArmDrawing, ArmDrawing]] = []
        speeds, errors = [], []
        for k, track in enumerate(tracks):
            name, colour = _COLOURS[k % len(_COLOURS)]
            self._arms.append(self._draw(server.scene, k, track, colour))
            gui.add_text(name, initial_value=track.title[:200], disabled=True)
            speeds.append(("reference", _GREY, track.run.t, track.desired_speed))
            speeds.append((name, colour, track.run.t, track.run.tcp_speed))
            errors.append((name, colour, track.run.t, track.error))
        begin = max(0.0, self._begin)
        self._bar = gui.add_slider("time [s]", self._begin, self._end, 0.001, begin)
        self._plays = gui.add_checkbox("play", initial_value=False)
        self._speed = gui.add_dropdown("speed", tuple(_SPEEDS), initial_value="1/1")
        self._plots = [
            _Plot(server.gui, "TCP speed [m/s]", speeds),
            _Plot(server.gui, "distance to the reference [mm]", errors),
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
        for (_, _, run, _, _), (actual, desired) in zip(self._tracks, self._arms, strict=True):
            k = min(int(np.searchsorted(run.t, moment)), len(run.t) - 1)
            actual.show(run.q[k])
            desired.show(run.ref_q[k])
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

    def _draw(
        self, scene: viser.SceneApi, k: int, track: Track, colour: Colour
    ) -> tuple[ArmDrawing, ArmDrawing]:
        """Draw a recording's arm, its reference, and both paths."""
        root, run = f"/recording{k}", track.run
        scene.add_grid("/floor", 4.0, 4.0, cell_size=0.1, section_size=0.5)
        scene.add_frame(root, show_axes=False, position=(0.0, -_BESIDE * k, 0.0))
        paths = (("path", run.tcp_pose[:, :3], colour), ("desired_path", run.ref_tcp_position, _GREY))
        for name, path, own in paths:
            points = path[:: len(path) // _MOST_POINTS + 1]
            segments = np.stack((points[:-1], points[1:]), axis=1)
            scene.add_line_segments(f"{root}/{name}", segments, own, thickness=2.0, thickness_units="screen")
        actual = ArmDrawing(scene, f"{root}/arm", track.model, colour)
        return actual, ArmDrawing(scene, f"{root}/desired", track.model, _GREY, 0.25)


class _Plot:
    """Curves (label, colour, times, values), and a line at the moment that is shown."""

    def __init__(
        self, gui: viser.GuiApi, title: str, curves: Sequence[tuple[str, Colour, Array, Array]]
    ) -> None:
        times = [t for _, _, t, _ in curves]
        self._t = np.linspace(min(t[0] for t in times), max(t[-1] for t in times), _MOST_POINTS)
        self._rows = [np.interp(self._t, t, values) for _, _, t, values in curves]
        self._shown = -1
        drawn = [{"label": label, "stroke": f"rgb{colour}"} for label, colour, _, _ in curves]
        self._plot = gui.add_uplot(
            (self._t, *self._rows, np.zeros_like(self._t)),
            ({"label": "t"}, *drawn, {"label": "now", "stroke": "black"}),
            title=title,
            scales={"x": {"time": False}, "y": {"auto": True}},
            aspect=1.6,
        )

    def mark(self, moment: float) -> None:
        """Draw the line at a moment [s]."""
        at = min(int(np.searchsorted(self._t, moment)), len(self._t) - 1)
        if at != self._shown:
            self._shown, line = at, np.zeros_like(self._t)
            line[at] = np.max(self._rows)
            self._plot.data = (self._t, *self._rows, line)
