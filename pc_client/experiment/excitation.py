"""The loop of this session: stream the small excitation, evaluate what came back.

The controller uses no other data about the arm's dynamics than those found here; it is the same for all
movements of the experiment.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pc_client.arrays import Array
from pc_client.control.controller import Controller
from pc_client.control.identification import BRISK_PULSE, PULSE, Excitation, estimate_delay, identify_loop
from pc_client.control.learning import LearningFilter, design_filter
from pc_client.control.loop import LEAST_GAIN_MARGIN, LoopMargins, LoopModel, loop_margins
from pc_client.control.reference import ReferenceTable, RunRecipe
from pc_client.control.tracker import Tracker, TrackerStep
from pc_client.driver.session import UrDriver
from pc_client.driver.velocity_stream import StreamLog
from pc_client.errors import DriverError, GainMarginError
from pc_client.experiment.prediction import posture_complaint, way_to_rest
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.model import RobotModel
from pc_client.planning.limits import limits_of

_LEAD, _SETTLE = 0.1, 0.3

_N_CHECKED = 65
"""Postures of the excitation that are checked: 16 to a pulse, less than 4 mrad apart."""

_RETURN_TOLERANCE = 2e-3
"""How far from where it began the excitation may leave a joint [rad]."""


@dataclass(frozen=True, slots=True)
class Identification:
    """What is known of the loop, and what the controller uses of it.

    Attributes:
        loop: dead time and lag apart, for a controller that uses them; else the delay alone.
        learning: the filter of a controller with ILC; None without.
    """

    loop: LoopModel
    margins: LoopMargins
    learning: LearningFilter | None

    @property
    def delay(self) -> float:
        """Dead time and lag as one [s]."""
        return self.loop.delay

    def __str__(self) -> str:
        """What the loop is, and how far from oscillating."""
        margins, learning = self.margins, self.learning
        known = (
            f"loop delay: {self.delay * 1e3:.1f} ms; gain margin {margins.gain:.1f}, phase margin "
            f"{margins.phase_deg:.0f} deg, delay margin {margins.delay * 1e3:.0f} ms"
        )
        if learning is None:
            return known
        return (
            f"{known}\nlearning: {self.loop}; up to {learning.cut_off:.0f} Hz (set by the "
            f"{learning.limited_by}), contraction {learning.contraction:.2f}"
        )

    def facts(self) -> Mapping[str, float | str]:
        """Return what belongs into provenance and report, by name; what was not identified is absent."""
        facts: dict[str, float | str] = {}
        if self.loop.spread is not None:
            facts |= {
                "dead_time_s": self.loop.dead_time,
                "lag_s": self.loop.lag,
                "joint_spread_s": self.loop.spread,
            }
        facts |= {
            "gain_margin": self.margins.gain,
            "phase_margin_deg": self.margins.phase_deg,
            "delay_margin_s": self.margins.delay,
            "sensitivity_peak": self.margins.peak,
        }
        if self.learning is not None:
            facts |= {
                "learning_cut_off_hz": self.learning.cut_off,
                "learning_limited_by": self.learning.limited_by,
                "learning_contraction": self.learning.contraction,
                "learning_noise_share": self.learning.noise_share,
            }
        return facts


def identify(driver: UrDriver, config: Controller, model: RobotModel) -> Identification:
    """Identify the loop where the arm stands; it moves less than one degree and comes back.

    Args:
        driver: a session; the arm rests.
        config: the controller that will be used: its acceleration is part of the loop, its gains are checked.

    Raises:
        DriverError: the excitation leads out of the limits, the stream broke, or the arm did not follow.
        GainMarginError: the controller would be unstable, or nearly.
    """
    period = driver.info.period
    q_start = driver.actual_q()
    check_excitation(q_start, config, model)
    # Feed-forward alone, its mean over each cycle: the integral of the commands ends exactly where it began.
    open_loop = replace(
        config, name="excitation", gain_p=0.0, gain_i=0.0, uses_preview=True, compensates_lag=False
    )
    excitation = _excitation(q_start, config)
    at_once = RunRecipe(open_loop, LoopModel.of_delay(0.0, 0.0), period)
    table = ReferenceTable(excitation, at_once, lead=_LEAD, settle=_SETTLE)
    log: StreamLog[TrackerStep] = StreamLog()
    report = driver.stream(Tracker(table, open_loop, model), log, acceleration=config.speedj_acceleration)
    t, q, qd_cmd = log.columns("timestamp", "actual_q")
    try:
        loop = (identify_loop if _needs_lag(config) else estimate_delay)(t, qd_cmd, q, period)
        most = float(np.abs(driver.actual_q() - q_start).max())
        if not most <= _RETURN_TOLERANCE:
            raise DriverError(
                f"the excitation left a joint {most:.4f} rad from where it began, "
                f"allowed is {_RETURN_TOLERANCE} rad"
            )
    except DriverError as error:
        if late := report.late_frames + report.lost_frames:
            error.add_note(f"{late} of {len(t)} commands came late: is the computer or network too busy?")
        raise
    margins = loop_margins(loop, config.gain_p, config.gain_i, period)
    if not margins.gain >= LEAST_GAIN_MARGIN:
        raise GainMarginError(
            f"with a loop delay of {loop.delay * 1e3:.0f} ms the controller {config.title!r} has a gain "
            f"margin of {margins.gain:.2f}, needed is {LEAST_GAIN_MARGIN}: give it smaller gains",
            margin=margins.gain,
            delay=loop.delay,
        )
    return Identification(loop, margins, learning_filter(RunRecipe(config, loop, period)))


def check_excitation(q_start: Array, config: Controller, model: RobotModel) -> None:
    """Check the excitation at a posture (6,) [rad], and the way to rest from each of its points.

    Raises:
        DriverError: it leads out of a joint range, or too near to floor, arm or cell.
    """
    excitation = _excitation(q_start, config)
    motion = [excitation.at(float(t)) for t in np.linspace(0.0, excitation.duration, _N_CHECKED)]
    q, qd = (np.array(rows) for rows in zip(*motion, strict=True))
    if complaint := posture_complaint(clearance_model(model), limits_of(model), way_to_rest(model, q, qd)):
        raise DriverError(
            f"the loop cannot be identified at the start of the first movement: {complaint}; "
            "move the movement's start away from it"
        )


def _excitation(q_start: Array, config: Controller) -> Excitation:
    return Excitation(q_start.tolist(), BRISK_PULSE if _needs_lag(config) else PULSE)


def _needs_lag(config: Controller) -> bool:
    return config.compensates_lag or config.compensates_gear or config.uses_ilc


def learning_filter(recipe: RunRecipe) -> LearningFilter | None:
    """The filter of a controller with ILC.

    Raises:
        DriverError: learning would not converge for every loop within the spread of the identified one.
    """
    if not recipe.controller.uses_ilc:
        return None
    learning = design_filter(recipe)
    if not learning.contraction < 1.0:
        raise DriverError(
            f"learning would not converge: from run to run an error may grow by {learning.contraction:.2f}, "
            f"allowed is less than 1; single joints differ too much from the loop ({recipe.loop}): use "
            "--controller preview"
        )
    return learning
