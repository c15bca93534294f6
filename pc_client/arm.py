"""`connect` and `Arm`: a robot, real or emulated, that runs plans and velocity laws.

An emulator and a robot are treated alike; only the address differs. Each motion opens a session, compares
the robot with its model, streams under the watchdog and leaves the arm at rest; between motions no
connection is open. Before an arm moves that is not known to be simulated, a person is asked.
"""

from __future__ import annotations

import reprlib
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from types import TracebackType, UnionType
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from pc_client.analysis.signals import Run, Signals
from pc_client.arrays import Array
from pc_client.control.controller import CONTROLLERS, DEFAULT, FIELDS, Controller, controller_of_law
from pc_client.control.reference import RunRecipe
from pc_client.control.tracker import ControlLaw
from pc_client.driver.gripper import Gripper
from pc_client.driver.report import RobotInfo, RobotReport, read_report
from pc_client.driver.session import UrDriver
from pc_client.driver.transport import TcpNetwork
from pc_client.driver.velocity_stream import StreamLog, StreamReport
from pc_client.driver.watchdog import conditions_text, require
from pc_client.errors import LOG, ClientError, ControllerError, DriverError, PlanningError, printable
from pc_client.experiment.experiment import Experiment, check_folder, experiment_text, scratch_folder
from pc_client.experiment.law_stream import ACCELERATION, LawStep, LawStream, VelocityLaw, check_law, rehearse
from pc_client.experiment.prediction import guarded
from pc_client.experiment.preflight import changes, model_of, preflight
from pc_client.experiment.run import ExperimentReport, ExperimentRunner, run_approach
from pc_client.kinematics.model import RobotModel, nearest_posture, robot_model, tcp_pose
from pc_client.kinematics.tool import gripper_model, surroundings
from pc_client.movements.movement import Movement
from pc_client.movements.samples import JointTrajectory
from pc_client.planning.approach import approach_text, plan_approach
from pc_client.planning.plan import Motion, Plan, make_plan
from protocol.pose import T_to_pose, pose_to_T
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import Ports
from ur_hil.cell import Cell, Point, Three
from ur_hil.records import checked, number, whole
from ur_hil.tools import ToolModel

Confirm = Callable[[str], bool]
"""Gets the text that describes the motion; returns whether the arm may move."""

QUESTION = "The arm is going to move. Is the space around it free, and the emergency stop at hand?"
_NO_TERMINAL = (
    "there is no terminal to ask at whether the arm may move: run this at one, or give --yes (in Python: "
    "connect(..., confirm=lambda text: True)) after a person has checked the arm"
)


def ask_at_terminal(text: str) -> bool:
    """Show the description of a motion and ask; ClientError if there is no terminal to ask at."""
    if sys.stdin is None or sys.stdin.closed:
        raise ClientError(_NO_TERMINAL)
    print(printable(text))
    try:
        return input(f"{QUESTION} [y/N]: ").strip().lower() in ("y", "yes")
    except EOFError:
        raise ClientError(_NO_TERMINAL) from None


def connect(
    host: str,
    ports: Ports | None = None,
    *,
    cell: Cell | str | Path | None = None,
    tool: str | None = None,
    reverse_port: int | None = None,
    confirm: Confirm = ask_at_terminal,
) -> Arm:
    """Read the state of a robot and compare it with the model of its arm. Nothing moves.

    Args:
        host: name or address of the robot.
        ports: its ports; the standard ones by default.
        cell: surroundings and tool of the arm: a record or a file (docs/real-arm.md).
        tool: a gripper on the flange, by its name or its file (docs/grippers.md): it gives the arm its TCP,
            its payload, its shape, and `gripper`.
        reverse_port: port of this computer to which the robot's program connects; 31000 by default.
        confirm: called before a motion of an arm that is not known to be simulated.

    Raises:
        ClientError: the robot does not answer, does not report its type, or does not meet a condition.
    """
    check_law(confirm, "confirm", "a function of (text)", 1)
    if reverse_port is not None:
        checked(whole(0, 65535), reverse_port, "reverse_port", ClientError)
    around, hand = surroundings(cell, tool), None if tool is None else gripper_model(tool)
    numbers = ports or Ports.standard()
    report = read_report(TcpNetwork(), host, numbers)
    model = model_of(report, around)
    require(preflight(report, model))
    if model is None:
        raise ClientError(f"{host} does not report which arm it is: there is no plan for it")
    return Arm(host, numbers, report, model, reverse_port, confirm, hand)


