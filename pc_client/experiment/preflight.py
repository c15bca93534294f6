"""The robot is compared with the model before anything moves: one table of conditions, all on one record.

`CONDITIONS` is the table; each row is a pure function of what the robot reports and what the plan expects.
The same rows are shown by `ur-client doctor`, before the question to the user, and asked by the runner.
What a robot does not report is shown as "not reported": it never counts as passed, and it refuses nothing.
"""

from collections.abc import Callable, Sequence

import numpy as np

from pc_client.driver import watchdog
from pc_client.driver.report import UNKNOWN, RobotReport
from pc_client.driver.watchdog import Condition
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import ROTATION_TOLERANCE, RobotModel, flange_difference, robot_model
from protocol.ur_types import JOINT_NAMES
from ur_hil.cell import NO_CELL, Cell

_OFFSET_TOLERANCE = (1e-4, 1e-3)
"""How far the TCP may be from where plans have it [m, rad]: what a pendant rounds."""

_RTDE_TOLERANCE = (0.02, 0.05)
"""How far port 30004 may see the arm from where port 30003 does [m, rad]: a moment lies between the two."""

_PAYLOAD_TOLERANCE = 0.05
"""Of the mass [kg]. Its weight is 0.5 N, a sixth of the noise of the controller's own force estimate."""

_CENTRE_TOLERANCE = 0.02
"""Of its centre of gravity [m]: as good as the pendant's own estimation is. A choice: docs/fidelity.md."""

_SAME_POSTURE = 2e-3
"""An arm is where it was shown if no joint has moved further [rad]: 3 mm at the tool of the longest arm."""

_MEASURED = ("flange pose", "joint angles", "RTDE")
"""Conditions whose report says where the arm stands, or has noise in it."""

Check = Callable[[RobotReport, RobotModel | None], Condition]
"""Holds one thing that a robot reports against what is needed."""


def preflight(report: RobotReport, model: RobotModel | None) -> tuple[Condition, ...]:
    """Hold everything that a robot reports against what is needed; without a model when the arm has none.

    All conditions are returned; only the first for software of another generation, whose reports mean
    something else.
    """
    generation = watchdog.software(report.info.version)
    if not generation.holds:
        return (generation,)
    conditions = _E_SERIES_CONDITIONS + CONDITIONS if report.info.version.major == 5 else CONDITIONS
    return generation, *(condition(report, model) for condition in conditions)


def changes(shown: RobotReport, now: RobotReport, model: RobotModel) -> str:
    """What of posture, modes, tool and program is not as it was shown, in one phrase; empty: nothing."""
    moved = np.abs(now.frame.actual_q - shown.frame.actual_q)
    joint = int(moved.argmax())
    if not moved[joint] <= _SAME_POSTURE:
        return f"the arm was moved, its {JOINT_NAMES[joint]} by {np.degrees(moved[joint]):.1f} deg"
    pairs = zip(preflight(shown, model), preflight(now, model), strict=True)
    return ", ".join(
        f"{then.name} was {then.reported or 'not reported'}, is {condition.reported or 'not reported'}"
        for then, condition in pairs
        if then.reported != condition.reported and then.name not in _MEASURED
    )


def model_of(report: RobotReport, cell: Cell) -> RobotModel | None:
    """The nominal model of the arm that answers; None when its type is not known or has no model."""
    name = report.info.model.lower()
    return robot_model(name, cell) if name in ROBOTS else None


def _arm_type(report: RobotReport, model: RobotModel | None) -> Condition:
    """Dashboard server and configuration data name the arm that the plan was made for."""
    name, configured = report.info.model, report.configured
    differ = configured is not None and name not in (UNKNOWN, configured)
    return Condition(
        "arm",
        f"{name} (dashboard), {configured} (port 30001)" if differ else "" if name == UNKNOWN else name,
        " or ".join(known.title for known in ROBOTS.values()) if model is None else model.title,
        "look which arm it is, and set it so in the installation"
        if differ
        else "plan for the arm that answers",
        None if name == UNKNOWN else not differ and model is not None and name == model.title,
    )


def tcp_offset(report: RobotReport, model: RobotModel | None) -> Condition:
    """The TCP is that of plans: the flange, or that of the tool."""
    offset, reported, holds = report.tcp_offset, "", None
    must, remedy = "0 (the flange)", "set the TCP of the installation to zero in all six values"
    wanted = (0.0,) * 6 if model is None else model.tcp_offset
    if any(wanted):
        must, remedy = _pose_text(wanted), f"set it in the installation, or by set_tcp(p{list(wanted)})"
    if offset is not None:
        distance, angle = np.linalg.norm(np.subtract(offset, wanted)[:3]), np.linalg.norm(offset[3:])
        most_distance, most_angle = _OFFSET_TOLERANCE
        reported, holds = _pose_text(offset), bool(distance <= most_distance and angle <= most_angle)
    return Condition("TCP offset", reported, must, remedy, holds)


def _forward_kinematics(report: RobotReport, model: RobotModel | None) -> Condition:
    """The model puts the flange where the robot reports it: same arm, same generation, good calibration."""
    frame = report.frame
    if model is None:
        return Condition("flange pose", "", "that of the model", "plan for the arm that answers", None)
    q, pose = frame.actual_q.tolist(), frame.actual_tcp_pose.tolist()
    distance, angle = flange_difference(model, q, pose, report.tcp_offset)
    most = model.description.position_tolerance
    return Condition(
        "flange pose",
        f"{distance * 1e3:.1f} mm, {angle * 1e3:.1f} mrad from the {model.title} model",
        f"within {most * 1e3:g} mm, {ROTATION_TOLERANCE * 1e3:g} mrad",
        "this is another arm than the model's, or its calibration or TCP is wrong",
        distance <= most and angle <= ROTATION_TOLERANCE,
    )


