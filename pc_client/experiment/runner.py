"""Runs an experiment on one session: for every movement approach, stream, record, as often as asked.

The approach is streamed like a run, so the arm stops when commands stop. Whatever ends an experiment early,
what is recorded until then stays readable.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from pc_client.control.controller import APPROACH, Controller
from pc_client.control.gear import GearObserver, MotorReference
from pc_client.control.loop import LoopModel
from pc_client.control.reference import ReferenceTable
from pc_client.control.tracker import ControlLaw, Tracker, TrackerStep
from pc_client.driver.report import RobotInfo
from pc_client.driver.session import UrDriver
from pc_client.driver.velocity_stream import StreamReport
from pc_client.errors import DriverError
from pc_client.experiment.checks import LEAD, SETTLE, guarded, shortest_loop
from pc_client.experiment.experiment import Experiment, clear_folder
from pc_client.experiment.identification import Identification, check_excitation, identify
from pc_client.experiment.preflight import preflight, require
from pc_client.experiment.repetitions import Repetitions, RunLog
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


class Observer:
    """Gets the progress of an experiment; this one ignores it. Its methods raise nothing."""

    def connected(self, info: RobotInfo) -> None:
        """A session is open."""

    def approaching(self, approach: Approach) -> None:
        """The arm begins to move to the start of a movement."""

    def identified(self, found: Identification) -> None:
        """The loop is known."""

    def running(self, name: str, repetition: int) -> None:
        """A run begins."""

    def finished(self, name: str, repetition: int, path: Path, report: StreamReport) -> None:
        """A run is recorded."""


@dataclass(slots=True)
class ExperimentReport:
    """What an experiment came to.

    Attributes:
        delay: the identified loop and its margins.
        remarks: one line for each run in which nothing could be learned or used.
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
        self,
        driver: UrDriver,
        experiment: Experiment,
        config: Controller,
        observer: Observer | None = None,
        law: ControlLaw | None = None,
    ) -> None:
        self._law = law
        self._driver = driver
        self._experiment = experiment
        self._config = config
        self._observer = Observer() if observer is None else observer
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
        self._guarded(shortest_loop(driver.info.period))
        clear_folder(experiment)
        self._observer.connected(driver.info)
        there: JointPlan | None = self._approach(first)
        found = identify(driver, self._config, experiment.model)
        self._observer.identified(found)
        configs = self._guarded(found.loop)
        report = ExperimentReport(found)
        pace = "lockstep" if driver.info.lockstep else "realtime"
        gears = GearObserver(found.loop, driver.info.period)
        for planned, config in zip(experiment.planned, configs, strict=True):
            name = planned.movement.name
            period = driver.info.period
            repetitions = Repetitions(self._config, found.loop, found.learning, experiment.model, period)
            for repetition in range(1, experiment.repeat + 1):
                plan = self._approach(self._plan_approach(planned.joints)) if there is None else there
                there = None
                if self._config.compensates_gear:
                    repetitions.renew(gears.model)
                self._observer.running(name, repetition)
                path = experiment.recording_path(planned, repetition)
                provenance = self._provenance(planned, repetition, found, pace)
                stream = self._record(path, planned, plan, config, provenance, found, repetitions, gears)
                report.paths.append(path)
                report.streams.append(stream)
                self._observer.finished(name, repetition, path, stream)
            report.remarks += [f"{name}: {remark}" for remark in repetitions.remarks]
        return report

    def _plan_approach(self, plan: JointPlan) -> Approach:
        return plan_approach(plan, self._driver.actual_q(), model=self._experiment.model)

    def _approach(self, approach: Approach) -> JointPlan:
        """Move slowly to the start of a plan; returns it in the turns where the arm is."""
        self._observer.approaching(approach)
        run_approach(self._driver, approach, self._experiment.model)
        return approach.plan

    def _guarded(self, loop: LoopModel) -> list[Controller]:
        """The controller with the tolerances of each movement on a loop; refuses what is beyond them.

        What a user's law makes of a movement is not known: its tolerances stay.
        """
        if self._law is not None:
            return [self._config] * len(self._experiment.planned)
        model, period = self._experiment.model, self._driver.info.period
        return [guarded(one.joints, self._config, model, loop, period) for one in self._experiment.planned]

    def _table(
        self, planned: Plan, plan: JointPlan, found: Identification, repetitions: Repetitions
    ) -> ReferenceTable:
        """The reference of one run, with the feed-forward that the controller makes of it."""
        config = self._config
        lookahead = found.loop.dead_time if config.compensates_lag else found.delay
        return ReferenceTable(
            plan.spline,
            period=self._driver.info.period,
            lead=LEAD,
            settle=SETTLE,
            lookahead=lookahead if config.uses_preview else None,
            motors=None if repetitions.gear is None else MotorReference(plan.spline, repetitions.gear),
            lag=found.loop.lag if config.compensates_lag else 0.0,
            learned=repetitions.learned,
            tcp=planned.movement,
        )

    def _record(
        self,
        path: Path,
        planned: Plan,
        plan: JointPlan,
        config: Controller,
        provenance: Provenance,
        found: Identification,
        repetitions: Repetitions,
        gears: GearObserver,
    ) -> StreamReport:
        """Stream one run into one file; the repetitions and the gears learn from it."""
        table = self._table(planned, plan, found, repetitions)
        if not repetitions.may_use(plan, table):
            table = self._table(planned, plan, found, repetitions)
        log = RunLog() if config.uses_ilc or config.compensates_gear else None
        now = time.time_ns if provenance.pace == "realtime" else None
        with Recorder(path, provenance, self._signals, arm=self._arm, now=now) as recorder:
            stream = self._driver.stream(
                Tracker(table, config, self._experiment.model, self._law),
                _row_sink(recorder, log),
                acceleration=config.speedj_acceleration,
            )
            recorder.close(
                {
                    "late_frames": stream.late_frames,
                    "lost_frames": stream.lost_frames,
                    "n_commands": stream.n_commands,
                    "learned_from": repetitions.learned_from,
                    "gear_waves": 0 if repetitions.gear is None else repetitions.gear.n_waves,
                }
            )
        if log is not None:
            # Waves are a mean over thousands of frames: a command that came late is no harm, a gap is.
            if not stream.lost_frames:
                gears.take(log.qd_cmd, log.q)
            repetitions.take(provenance.repetition, log, stream, LEAD, SETTLE)
        return stream

    def _provenance(self, planned: Plan, repetition: int, found: Identification, pace: str) -> Provenance:
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
            pace=pace,
            client_version=tool_version(),
            cycle_time_s=info.period,
            identified_delay_s=found.delay,
            loop=dict(found.facts()),
            controller_config=asdict(self._config),
            movement_text=planned.text,
            target_points=points,
            cell_text=self._experiment.model.cell.text,
        )


def _row_sink(recorder: Recorder, log: RunLog | None) -> Callable[[RealtimeFrame, TrackerStep], None]:
    """A function that records a row, keeps it for learning, and ends the run when the disk fails."""
    append = recorder.append

    def record(frame: RealtimeFrame, step: TrackerStep) -> None:
        point = step.point
        append(frame.values, step.t, point.q_array, point.qd_array, point.p, point.v, step.qd_cmd, step.phase)
        if (error := recorder.error) is not None:
            raise error
        if log is not None:
            log.append(frame, step)

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
    table = ReferenceTable(approach.motion, period=driver.info.period, lead=0.0, settle=_SETTLE)
    tracker = Tracker(table, APPROACH, model)
    driver.stream(tracker, lambda frame, step: None, acceleration=APPROACH.speedj_acceleration)
    error = float(np.abs(driver.actual_q() - goal).max())
    if not error <= _ARRIVAL_TOLERANCE:
        raise DriverError(
            f"the arm is {error:.4f} rad away from the posture it was sent to, allowed is "
            f"{_ARRIVAL_TOLERANCE} rad: is it blocked?"
        )
