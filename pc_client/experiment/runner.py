"""Runs an experiment on one session: for every movement approach, stream, record, as often as asked.

The approach is streamed like a run, so the arm stops when commands stop. Whatever ends an experiment early,
what is recorded until then stays readable.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import zip_longest
from pathlib import Path

import numpy as np

from pc_client.control.controller import APPROACH, Controller
from pc_client.control.gear import GearObserver
from pc_client.control.reference import ReferenceTable, RunRecipe
from pc_client.control.tracker import ControlLaw, Tracker, TrackerStep
from pc_client.driver.session import UrDriver
from pc_client.driver.velocity_stream import StreamLog, StreamReport
from pc_client.driver.watchdog import require
from pc_client.errors import LOG, RECORDED, DriverError
from pc_client.experiment.checks import Prediction, guarded
from pc_client.experiment.experiment import Experiment, clear_folder
from pc_client.experiment.identification import Identification, check_excitation, identify
from pc_client.experiment.preflight import preflight
from pc_client.experiment.repetitions import Repetitions
from pc_client.kinematics.model import RobotModel
from pc_client.planning.approach import Approach, plan_approach
from pc_client.planning.plan import JointPlan, Plan
from pc_client.recording.arm_view import arm_tree
from pc_client.recording.provenance import Provenance
from pc_client.recording.recorder import Recorder
from protocol.realtime.layout import RealtimeFrame
from ur_hil import tool_version

_SETTLE = 0.8
"""Time at the end, position loop closed [s]: four time constants of the feedback."""

_ARRIVAL_TOLERANCE = 5e-3
"""Largest distance of a joint from the posture after an approach [rad]; a blocked arm is far off."""

_NO_MOVE = 1e-4
"""An approach shorter than this [rad] is not run."""


_COUNTS = ("n_commands", "late_frames", "lost_frames", "stops", "robot_time")
_TIMES = ("wall_time", "computing_time", "slowest_command")
"""What a recording has of its stream; times only in real time: equal runs in lockstep give equal bytes."""


_Guarded = tuple[RunRecipe, Prediction | None]


@dataclass(slots=True)
class ExperimentReport:
    """What an experiment came to.

    Attributes:
        delay: the identified loop and its margins.
        remarks: one line for each warning, and for each run in which nothing could be learned or used.
    """

    delay: Identification
    paths: list[Path] = field(default_factory=list)
    streams: list[StreamReport] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


class ExperimentRunner:
    """Runs one experiment.

    Args:
        driver: a session with the robot; it stays open.
        law: computes the commands in place of the controller, which is the same for all runs.
    """

    def __init__(
        self, driver: UrDriver, experiment: Experiment, config: Controller, law: ControlLaw | None = None
    ) -> None:
        self._law = law
        self._driver = driver
        self._experiment = experiment
        self._config = config
        self._arm = arm_tree(experiment.model.description)
        self._signals = [(column.name, column.count, column.unit) for column in driver.layout.columns]

    def run(self) -> ExperimentReport:
        """Do everything.

        Raises:
            ClientError: a check failed or the robot stopped; the arm rests, earlier recordings are complete.
        """
        experiment, driver = self._experiment, self._driver
        require(preflight(driver.report(), experiment.model))
        # The loop is identified where the first run begins; that run needs no further approach.
        first = self._plan_approach(experiment.planned[0].joints)
        check_excitation(first.plan.start_q, self._config, experiment.model)
        before = self._guarded(RunRecipe.first(self._config, driver.info.period))
        clear_folder(experiment)
        LOG.info("robot: %s", driver.info)
        there: JointPlan | None = self._approach(first)
        found = identify(driver, self._config, experiment.model)
        LOG.info("%s", found)
        report = ExperimentReport(found)
        gears = GearObserver(found.loop, driver.info.period)
        recipes = self._guarded(RunRecipe(self._config, found.loop, driver.info.period), before)
        for planned, (recipe, expected) in zip(experiment.planned, recipes, strict=True):
            name = planned.movement.name
            repetitions = Repetitions(recipe, found.learning, experiment.model)
            for repetition in range(1, experiment.repeat + 1):
                plan = self._approach(self._plan_approach(planned.joints)) if there is None else there
                there = None
                if self._config.compensates_gear:
                    repetitions.renew(gears.model)
                LOG.debug("%s, run %d", name, repetition)
                path = experiment.recording_path(planned, repetition)
                provenance = self._provenance(planned, repetition, found)
                stream = self._record(path, planned, plan, provenance, expected, repetitions, gears)
                report.paths.append(path)
                report.streams.append(stream)
                LOG.debug(RECORDED, path)
                if stream.trouble:
                    repetitions.remarks.append(f"run {repetition}: {stream.trouble}")
                    LOG.warning("%s: %s", name, repetitions.remarks[-1])
            report.remarks += [expected.doubt] if expected and expected.doubt else []
            report.remarks += [f"{name}: {remark}" for remark in repetitions.remarks]
        return report

    def _plan_approach(self, plan: JointPlan) -> Approach:
        return plan_approach(plan, self._driver.actual_q(), model=self._experiment.model)

    def _approach(self, approach: Approach) -> JointPlan:
        """Move slowly to the start of a plan; returns it in the turns where the arm is."""
        LOG.debug("%s: to the start", approach.plan.name)
        run_approach(self._driver, approach, self._experiment.model)
        return approach.plan

    def _guarded(self, recipe: RunRecipe, told: Sequence[_Guarded] = ()) -> list[_Guarded]:
        """The recipe of each movement and its prediction; warns of what was not told before.

        What a user's law makes of a movement is not known: the tolerances of its controller stay.
        """
        plans, model = [one.joints for one in self._experiment.planned], self._experiment.model
        if self._law is not None:
            return [(recipe, None)] * len(plans)
        found = [guarded(plan, recipe, model) for plan in plans]
        for (_, now), (_, then) in zip_longest(found, told, fillvalue=(recipe, None)):
            if now and now.doubt and not (then and then.doubt):
                LOG.warning(now.doubt)
        return found

    def _record(
        self,
        path: Path,
        planned: Plan,
        plan: JointPlan,
        provenance: Provenance,
        expected: Prediction | None,
        repetitions: Repetitions,
        gears: GearObserver,
    ) -> StreamReport:
        """Stream one run into one file; the repetitions and the gears learn from it."""
        table, recipe = repetitions.table(plan, planned.movement), repetitions.recipe
        config = recipe.controller
        learns = config.uses_ilc or config.compensates_gear
        log: StreamLog[TrackerStep] | None = StreamLog() if learns else None
        now = time.time_ns if provenance.pace == "realtime" else None
        with Recorder(path, provenance, self._signals, arm=self._arm, now=now) as recorder:
            stream = self._driver.stream(
                Tracker(table, config, self._experiment.model, self._law),
                _row_sink(recorder, log),
                acceleration=config.speedj_acceleration,
            )
            told = [line for line in (expected and expected.doubt, stream.trouble) if line]
            recorder.close(
                {
                    **{
                        name: getattr(stream, name) for name in (_COUNTS if now is None else _COUNTS + _TIMES)
                    },
                    "expected_snr_db": expected and expected.snr_db,
                    "warnings": told,
                    "learned_from": repetitions.learned_from,
                    "gear_waves": 0 if recipe.gear is None else recipe.gear.n_waves,
                }
            )
        if log is not None:
            # Waves are a mean over thousands of frames: a command that came late is no harm, a gap is.
            if not stream.lost_frames:
                q, qd_cmd = log.columns("actual_q")
                gears.take(qd_cmd, q)
            repetitions.take(provenance.repetition, log, stream)
        return stream

    def _provenance(self, planned: Plan, repetition: int, found: Identification) -> Provenance:
        info, movement = self._driver.info, planned.movement
        points = tuple((float(x), float(y), float(z)) for x, y, z in movement.target_points)
        return Provenance(
            movement=movement.name,
            kind=movement.kind,
            repetition=repetition,
            controller=self._config.title,
            robot_model=info.model,
            firmware=str(info.version),
            serial=info.serial,
            simulated=info.simulated,
            seed=info.seed,
            pace="lockstep" if info.lockstep else "realtime",
            client_version=tool_version(),
            cycle_time_s=info.period,
            identified_delay_s=found.delay,
            loop=dict(found.facts()),
            controller_config=asdict(self._config),
            movement_text=planned.text,
            target_points=points,
            cell_text=self._experiment.model.cell.text,
        )


def _row_sink(
    recorder: Recorder, log: StreamLog[TrackerStep] | None
) -> Callable[[RealtimeFrame, TrackerStep], None]:
    """A function that records a row, keeps it for learning, and ends the run when the disk fails."""
    append = recorder.append

    def record(frame: RealtimeFrame, step: TrackerStep) -> None:
        point = step.point
        append(frame.values, step.t, point.q_array, point.qd_array, point.p, point.v, step.qd_cmd, step.phase)
        if (error := recorder.error) is not None:
            raise error
        if log is not None:
            log(frame, step)

    return record


def run_approach(driver: UrDriver, approach: Approach, model: RobotModel) -> None:
    """Move the arm along a checked path, from where it rests, and wait until it rests at the end.

    Raises:
        RobotStoppedError: the robot stopped.
        DriverError: the arm did not follow or arrive, or the connection broke; it has been stopped.
    """
    goal = approach.waypoints[-1]
    if np.abs(approach.waypoints - approach.q_from).max() < _NO_MOVE:
        return
    recipe = RunRecipe.first(APPROACH, driver.info.period)
    table = ReferenceTable(approach.motion, recipe, lead=0.0, settle=_SETTLE)
    tracker = Tracker(table, APPROACH, model)
    driver.stream(tracker, lambda frame, step: None, acceleration=APPROACH.speedj_acceleration)
    error = float(np.abs(driver.actual_q() - goal).max())
    if not error <= _ARRIVAL_TOLERANCE:
        raise DriverError(
            f"the arm is {error:.4f} rad away from the posture it was sent to, allowed is "
            f"{_ARRIVAL_TOLERANCE} rad: is it blocked?"
        )
