"""`connect` and `Arm`: a robot, real or emulated, that runs plans and velocity laws.

An emulator and a robot are treated alike; only the address differs. Each motion opens a session, compares
the robot with its model, streams under the watchdog and leaves the arm at rest; between motions no
connection is open.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from pc_client.api.confirmation import Confirm, ask_at_terminal, experiment_description
from pc_client.api.signals import Run, Signals
from pc_client.control.controller import CONTROLLERS, DEFAULT, FIELDS, Controller
from pc_client.driver.robot_report import RobotReport, read_report
from pc_client.driver.transport import TcpNetwork
from pc_client.driver.ur_driver import UrDriver
from pc_client.errors import ClientError, ControllerError
from pc_client.experiment.approach_run import run_approach
from pc_client.experiment.law_stream import ACCELERATION, LawStep, LawStream, VelocityLaw
from pc_client.experiment.observer import Observer
from pc_client.experiment.preflight import model_of, preflight, require
from pc_client.experiment.prepare import Experiment, Motion, Plan, make_plan
from pc_client.experiment.runner import ExperimentReport, ExperimentRunner
from pc_client.kinematics.cell import NO_CELL, Cell
from pc_client.kinematics.cell_file import load_cell
from pc_client.kinematics.robot_model import RobotModel, robot_model
from pc_client.planning.approach import plan_approach
from protocol.realtime.layout import RealtimeFrame
from protocol.ur_types import Ports
from ur_hil.records import checked

__all__ = ["Arm", "connect", "plan"]


def connect(
    host: str,
    ports: Ports | None = None,
    *,
    cell: Cell | str | Path | None = None,
    reverse_port: int | None = None,
    confirm: Confirm = ask_at_terminal,
) -> Arm:
    """Read the state of a robot and compare it with the model of its arm. Nothing moves.

    Args:
        host: name or address of the robot.
        ports: its ports; the standard ones by default.
        cell: surroundings and tool of the arm: a record or a file (docs/real-arm.md).
        reverse_port: port of this computer to which the robot's program connects; 31000 by default.
        confirm: called before a motion of an arm that is not known to be simulated.

    Raises:
        ClientError: the robot does not answer, does not report its type, or does not meet a condition.
    """
    surroundings = load_cell(cell) if isinstance(cell, str | Path) else cell or NO_CELL
    numbers = ports or Ports.standard()
    report = read_report(TcpNetwork(), host, numbers)
    model = model_of(report, surroundings)
    require(preflight(report, model))
    if model is None:
        raise ClientError(f"{host} does not report which arm it is: there is no plan for it")
    return Arm(host, numbers, report, model, reverse_port, confirm)


def plan(motion: Motion, arm: Arm | str = "ur3", cell: Cell = NO_CELL) -> Plan:
    """Plan a motion: inverse kinematics, spline, all limits checked. Nothing moves.

    Args:
        motion: a movement of the TCP, or a `JointTrajectory`.
        arm: a connected one, or the name of a model, such as "ur3".
        cell: surroundings and tool of a named model; a connected arm has its own cell.

    Raises:
        PlanningError: the arm cannot execute it; names the sample, its time and point, and the joint.
    """
    return make_plan(motion, robot_model(arm, cell) if isinstance(arm, str) else arm.model)


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
    ) -> None:
        self._host = host
        self._ports = ports
        self.report = report
        self.model = model
        self._reverse_port = reverse_port
        self._confirm = confirm

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
        """True, False, or None if the robot does not report it."""
        return self.report.info.simulated

    def frame(self) -> RealtimeFrame:
        """The robot's state now: `actual_q`, `actual_TCP_pose` and so on, by RTDE name in lower case.

        Raises:
            DriverError: the robot does not answer.
        """
        return self._report_now().frame

    def run(
        self,
        plan: Plan | Motion,
        controller: Controller = CONTROLLERS[DEFAULT],
        *,
        out: str | Path | None = None,
    ) -> Run:
        """Move to the start of a plan, identify the loop, follow the plan, and measure the result.

        Args:
            plan: made by `plan`, or a motion that is planned first.
            controller: the velocity controller.
            out: folder of the recording; None: the recording is not kept.

        Raises:
            ClientError: a check failed or the robot stopped; the arm rests.
        """
        return self.repeat(plan, 1, controller, out=out)[0]

    def repeat(
        self,
        plan: Plan | Motion,
        times: int,
        controller: Controller = CONTROLLERS[DEFAULT],
        *,
        out: str | Path | None = None,
    ) -> tuple[Run, ...]:
        """Run a plan several times; a controller with ILC learns from one run to the next.

        Arguments and errors are those of `run`.
        """
        made = plan if isinstance(plan, Plan) else make_plan(plan, self.model)
        with tempfile.TemporaryDirectory(prefix="ur-client-") as folder:
            report = self.experiment([made], times, controller, Path(folder) if out is None else Path(out))
            return tuple(Run.from_file(path) for path in report.paths)

    def experiment(
        self,
        plans: Sequence[Plan],
        repeat: int,
        controller: Controller,
        out: Path,
        observer: Observer | None = None,
    ) -> ExperimentReport:
        """Run several plans and keep their recordings.

        Args:
            plans: in order; their movements have different names.
            repeat: runs of each, at least 1.
            controller: the same for all runs.
            out: folder of the recordings.
            observer: gets the progress.

        Raises:
            ClientError: a check failed, the robot stopped or the answer was no; the arm rests, recordings
                finished until then are complete.
        """
        wanted = Experiment(self.model, tuple(plans), repeat, out)
        self.confirm(wanted)
        with self._session() as driver:
            return ExperimentRunner(driver, wanted, controller, observer).run()

    def approach(self, plan: Plan) -> Plan:
        """Move slowly to the start of a plan, on a checked path.

        Returns:
            The plan, with its joint angles shifted by whole turns to those of the arm.

        Raises:
            ClientError: there is no clear path, a check failed or the robot stopped; the arm rests.
        """
        self.confirm(Experiment(self.model, (plan,), 1, Path()))
        with self._session() as driver:
            require(preflight(driver.report(), self.model))
            approach = plan_approach(plan.joints, driver.actual_q(), model=self.model)
            run_approach(driver, approach, self.model)
        return replace(plan, joints=approach.plan)

    def stream(self, law: VelocityLaw, *, acceleration: float = ACCELERATION) -> Signals:
        """Move the arm by a velocity law from its present posture, under the watchdog of every motion.

        Before each velocity is sent, the posture in which the arm could come to rest is checked against joint
        ranges and clearances. An error in the law ends the motion; the arm is stopped.

        Args:
            law: gets each frame and returns (6,) joint velocities [rad/s], or None to end.
            acceleration: of the robot's `speedj` [rad/s2], .1 to 100.

        Raises:
            ClientError: the acceleration is out of its range, a value of the law cannot be sent, or the
                robot stopped; the arm rests.
        """
        value = checked(FIELDS["speedj_acceleration"], acceleration, "acceleration", ControllerError)
        source = LawStream(law, self.model)
        top = np.degrees(max(source.qd_max))
        self._ask(lambda: f"a velocity law drives the arm at {self._host}, joints up to {top:.0f} deg/s")
        rows: list[tuple[float, np.ndarray, np.ndarray, np.ndarray, list[float]]] = []

        def keep(frame: RealtimeFrame, step: LawStep) -> None:
            pose = frame.actual_tcp_pose
            rows.append((frame.timestamp, frame.actual_q, frame.actual_qd, pose, step.qd_cmd))

        with self._session() as driver:
            require(preflight(driver.report(), self.model))
            driver.stream(source, keep, acceleration=value)
        if not rows:
            raise ClientError("the velocity law ended before its first velocity: there are no signals")
        t, q, qd, pose, command = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
        return Signals(t - t[0], q, qd, pose, command, self.simulated)

    def confirm(self, wanted: Experiment) -> None:
        """Ask whether an arm that is not known to be simulated may do an experiment; nothing moves.

        Raises:
            ClientError: the answer was no, there is no terminal, or no clear path to the start.
        """
        self._ask(lambda: experiment_description(self._host, self._report_now(), self.model, wanted))

    def _report_now(self) -> RobotReport:
        return read_report(TcpNetwork(), self._host, self._ports)

    def _session(self) -> UrDriver:
        return UrDriver(self._host, self._ports, reverse_port=self._reverse_port)

    def _ask(self, text: Callable[[], str]) -> None:
        """Ask whether an arm may move, unless it reports itself as simulated."""
        if self.simulated is not True and not self._confirm(text()):
            raise ClientError("the arm was not moved: the answer was no")