def plan(motion: Motion, arm: Arm | str = "ur3", cell: Cell | str | Path | None = None) -> Plan:
    """Plan a motion: inverse kinematics, spline, all limits checked. Nothing moves.

    Args:
        motion: a movement of the TCP, or a `JointTrajectory`.
        arm: a connected one, or the name of a model, such as "ur3".
        cell: surroundings and tool of a named model, as of `connect`; a connected arm has its own.

    Raises:
        PlanningError: the arm cannot execute it; names the sample, its time and point, and the joint.
        ClientError: a cell for an arm that has its own, or its file makes no sense.
    """
    if isinstance(arm, str):
        return make_plan(motion, robot_model(arm, surroundings(cell)))
    if cell is not None:
        raise ClientError(f"cell: {arm!r} has its own; give it to connect, or plan for {arm.model.name!r}")
    return make_plan(motion, arm.model)


class Arm:
    """A robot that agrees with its model; made by `connect`. It may be used as a context manager.

    Attributes:
        report: of the robot at the time of `connect`.
        model: the nominal model of its arm in its cell.
    """

    def __init__(
        self,
        host: str,
        ports: Ports,
        report: RobotReport,
        model: RobotModel,
        reverse_port: int | None,
        confirm: Confirm,
        tool: ToolModel | None,
    ) -> None:
        self._host = host
        self._ports = ports
        self.report = report
        self.model = model
        self._reverse_port = reverse_port
        self._confirm = confirm
        self._gripper = None if tool is None else Gripper(tool, host, ports.gripper, self._ask_for_fingers)

    def __repr__(self) -> str:
        return f"<Arm {self.report.info} at {self._host}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is open between motions: there is nothing to close."""

    @property
    def simulated(self) -> bool | None:
        """True, False, or None if the robot does not report it; held against every motion's report."""
        return self.report.info.simulated

    @property
    def gripper(self) -> Gripper:
        """The gripper that was given to `connect` as `tool`; ClientError without one."""
        if self._gripper is None:
            raise ClientError(f"{self!r} has no gripper: give connect its tool, such as 'robotiq-2f85'")
        return self._gripper

    def set_payload(self, mass: float, centre_of_gravity: Three) -> None:
        """Set what the flange carries, on the robot and in the plans that follow: the tool and what it holds.

        The robot feels an undeclared load as a force, and the payload is compared before each motion.

        Args:
            mass: [kg].
            centre_of_gravity: in the flange frame [m].

        Raises:
            ClientError: the robot does not take it, the answer was no, or these are no mass and centre.
        """
        mass = checked(number(0.0, 100.0, "kg"), mass, "mass", ClientError)
        centre: Point = checked(cast(Any, Point), centre_of_gravity, "centre_of_gravity", ClientError)
        self._ask(f"the payload of the arm at {self._host} becomes {mass:g} kg")
        with self._open() as driver:
            driver.set_payload(mass, centre)
        tool = replace(self.model.cell.tool, mass=mass, centre_of_gravity=centre)
        self.model = replace(self.model, cell=replace(self.model.cell, tool=tool))

    def frame(self) -> RealtimeFrame:
        """The robot's state now: `actual_q`, `actual_TCP_pose` and so on, by RTDE name in lower case.

        Raises:
            DriverError: the robot does not answer.
        """
        return self._report_now().frame

    def fk(self, q: ArrayLike) -> Array:
        """Forward kinematics of the nominal arm; nothing moves.

        The robot computes with the calibration of its own arm: `frame().actual_tcp_pose` differs by a few mm.

        Args:
            q: (6,) joint angles [rad], or (n, 6).

        Returns:
            (6,) or (n, 6): position [m] and rotation vector [rad] of the TCP in the base frame.

        Raises:
            PlanningError: other shapes, or values that are not finite.
        """
        angles = _sixes(q, "q")
        poses = [T_to_pose(tcp_pose(self.model, one)) for one in angles.reshape(-1, 6)]
        return np.array(poses).reshape(angles.shape)

    def ik(self, pose: ArrayLike, q_near: ArrayLike | None = None) -> Array:
        """Inverse kinematics of the nominal arm, on the branch nearest to a posture; nothing moves.

        Args:
            pose: (6,) position [m] and rotation vector [rad] of the TCP in the base frame, or (n, 6).
            q_near: (6,) a posture [rad]; the arm's present one by default. Of several poses each has the
                joint angles nearest to those of the one before.

        Returns:
            (6,) or (n, 6) joint angles [rad]. Clearances and speeds are not checked; `plan` does.

        Raises:
            PlanningError: a pose is out of reach; other shapes, or values that are not finite.
        """
        poses = _sixes(pose, "pose")
        q = self.frame().actual_q if q_near is None else _sixes(q_near, "q_near")
        found = [q := nearest_posture(self.model, pose_to_T(one.tolist()), q) for one in poses.reshape(-1, 6)]
        return np.array(found).reshape(poses.shape)

    def run(
        self,
        plan: Plan | Motion,
        controller: Controller | ControlLaw = CONTROLLERS[DEFAULT],
        *,
        out: str | Path | None = None,
        overwrite: bool = False,
    ) -> Run:
        """Move to the start of a plan, identify the loop, follow the plan, and measure the result.

        Args:
            plan: made by `plan`, or a motion that is planned first.
            controller: the velocity controller, or a function of yours: it gets each frame and the reference
                at its time (`t`, `q_array`, `qd_feedforward`, `qd_array`, `p`, `v`) and returns (6,) joint
                velocities [rad/s]. Before anything moves it is called once, with a made-up frame. Checks,
                guard of the tool, recording and SNR are those of the other controllers.
            out: folder of the recording; None: it is not kept, unless the run is given up: then the error
                names the file, in the temporary folder of the system.
            overwrite: replace a simulated recording of the same name in it; without, it is refused.

        Raises:
            ClientError: an argument makes no sense, a check failed or the robot stopped; the arm rests.
        """
        return self.repeat(plan, 1, controller, out=out, overwrite=overwrite)[0]

    def repeat(
        self,
        plan: Plan | Motion,
        times: int,
        controller: Controller | ControlLaw = CONTROLLERS[DEFAULT],
        *,
        out: str | Path | None = None,
        overwrite: bool = False,
    ) -> tuple[Run, ...]:
        """Run a plan several times; a controller with ILC learns from one run to the next.

        Arguments and errors are those of `run`.
        """
        _need(plan, Plan | Movement | JointTrajectory, "plan", "a Plan, a Movement or a JointTrajectory")
        made = plan if isinstance(plan, Plan) else make_plan(plan, self.model)
        with scratch_folder() if out is None else nullcontext(out) as folder:
            report = self.experiment([made], times, controller, folder, overwrite=overwrite)
            return tuple(Run.from_file(path) for path in report.paths)

    def experiment(
        self,
        plans: Sequence[Plan],
        repeat: int,
        controller: Controller | ControlLaw,
        out: str | Path,
        *,
        overwrite: bool = False,
    ) -> ExperimentReport:
        """Run several plans and keep their recordings.

        Args:
            plans: in order; their movements have different names.
            repeat: runs of each, at least 1.
            controller: the same for all runs.
            out: folder of the recordings.
            overwrite: as of `run`.

        Raises:
            ClientError: a check failed, the robot stopped or the answer was no; the arm rests, recordings
                finished until then are complete.
        """
        law, config = None, controller
        if not isinstance(config, Controller):
            check_law(config, "controller", "a Controller or a function of (frame, reference)", 2)
            law, config = config, controller_of_law(getattr(config, "__name__", type(config).__name__))
        _need(plans, Sequence, "plans", "a list of Plans")
        for plan in plans:
            _need(plan, Plan, "plan", "a Plan")
        _need(repeat, int | np.integer, "times", "a whole number from 1")
        _need(out, str | Path, "out", "a folder")
        _need(overwrite, bool, "overwrite", "True or False")
        wanted = Experiment(self.model, tuple(plans), repeat, Path(out), overwrite)
        check_folder(wanted)
        if law is not None:
            report = self._report_now()
            recipe = RunRecipe.first(config, report.info.period)
            with self._fingers(law, is_rehearsal=True):
                rehearse(law, recipe, plans[0], report.frame, self.model)
        predicted = config if law is None else None
        with (
            self._session(lambda report: self.describe(wanted, predicted, report)) as driver,
            self._fingers(law),
        ):
            return ExperimentRunner(driver, wanted, config, law).run()

    def approach(self, plan: Plan) -> Plan:
        """Move slowly to the start of a plan, on a checked path.

        Returns:
            The plan, with its joint angles shifted by whole turns to those of the arm.

        Raises:
            ClientError: there is no clear path, a check failed or the robot stopped; the arm rests.
        """
        _need(plan, Plan, "plan", "a Plan")
        wanted = Experiment(self.model, (plan,), 1, Path())
        with self._session(lambda report: self.describe(wanted, None, report)) as driver:
            approach = plan_approach(plan.joints, driver.actual_q(), model=self.model)
            run_approach(driver, approach, self.model)
        return replace(plan, joints=approach.plan)

    def stream(self, law: VelocityLaw, *, acceleration: float = ACCELERATION) -> Signals:
        """Move the arm by a velocity law from its present posture, under the watchdog of every motion.

        Before each velocity is sent, the way on which the arm could come to rest is checked against joint
        ranges and clearances. An error in the law ends the motion; the arm is stopped.

        Args:
            law: gets each frame and returns (6,) joint velocities [rad/s], or None to end.
            acceleration: of the robot's `speedj` [rad/s2], .1 to 100.

        Raises:
            ClientError: the acceleration is out of its range, a value of the law cannot be sent, or the
                robot stopped; the arm rests.
        """
        value = checked(FIELDS["speedj_acceleration"], acceleration, "acceleration", ControllerError)
        check_law(law, "law", "a function of (frame)", 1)
        source = LawStream(law, self.model)
        top = np.degrees(max(source.qd_max))
        what = "the arm" if self._gripper is None else "arm and fingers"
        text = f"a velocity law drives {what} at {self._host}, joints up to {top:.0f} deg/s"
        log: StreamLog[LawStep] = StreamLog()

        def signals(stream: StreamReport) -> Signals:
            t, q, qd, pose, command = log.columns("timestamp", "actual_q", "actual_qd", "actual_tcp_pose")
            return Signals(t - t[0], q, qd, pose, command, driver.info.source, stream)

        with scratch_folder() as folder, self._session(lambda report: text) as driver:
            try:
                with self._fingers(law):
                    stream = driver.stream(source, log, acceleration=value)
            except BaseException as error:
                if log.frames:
                    path = folder / "stream.parquet"
                    signals(StreamReport()).to_frame().write_parquet(path)
                    error.add_note(f"recorded until then: {path}")
                raise
        if not log.frames:
            raise ClientError("the velocity law ended before its first velocity: there are no signals")
        if stream.trouble:
            LOG.warning(stream.trouble)
        return signals(stream)

    def confirm(self, wanted: Experiment) -> None:
        """Ask whether an arm that is not known to be simulated may do an experiment; nothing moves.

        Raises:
            ClientError: as `describe`; or the answer was no, or there is no terminal.
        """
        self._session(lambda report: self.describe(wanted, None, report)).close()

    def describe(
        self, wanted: Experiment, controller: Controller | None = None, report: RobotReport | None = None
    ) -> str:
        """Describe an experiment for the people beside the arm: conditions, plan, approach; nothing moves.

        Args:
            controller: what is expected of it is described, too.
            report: of the robot; by default as it is now.

        Raises:
            ClientError: the robot is not as it must be, there is no clear path to the start, or the
                controller would leave the path.
        """
        report = self._report_now() if report is None else report
        conditions = preflight(report, self.model)
        require(conditions)
        approach = plan_approach(wanted.planned[0].joints, report.frame.actual_q, model=self.model)
        recipe = controller and RunRecipe.first(controller, report.info.period)
        found = [guarded(plan.joints, recipe, self.model)[1] for plan in wanted.planned if recipe]
        texts = [
            f"robot at {self._host}: {report.info}",
            conditions_text(conditions),
            experiment_text(wanted),
        ]
        if expected := [one for one in found if one]:
            texts.append(f"  expected SNR    at best {min(one.snr_db for one in expected):.1f} dB")
        texts += [one.doubt for one in expected if one.doubt]
        return "\n".join((*texts, approach_text(approach)))

    def _fingers(self, law: object, *, is_rehearsal: bool = False) -> AbstractContextManager[None]:
        """What a gripper needs while a law drives the arm."""
        if law is None or self._gripper is None:
            return nullcontext()
        return self._gripper.beside_law(is_rehearsal=is_rehearsal)

    def _report_now(self) -> RobotReport:
        report = read_report(TcpNetwork(), self._host, self._ports)
        self._check_same(report.info)
        return report

    def _session(self, describe: Callable[[RobotReport], str]) -> UrDriver:
        """Open a session for a motion: a yes to its description, the same robot, every condition met.

        A robot that is not any more as it was shown is shown anew. Nobody is asked about a robot that reports
        itself as simulated.
        """
        before = ""
        while True:
            shown = None
            if self.simulated is not True:
                shown = self._report_now()
                self._ask(before + describe(shown))
            driver = self._open()
            try:
                now = driver.report()
                if not (changed := shown and changes(shown, now, self.model)):
                    require(preflight(now, self.model))
                    return driver
            except BaseException:
                driver.close()
                raise
            driver.close()
            before = f"it is not as it was shown: {changed}; so once more:\n"

    def _open(self) -> UrDriver:
        """Take the remote control: a session with the robot of `connect`."""
        driver = UrDriver(self._host, self._ports, reverse_port=self._reverse_port)
        try:
            self._check_same(driver.info)
        except BaseException:
            driver.close()
            raise
        return driver

    def _check_same(self, now: RobotInfo) -> None:
        """Refuse another robot than that of `connect`, or one of another origin."""
        then = self.report.info
        now.check_same(then.model, then.serial)
        if now.simulated is not then.simulated:
            raise DriverError(f"the robot at {self._host} is {now}; at connect it was {then}: connect again")

    def _ask_for_fingers(self, text: str) -> None:
        self._report_now()  # it is the robot of `connect`
        self._ask(text)

    def _ask(self, text: str) -> None:
        """Ask for a yes, unless the robot reports itself as simulated."""
        if self.simulated is not True and not self._confirm(text):
            raise ClientError("the arm was not moved: the answer was no")


def _need(value: object, kind: type | UnionType, what: str, allowed: str) -> None:
    """Refuse an argument of another kind before anything moves."""
    if not isinstance(value, kind):
        raise ClientError(f"{what}: {reprlib.repr(value)}; give {allowed}")


def _sixes(values: ArrayLike, what: str) -> Array:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    if array.shape[-1:] != (6,) or array.ndim > 2 or not np.isfinite(array).all():
        raise PlanningError(f"{what} of shape {array.shape}: give six finite numbers, or rows of six")
    return array
