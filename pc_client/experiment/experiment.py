"""What is to be done: plans, runs of each, the folder; in words for the people beside the arm.

All that can be refused is refused here, before the arm moves: plans for another arm or cell, a folder in use.
"""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pc_client.errors import ClientError, RecordingError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import RobotModel
from pc_client.planning.plan import Plan
from pc_client.recording.recording import load_recording
from ur_hil.cell import Cell

_SHORTEST_HEAD = 1024
"""A recording that is shorter [bytes] has no rows."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """What is to be done: the movements in order, runs of each, the folder of the recordings.

    Attributes:
        overwrite: replace simulated recordings of the same names.

    Raises:
        ClientError: nothing to repeat, two plans of one name, or a plan was made for another arm or another
            cell.
    """

    model: RobotModel
    planned: tuple[Plan, ...]
    repeat: int
    out: Path
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.repeat < 1 or not self.planned:
            n = len(self.planned)
            raise ClientError(f"{self.repeat} runs of {n} movements is nothing to do; give at least one")
        names = [plan.movement.name for plan in self.planned]
        for name, plan in zip(names, self.planned, strict=True):
            if names.count(name) > 1:
                raise ClientError(
                    f"two plans are called {name!r}: their recordings would overwrite each other; rename one"
                )
            report = plan.joints.report
            if report.robot != self.model.name or report.cell != self.model.cell:
                raise ClientError(
                    f"{name} was planned for a {_with_load(ROBOTS[report.robot].title, report.cell)}, "
                    f"this arm is a {_with_load(self.model.title, self.model.cell)}: plan it for this arm"
                )

    def recording_path(self, planned: Plan, repetition: int) -> Path:
        """The file of one run; repetitions count from 1."""
        return self.out / f"{planned.movement.name}_r{repetition}.mcap"


def _with_load(title: str, cell: Cell) -> str:
    """An arm, what it carries and what stands around it, for people."""
    centre = ", ".join(f"{1e3 * x:g}" for x in cell.tool.centre_of_gravity)
    load = f"payload {cell.tool.mass:g} kg at ({centre}) mm"
    return f"{title}, {load}, {cell.tool.tcp_text} ({cell.summary})"


def check_folder(experiment: Experiment) -> list[Path]:
    """Refuse a folder with recordings that this experiment must not replace; nothing is changed.

    Only simulated ones may be replaced, with `overwrite`: they can be made again by the seed, those of a
    real arm cannot, and where it is not known, the arm may have been a real one.

    Returns:
        The files that this experiment replaces.

    Raises:
        RecordingError: the folder cannot be read, or holds recordings of another experiment, of an arm that
            is not known to be simulated, or, without `overwrite`, of this experiment.
    """
    ours = {
        experiment.recording_path(planned, k + 1)
        for planned in experiment.planned
        for k in range(experiment.repeat)
    }
    try:
        old = sorted(experiment.out.glob("*.mcap"))
        if foreign := [path.name for path in old if path not in ours]:
            raise RecordingError(
                f"{experiment.out} holds recordings of another experiment ({foreign[0]}); "
                "give another folder, or delete them"
            )
        for path in old:
            _refuse_to_lose(path, experiment.overwrite)
    except (OSError, ValueError) as error:
        raise _unusable(experiment, error) from error
    return old


def clear_folder(experiment: Experiment) -> None:
    """Make the folder ready: create it, take away the recordings that this experiment replaces.

    Raises:
        RecordingError: see `check_folder`; or the folder cannot be written.
    """
    old = check_folder(experiment)
    try:
        experiment.out.mkdir(parents=True, exist_ok=True)
        for path in old:
            path.unlink()
        tempfile.TemporaryFile(dir=experiment.out).close()  # refused here, or when the arm has moved
    except (OSError, ValueError) as error:
        raise _unusable(experiment, error) from error


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder for recordings that are not asked for, in the temporary folder of the system.

    It is removed, but after an error it stays with the recordings that it holds, and the error names it.
    """
    folder = Path(tempfile.mkdtemp(prefix="ur-client-incident-"))
    try:
        yield folder
    except BaseException as error:
        if not any(folder.iterdir()):
            folder.rmdir()
        elif not any(str(folder) in note for note in getattr(error, "__notes__", ())):
            error.add_note(f"recorded until then: {folder}")
        raise
    shutil.rmtree(folder, ignore_errors=True)


def _unusable(experiment: Experiment, error: OSError | ValueError) -> RecordingError:
    why = getattr(error, "strerror", None) or error
    return RecordingError(f"cannot use the folder {str(experiment.out)!r}: {why}")


def _refuse_to_lose(path: Path, overwrite: bool) -> None:
    try:
        provenance = load_recording(path).provenance
    except RecordingError as error:
        if path.stat().st_size < _SHORTEST_HEAD:  # cut off before it said anything: nothing is lost with it
            return
        raise RecordingError(f"{error}; it is not overwritten, give another folder") from error
    if not provenance.simulated:
        whose = "of a real arm" if provenance.simulated is False else "of an arm that may be a real one"
        raise RecordingError(
            f"{path} is a recording {whose} ({provenance.origin.says}); it is not overwritten, "
            "give another folder"
        )
    if not overwrite:
        raise RecordingError(f"{path} exists: give another folder, or --overwrite (overwrite=True)")


def experiment_text(experiment: Experiment) -> str:
    """Describe in a few lines what the arm is going to do: box of motion, top speeds, duration, margins.

    Of all movements the worst is shown.
    """
    reports = {planned.movement.name: planned.joints.report for planned in experiment.planned}
    low = np.min([report.box_min for report in reports.values()], axis=0)
    high = np.max([report.box_max for report in reports.values()], axis=0)
    fastest = max(reports, key=lambda name: reports[name].tcp_speed.value)
    tightest = max(reports, key=lambda name: reports[name].joint_speed.share)
    nearest = min(reports, key=lambda name: reports[name].joint_range.value)
    joint_speed, joint_range = reports[tightest].joint_speed, reports[nearest].joint_range
    clearances = zip(*(report.clearance for report in reports.values()), strict=True)
    least = [min(same_kind, key=lambda one: one.extreme.value) for same_kind in clearances]
    moving = experiment.repeat * sum(report.duration for report in reports.values())
    axes = "  ".join(f"{axis} {a:.3f}..{b:.3f}" for axis, a, b in zip("xyz", low, high, strict=True))
    return "\n".join(
        (
            f"{_count(len(reports), 'movement')}, {_count(experiment.repeat, 'run')} of each, "
            f"on a {experiment.model.title}, {experiment.model.cell.tool.tcp_text}",
            f"  box of motion   {axes} m, robot base frame",
            f"  duration        {moving:.0f} s of movement, plus a slow approach before each",
            f"  top TCP speed   {reports[fastest].tcp_speed.value:.3f} m/s ({fastest})",
            f"  top joint speed {np.degrees(joint_speed.value):.0f} deg/s, {joint_speed.joint_name} "
            f"({tightest}), {joint_speed.share:.0%} of what is allowed",
            f"  joint range     nearest to its end: {joint_range.joint_name} ({nearest}), "
            f"{np.degrees(joint_range.value):.0f} deg away",
            f"  cell            {experiment.model.cell.summary}",
            *(f"  nearest         {clearance.text}" for clearance in least if clearance.text),
            "  before the first movement all joints turn to and fro by 1 degree to find the loop's delay",
        )
    )


def _count(n: int, what: str) -> str:
    return f"{n} {what}" if n == 1 else f"{n} {what}s"
