"""What a bystander must know and agree to before a real arm moves, in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from pc_client.experiment.prepare import Experiment
from pc_client.planning.checks import PlanReport
from protocol.ur_types import JOINT_NAMES


def experiment_text(experiment: Experiment) -> str:
    """Describe what the arm is going to do: box of motion, top speeds, duration, margins.

    Args:
        experiment: planned, not yet running.

    Returns:
        A few lines, the worst of all movements.
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
            f"on a {experiment.model.title}, TCP at the flange",
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
