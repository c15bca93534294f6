"""Runs an experiment on one session: identify; for each repetition approach, stream, record, learn.

The approach is streamed like a run, so the arm stops when commands stop. Whatever ends an experiment early,
what is recorded until then stays readable.

What one repetition hands on to the next is the memory of one movement: the learned command, gone when the
next movement begins. Only the waves of the gears, which are the arm's and not the movement's, go on to it.
Nothing is learned from a run that was not clean, and what was learned before such a run is forgotten with it.
Before anything learned is used, the whole of what would be sent is held against the limits of the plan.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import zip_longest
from math import inf
from pathlib import Path

import numpy as np

from pc_client.control.controller import APPROACH, Controller
from pc_client.control.gear import GearObserver
from pc_client.control.learning import LearningFilter, RunSignals, learn, learnable_power
from pc_client.control.reference import LEAD, ReferenceTable, RunRecipe, TcpReference
from pc_client.control.tracker import ControlLaw, Tracker, TrackerStep
from pc_client.driver.session import UrDriver
from pc_client.driver.velocity_stream import StreamLog, StreamReport
from pc_client.errors import LOG, RECORDED, DriverError
from pc_client.experiment.excitation import Identification, check_excitation, identify
from pc_client.experiment.experiment import Experiment, clear_folder
from pc_client.experiment.prediction import Prediction, broken_limit, guarded
from pc_client.kinematics.model import RobotModel
from pc_client.planning.approach import Approach, plan_approach
from pc_client.planning.plan import JointPlan, Plan
from pc_client.recording.arm_view import arm_tree
from pc_client.recording.provenance import Provenance
from pc_client.recording.recorder import Recorder
from protocol.realtime.layout import RealtimeFrame
from ur_hil import tool_version

_SETTLE = 0.8
"""Time at the end of an approach, position loop closed [s]: four time constants of the feedback."""

_ARRIVAL_TOLERANCE = 5e-3
"""Largest distance of a joint from the posture after an approach [rad]; a blocked arm is far off."""

_NO_MOVE = 1e-4
"""An approach shorter than this [rad] is not run."""

_COUNTS = ("n_commands", "late_frames", "lost_frames", "stops", "robot_time")
_TIMES = ("wall_time", "computing_time", "slowest_command")
"""What a recording has of its stream; times only in real time: equal runs in lockstep give equal bytes."""

_WORSE = 1.5
"""Growth of the learnable error from one run to the next that ends learning: the arm does not answer small
motions as the model of the loop does. Noise changes it by up to a fifth."""

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
        driver: a session with the robot, which was found fit (`preflight`); it stays open.
        law: computes the commands in place of the controller, which is the same for all runs.
    """

    def __init__(
        self, driver: UrDriver, experiment: Experiment, config: Controller, law: ControlLaw | None = None
    ) -> None:
        self._law = law
        self._driver = driver
        self._experiment = experiment
        self._model = experiment.model
        self._config = config
        self._arm = arm_tree(experiment.model.description)
        self._signals = [(column.name, column.count, column.unit) for column in driver.layout.columns]

    def run(self) -> ExperimentReport:
        """Do everything.

        Raises:
            ClientError: a check failed or the robot stopped; the arm rests, earlier recordings are complete.
        """
        experiment, driver, period = self._experiment, self._driver, self._driver.info.period
        # The loop is identified where the first run begins; that run needs no further approach.
        first = self._plan_approach(experiment.planned[0])
        check_excitation(first.plan.start_q, self._config, self._model)
        before = self._guarded(RunRecipe.first(self._config, period))
        clear_folder(experiment)
        LOG.info("robot: %s", driver.info)
        start: JointPlan | None = self._approach(first)
        found = identify(driver, self._config, self._model)
        LOG.info("%s", found)
        recipes = self._guarded(RunRecipe(self._config, found.loop, period), before)
        report, gears = ExperimentReport(found), GearObserver(found.loop, period)
        for planned, (recipe, expected) in zip(experiment.planned, recipes, strict=True):
            memory = Memory(recipe, found.learning, gears, self._model)
            for repetition in range(1, experiment.repeat + 1):
                plan = start or self._approach(self._plan_approach(planned))
                start = None
                LOG.debug("%s, run %d", planned.movement.name, repetition)
                path = experiment.recording_path(planned, repetition)
                provenance = self._provenance(planned, repetition, found)
                table = memory.table(plan, planned.movement)
                stream, log = self._record(path, provenance, table, memory, expected)
                LOG.debug(RECORDED, path)
                report.paths.append(path)
                report.streams.append(stream)
                memory.take(repetition, log, stream)
                if stream.trouble:
                    memory.remarks.append(f"run {repetition}: {stream.trouble}")
                    LOG.warning("%s: %s", planned.movement.name, memory.remarks[-1])
            report.remarks += [expected.doubt] if expected and expected.doubt else []
            report.remarks += [f"{planned.movement.name}: {remark}" for remark in memory.remarks]
        return report

    def _plan_approach(self, planned: Plan) -> Approach:
        return plan_approach(planned.joints, self._driver.actual_q(), model=self._model)

    def _approach(self, approach: Approach) -> JointPlan:
        """Move slowly to the start of a plan; returns it in the turns where the arm is."""
        LOG.debug("%s: to the start", approach.plan.name)
        run_approach(self._driver, approach, self._model)
        return approach.plan

    def _guarded(self, recipe: RunRecipe, told: Sequence[_Guarded] = ()) -> list[_Guarded]:
        """The recipe of each movement and its prediction; warns of what was not told before.

        What a user's law makes of a movement is not known: the tolerances of its controller stay.
        """
        plans = [one.joints for one in self._experiment.planned]
        if self._law is not None:
            return [(recipe, None)] * len(plans)
        found = [guarded(plan, recipe, self._model) for plan in plans]
        for (_, now), (_, then) in zip_longest(found, told, fillvalue=(recipe, None)):
            if now and now.doubt and not (then and then.doubt):
                LOG.warning(now.doubt)
        return found

    def _record(
        self,
        path: Path,
        provenance: Provenance,
        table: ReferenceTable,
        memory: "Memory",
        expected: Prediction | None,
    ) -> tuple[StreamReport, StreamLog[TrackerStep]]:
        """Stream one run into one file."""
        recipe, config = memory.recipe, memory.recipe.controller
        log: StreamLog[TrackerStep] = StreamLog()
        now = time.time_ns if provenance.pace == "realtime" else None
        with Recorder(path, provenance, self._signals, arm=self._arm, now=now) as recorder:
            stream = self._driver.stream(
                Tracker(table, config, self._model, self._law),
                _row_sink(recorder, log if memory.learns else None),
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
                    "learned_from": memory.learned_from,
                    "gear_waves": 0 if recipe.gear is None else recipe.gear.n_waves,
                }
            )
        return stream, log

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
            cell_text=self._model.cell.text,
        )


