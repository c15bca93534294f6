"""What is to be done: plans, runs of each, the folder; in words for the people beside the arm.

All that can be refused is refused here, before the arm moves: plans for another arm or cell, a folder in use.
"""

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pc_client.errors import ClientError, RecordingError
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import RobotModel
from pc_client.movements.movement import load_motion
from pc_client.planning.checks import PlanReport
from pc_client.planning.plan import Motion, Plan
from pc_client.recording.recording import load_recording
from protocol.ur_types import JOINT_NAMES

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
        if self.repeat < 1:
            raise ClientError(f"{self.repeat} runs of each movement is nothing to do; give at least one")
        names = [plan.movement.name for plan in self.planned]
        for name, plan in zip(names, self.planned, strict=True):
            if names.count(name) > 1:
                raise ClientError(
                    f"two plans are called {name!r}: their recordings would overwrite each other; rename one"
                )
            report = plan.joints.report
            if report.robot != self.model.name or report.cell != self.model.cell:
                raise ClientError(
                    f"{name} was planned for a {ROBOTS[report.robot].title} ({report.cell.summary}), "
                    f"this arm is a {self.model.title} ({self.model.cell.summary}): "
                    "plan it for this arm"
                )

    def recording_path(self, planned: Plan, repetition: int) -> Path:
        """The file of one run; repetitions count from 1."""
        return self.out / f"{planned.movement.name}_r{repetition}.mcap"


def load_movements(sources: Sequence[str | Path]) -> list[Motion]:
    """Load movements of one experiment, by their names in the library or their files.

    Raises:
        MovementError: a movement is unknown or makes no sense.
        ClientError: none is given.
    """
    if not sources:
        raise ClientError("no movement is given; name at least one")
    return [load_motion(source) for source in sources]


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
    except OSError as error:
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
    except OSError as error:
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
            error.add_note(f"recordings of the runs before: {folder}")
        raise
    shutil.rmtree(folder, ignore_errors=True)


def _unusable(experiment: Experiment, error: OSError) -> RecordingError:
    return RecordingError(f"cannot use the folder {experiment.out}: {error.strerror or error}")


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
    moving = experiment.repeat * sum(report.duration for report in reports.values())
    axes = "  ".join(f"{axis} {a:.3f}..{b:.3f}" for axis, a, b in zip("xyz", low, high, strict=True))
    return "\n".join(
        (
            f"{_count(len(reports), 'movement')}, {_count(experiment.repeat, 'run')} of each, "
            f"on a {experiment.model.title}, {experiment.model.cell.tool.tcp_text}",
            f"  box of motion   {axes} m, robot base frame",
            f"  duration        {moving:.0f} s of movement, plus a slow approach before each",
            f"  top TCP speed   {reports[fastest].tcp_speed.value:.3f} m/s ({fastest})",
            f"  top joint speed {np.degrees(joint_speed.value):.0f} deg/s, {_joint(joint_speed.joint)} "
            f"({tightest}), {joint_speed.share:.0%} of what is allowed",
            f"  joint range     nearest to its end: {_joint(joint_range.joint)} ({nearest}), "
            f"{np.degrees(joint_range.value):.0f} deg away",
            f"  cell            {experiment.model.cell.summary}",
            *_clearances(reports.values()),
            "  before the first movement all joints turn to and fro by 1 degree to find the loop's delay",
        )
    )


def _clearances(reports: Iterable[PlanReport]) -> Iterator[str]:
    """Yield what comes nearest in all movements: to the floor, to itself, to the cell."""
    for same_kind in zip(*(report.clearances for report in reports), strict=True):
        least = min(same_kind, key=lambda clearance: clearance.extreme.value)
        if least.text:
            yield f"  nearest         {least.text}"


def _count(n: int, what: str) -> str:
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def _joint(index: int | None) -> str:
    return "" if index is None else JOINT_NAMES[index]