def payload(report: RobotReport, model: RobotModel | None) -> Condition:
    """The controller is set to the mass that the arm carries; with a TCP of its own, also to its centre."""
    tool = (NO_CELL if model is None else model.cell).tool
    mass, cog, centre = report.payload, report.payload_cog, tool.centre_of_gravity
    reported, must = "" if mass is None else f"{mass:.2f} kg", f"{tool.mass:.2f} kg"
    within, holds = (
        f"{_PAYLOAD_TOLERANCE:g} kg",
        None if mass is None else abs(mass - tool.mass) <= _PAYLOAD_TOLERANCE,
    )
    remedy = "set the payload on the pendant to the tool's mass, or the mass in the cell file to the tool's"
    if tool.length:
        must, within = f"{must} at ({_mm(centre)}) mm", f"{within}, {1e3 * _CENTRE_TOLERANCE:g} mm"
        remedy = f"set it in the installation, or by set_payload({tool.mass:.4g}, {list(centre)})"
        if mass is not None and cog is not None:
            reported += f" at ({_mm(cog)}) mm"
            holds = holds and bool(np.linalg.norm(np.subtract(cog, centre)) <= _CENTRE_TOLERANCE)
    return Condition("payload", reported, f"{must} within {within}", remedy, holds)


def _rtde(report: RobotReport, model: RobotModel | None) -> Condition:
    """Port 30004 belongs to the arm of port 30003: same software, joints and TCP."""
    rtde, frame, version = report.rtde, report.frame, report.info.version
    most, most_angle = _RTDE_TOLERANCE
    reported, holds = "", None
    if rtde is not None:
        said = [rtde.values.get(name) for name in ("actual_q", "actual_TCP_pose")]
        q, pose = (six if isinstance(six, tuple) and len(six) == 6 else (np.nan,) * 6 for six in said)
        angle = float(np.abs(np.subtract(q, frame.actual_q)).max())
        distance = float(np.abs(np.subtract(pose, frame.actual_tcp_pose)[:3]).max())
        reported = f"{rtde.version}, {distance * 1e3:.0f} mm, {angle * 1e3:.0f} mrad from port 30003"
        same = (rtde.version.major, rtde.version.minor) == (version.major, version.minor)
        holds = same and distance <= most and angle <= most_angle
    return Condition(
        "RTDE",
        reported,
        f"{version}, within {most * 1e3:g} mm, {most_angle * 1e3:g} mrad",
        "another controller answers on its port: check what forwards the ports, and the ports given",
        holds,
    )


def _joint_angles(report: RobotReport, model: RobotModel | None) -> Condition:
    """Every joint stands within the range that plans use."""
    if model is None:
        return Condition("joint angles", "", "within the arm's range", "plan for the arm that answers", None)
    q, limits = report.frame.actual_q, model.limits
    beyond = np.maximum(q - np.array(limits.q_max), np.array(limits.q_min) - q)
    joint = int(beyond.argmax())
    low, high = np.degrees(limits.q_min[joint]), np.degrees(limits.q_max[joint])
    return Condition(
        "joint angles",
        f"{JOINT_NAMES[joint]} at {np.degrees(q[joint]):.1f} deg",
        f"within {low:.0f} to {high:.0f} deg",
        "turn the joint back into its range on the pendant",
        bool(beyond[joint] <= 0.0),
    )


def _control(report: RobotReport, model: RobotModel | None) -> Condition:
    """Clients may command the robot; the maker's simulator obeys them in local control, too."""
    return watchdog.control(report.remote_control, obeys_in_local=not report.info.has_calibration)


def operational_mode(report: RobotReport, model: RobotModel | None) -> Condition:
    """The robot is not in manual mode, which is slow and stops without the enabling device."""
    mode = report.operational_mode
    return Condition(
        "operational mode",
        mode or "",
        "AUTOMATIC or NONE",
        "in manual mode programs are slow and need the enabling device: switch to automatic mode on the "
        "pendant, or with the selector",
        None if mode is None else mode != "MANUAL",
    )


_E_SERIES_CONDITIONS: tuple[Check, ...] = (_control, operational_mode)
"""What only a robot of the e-Series reports; shown before the others."""

CONDITIONS: tuple[Check, ...] = (
    _arm_type,
    lambda report, model: watchdog.safety_mode(report.frame),
    lambda report, model: watchdog.robot_mode(report.frame),
    lambda report, model: watchdog.program_state(report.frame),
    lambda report, model: watchdog.control_mode(report.mode),
    lambda report, model: watchdog.speed_slider(report.mode),
    lambda report, model: watchdog.speed_scaling(report.frame),
    tcp_offset,
    _forward_kinematics,
    payload,
    _joint_angles,
    _rtde,
)
"""What a robot must fulfil, in the order in which it is shown: what explains the others comes first."""


def _pose_text(pose: Sequence[float]) -> str:
    rotation = ", ".join(f"{1e3 * value:.0f}" for value in pose[3:])
    return f"({_mm(pose[:3])}) mm, ({rotation}) mrad"


def _mm(position: Sequence[float]) -> str:
    return ", ".join(f"{1e3 * value:.1f}" for value in position)