class Memory:
    """What the repetitions of one movement hand on.

    Args:
        recipe: of the movement, without anything learned.
        learning: Q; None for a controller that does not learn.
        gears: take every run; they outlive the movement.

    Attributes:
        recipe: of the coming run: with what is known of the gears, and what the run before taught.
        learned_from: repetition that it was learned from; 0: none.
        remarks: one line for each time that nothing could be learned or used, with the reason.
    """

    def __init__(
        self, recipe: RunRecipe, learning: LearningFilter | None, gears: GearObserver, model: RobotModel
    ) -> None:
        self.recipe = recipe
        self._learning = learning
        self._gears = gears
        self._model = model
        self._compensates_gear = recipe.controller.compensates_gear
        self._power = inf
        self.learned_from = 0
        self.remarks: list[str] = []

    @property
    def learns(self) -> bool:
        """Whether a run needs its log."""
        config = self.recipe.controller
        return config.uses_ilc or config.compensates_gear

    def table(self, plan: JointPlan, tcp: TcpReference) -> ReferenceTable:
        """The reference of the coming run, along the plan in the turns where the arm is.

        What is known of the gears by now is taken, but not while something is learned, which goes with the
        gears that it was learned with. The whole of what would be sent is held against the limits. Where one
        would be broken, what was learned is forgotten, and the gears are left out for the rest of this
        movement.
        """
        if self._compensates_gear and self.recipe.learned is None:
            self.recipe = replace(self.recipe, gear=self._gears.model())
        table, now = ReferenceTable(plan.spline, self.recipe, tcp), self.recipe
        if now.learned is None and now.gear is None:
            return table
        complaint = broken_limit(plan, table.commands(), now, self._model)
        if not complaint:
            return table
        self._forget(f"what was learned is not used: {complaint}")
        self.recipe, self._compensates_gear = replace(self.recipe, gear=None), False
        return ReferenceTable(plan.spline, self.recipe, tcp)

    def take(self, repetition: int, log: StreamLog[TrackerStep], stream: StreamReport) -> None:
        """Learn from a run that came to its end: nothing in its first moments of rest, nor in its last."""
        if not self.learns:
            return
        # Waves are a mean over thousands of frames: a command that came late is no harm, a gap is.
        if not stream.lost_frames:
            q, qd_cmd = log.columns("actual_q")
            self._gears.take(qd_cmd, q)
        if self._learning is None:
            return
        if stream.late_frames or stream.lost_frames:
            self._forget(
                f"run {repetition} had {stream.late_frames} late and {stream.lost_frames} lost frames: "
                "nothing learned"
            )
            return
        signals = self._run_signals(log)
        power = learnable_power(signals, self._learning, self.recipe.period)
        if self.recipe.learned is not None and power > _WORSE * self._power:
            self._forget(f"run {repetition} was worse than the one before: nothing more is learned")
            self._learning = None
            return
        self._power = power
        learned = learn(signals, self.recipe, self._learning)
        self.recipe, self.learned_from = replace(self.recipe, learned=learned), repetition

    def _forget(self, remark: str) -> None:
        """Begin the next run without anything learned from the one before."""
        self.recipe, self.learned_from = replace(self.recipe, learned=None), 0
        self.remarks.append(remark)

    def _run_signals(self, log: StreamLog[TrackerStep]) -> RunSignals:
        """A run on the grid of cycles; its time stamps may jitter about it."""
        q, qd_cmd = log.columns("actual_q")
        t = np.array([step.t for step in log.steps])
        grid = np.arange(len(t)) * self.recipe.period - LEAD
        error, added = (
            np.stack([np.interp(grid, t, column) for column in signal.T], axis=1)
            for signal in (
                np.array([step.point.q for step in log.steps]) - q,
                qd_cmd - np.array([step.point.qd_feedforward for step in log.steps]),
            )
        )
        if (learned := self.recipe.learned) is not None:
            n = min(len(grid), len(learned))
            added[:n] += learned[:n]
        return RunSignals(error, added)


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
