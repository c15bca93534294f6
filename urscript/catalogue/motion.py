"""Builtins of the module "motion": moves, servoing, force and freedrive modes, conveyors, path offset.

Defaults: script manual CB3 3.15.4, module motion, and its variables `a_joint_default` and so on.
"""

from __future__ import annotations

from urscript.values import Pose

from .chapter import DRIVER_SCRIPT, FIELD_USE, MANUAL_LATE, Chapter
from .types import Builtin, ModuleVariable, Param, ParamType, Support, TimeClass
from .versions import LATE_E_SERIES, NOT_CB3, Generation, releases

_row = Chapter("motion").row

BOOL, INT, NUMBER, STRING = ParamType.BOOL, ParamType.INT, ParamType.NUMBER, ParamType.STRING
POSE, JOINTS, VECTOR6 = ParamType.POSE, ParamType.JOINTS, ParamType.VECTOR6
POSE_OR_JOINTS, VECTOR3, ANY = ParamType.POSE_OR_JOINTS, ParamType.VECTOR3, ParamType.ANY
MOTION, SWITCH = TimeClass.MOTION, TimeClass.SWITCH
EXACT, APPROXIMATE = Support.EXACT, Support.APPROXIMATE

A_JOINT_DEFAULT, V_JOINT_DEFAULT = 1.4, 1.05
A_TOOL_DEFAULT, V_TOOL_DEFAULT = 1.2, 0.25
# Shares of the modelled friction that direct_torque compensates. Source: script manual 5.25.1, direct_torque.
VISCOUS_SCALE = (0.9, 0.9, 0.8, 0.9, 0.9, 0.9)
COULOMB_SCALE = (0.8, 0.8, 0.7, 0.8, 0.8, 0.8)

_A_TOOL = Param("a", NUMBER, A_TOOL_DEFAULT, "m/s^2")
_V_TOOL = Param("v", NUMBER, V_TOOL_DEFAULT, "m/s")
_BLEND = Param("r", NUMBER, 0, "m")
_A_ROTATION = Param("aRot", NUMBER, None, "rad/s^2", shown="a")
_ENCODER = Param("encoder_index", INT, 0, "0 or 1", low=0, high=1)
_ENCODER_REQUIRED = Param("encoder_index", INT, unit="0 or 1", low=0, high=1)
_PIN_A = Param("A", INT, unit="digital input")
_PIN_B = Param("B", INT, unit="digital input")
_OFFSET_TYPE = Param("type", INT, unit="1 base, 2 TCP, 3 motion frame, 4 base inverted", low=1, high=4)


def _servoj(t_default: float) -> tuple[Param, ...]:
    return (
        Param("q", JOINTS, unit="rad"),
        # Printed without default, but ignored, and left out by callers that name the other arguments.
        Param("a", NUMBER, 0, "not used"),
        Param("v", NUMBER, 0, "not used"),
        Param("t", NUMBER, t_default, "s"),
        Param("lookahead_time", NUMBER, 0.1, "s, 0.03 to 0.2"),
        Param("gain", NUMBER, 300, "100 to 2000"),
    )


_MOVES: tuple[Builtin, ...] = (
    _row(
        "movej",
        (
            Param("q", POSE_OR_JOINTS, unit="rad, or pose in m and rad"),
            Param("a", NUMBER, A_JOINT_DEFAULT, "rad/s^2"),
            Param("v", NUMBER, V_JOINT_DEFAULT, "rad/s"),
            Param("t", NUMBER, 0, "s"),
            _BLEND,
        ),
        "None",
        "joint-linear move; a pose goes through inverse kinematics; t > 0 overrides a and v",
        time=MOTION,
        support=APPROXIMATE,
        note="the shape of blends, and of the profile with t, is chosen",
    ),
    _row(
        "movel",
        (
            Param("pose", POSE_OR_JOINTS, unit="m, rad, or joint positions in rad"),
            _A_TOOL,
            _V_TOOL,
            Param("t", NUMBER, 0, "s"),
            _BLEND,
        ),
        "None",
        "move with the tool on a straight line; joint positions go through forward kinematics",
        time=MOTION,
        support=APPROXIMATE,
        note="timing of pure turns and the shape of blends are chosen",
    ),
    _row(
        "movep",
        (Param("pose", POSE_OR_JOINTS, unit="m, rad"), _A_TOOL, _V_TOOL, _BLEND),
        "None",
        "process move: lines with circular blends at constant tool speed",
        time=MOTION,
        support=APPROXIMATE,
        note="blends of arcs, and sharper than 162 degrees, are not circular",
    ),
    _row(
        "movec",
        (
            Param("pose_via", POSE_OR_JOINTS, unit="m, rad"),
            Param("pose_to", POSE_OR_JOINTS, unit="m, rad"),
            _A_TOOL,
            _V_TOOL,
            _BLEND,
            Param("mode", INT, 0, "0 unconstrained, 1 fixed orientation", low=0, high=1),
        ),
        "None",
        "move on the arc through a via point; the rotation of the via point is ignored",
        time=MOTION,
        support=APPROXIMATE,
        note="three points on a line give a straight move",
    ),
    _row(
        "servoj",
        _servoj(0.008),
        "None",
        "servo the joints towards q for the time t",
        time=MOTION,
        until=releases(None, "5.21"),
        since=releases("3.0", "5.0"),
        support=APPROXIMATE,
        note="gain and lookahead time are read as the coefficients of a second-order lag",
    ),
    _row(
        "servoj",
        _servoj(0.002),
        "None",
        "servo the joints towards q for the time t",
        time=MOTION,
        since=LATE_E_SERIES,
        source=MANUAL_LATE,
        support=APPROXIMATE,
        note="gain and lookahead time are read as the coefficients of a second-order lag",
    ),
    _row(
        "servoc",
        (Param("pose", POSE_OR_JOINTS, unit="m, rad"), _A_TOOL, _V_TOOL, _BLEND),
        "None",
        "circular servo to a tool pose",
        time=MOTION,
        undocumented=(Generation.CB3, Generation.E_SERIES),
        source=FIELD_USE,
        support=APPROXIMATE,
        note="undocumented; done as movep",
    ),
    _row(
        "speedj",
        (
            Param("qd", JOINTS, unit="rad/s"),
            Param("a", NUMBER, unit="rad/s^2"),
            Param("t", NUMBER, None, "s", shown="until the speed is reached"),
        ),
        "None",
        "accelerate the joints linearly to qd (a of the leading axis), then keep it",
        time=MOTION,
        support=APPROXIMATE,
        note="what happens when the program goes on without a further motion command is not documented",
    ),
    _row(
        "speedl",
        (
            Param("xd", VECTOR6, unit="m/s, rad/s"),
            Param("a", NUMBER, unit="m/s^2"),
            Param("t", NUMBER, None, "s", shown="until the speed is reached"),
            _A_ROTATION,
        ),
        "None",
        "accelerate the tool linearly to the spatial velocity xd in the base frame, then keep it",
        time=MOTION,
        support=APPROXIMATE,
        note="what happens when the program goes on without a further motion command is not documented",
    ),
    _row(
        "stopj",
        (Param("a", NUMBER, unit="rad/s^2"),),
        "None",
        "decelerate all joints to rest, a of the leading axis",
        time=MOTION,
        support=EXACT,
    ),
    _row(
        "stopl",
        (Param("a", NUMBER, unit="m/s^2"), _A_ROTATION),
        "None",
        "decelerate the tool to rest",
        time=MOTION,
        support=EXACT,
    ),
    _row(
        "set_pos",
        (Param("q", JOINTS, unit="rad"),),
        "None",
        "put the simulated robot at q",
        support=APPROXIMATE,
        note="refused while the arm moves, out of range, and where it would touch something",
    ),
    _row(
        "reset_revolution_counter",
        (Param("qNear", JOINTS, None, "rad", shown="the present turns"),),
        "None",
        "renumber the turns of joints without position limit; nothing moves",
        support=APPROXIMATE,
        note="kept only; it acts when new safety settings limit a joint",
    ),
    _row(
        "pause_on_error_code",
        (Param("code", INT, unit="x of CxAy"), Param("argument", INT, None, "y of CxAy", shown="any")),
        "None",
        "pause the program when that error occurs; forgotten at program stop",
        support=APPROXIMATE,
        note="at the codes that this box reports",
    ),
    _row(
        "position_deviation_warning",
        (
            Param("enabled", BOOL),
            Param("threshold", NUMBER, 0.8, "fraction of the stop limit", low=0, high=1),
        ),
        "None",
        "warn in the log when the joints deviate this much from the path",
        support=APPROXIMATE,
        note="code and text of the log entry are chosen",
    ),
    _row(
        "set_safety_mode_transition_hardness",
        (Param("type", INT, unit="0 hard, 1 soft", low=0, high=1),),
        "None",
        "how hard the transition into reduced mode and safeguard stop is",
        support=APPROXIMATE,
        note="hard: the full deceleration of the arm; soft: within 0.25 s",
    ),
)

_SCREW = "force mode along the Z axis of the TCP as it is at the call"
_GUIDED = "joints are free on the physics; friction compensation and push back at limits are chosen"

_FORCE_AND_FREEDRIVE: tuple[Builtin, ...] = (
    _row(
        "force_mode",
        (
            Param("task_frame", POSE, unit="m, rad"),
            Param("selection_vector", JOINTS, unit="0 stiff, 1 compliant"),
            Param("wrench", VECTOR6, unit="N, Nm"),
            Param("type", INT, unit="1 toward origin, 2 as given, 3 along the motion", low=1, high=3),
            Param("limits", JOINTS, unit="m/s and rad/s compliant, m and rad stiff"),
        ),
        "None",
        "regulate the compliant axes of the task frame to a wrench",
        time=SWITCH,
        support=APPROXIMATE,
        note="on the contact physics; the control law and the zero of the wrench are ours (docs/contact.md)",
    ),
    _row(
        "end_force_mode",
        (),
        "None",
        "back to position control",
        time=SWITCH,
        support=APPROXIMATE,
        note="see force_mode",
    ),
    _row(
        "force_mode_set_damping",
        (Param("damping", NUMBER, unit="0 to 1", low=0, high=1),),
        "None",
        "how fast force mode brakes when no force acts; 0 none",
        since=releases("3.5", "5.0", "10.0"),
        support=APPROXIMATE,
        note="part of the speed that is lost within a delay of the loop, about 50 ms",
    ),
    _row(
        "force_mode_set_gain_scaling",
        (Param("scaling", NUMBER, unit="0 to 2", low=0, high=2),),
        "None",
        "scale the gain of the force loop",
        since=releases("3.14", "5.0", "10.0"),
        support=APPROXIMATE,
        note="1 is our gain: the force comes near with 8 1/s",
        undocumented=(Generation.CB3,),
        source=f"Script Manual e-Series 5.11, module motion; CB3: {DRIVER_SCRIPT}",
    ),
    _row(
        "freedrive_mode",
        (),
        "None",
        "hand guiding",
        time=SWITCH,
        since=releases("3.0", "5.0"),
        until=releases(None, "5.10"),
        support=APPROXIMATE,
        note=_GUIDED,
    ),
    _row(
        "freedrive_mode",
        (
            Param("freeAxes", JOINTS, [1, 1, 1, 1, 1, 1], "1 free, 0 blocked"),
            Param("feature", ANY, Pose(0, 0, 0, 0, 0, 0), 'pose, "base" or "tool"'),
        ),
        "None",
        "hand guiding along the free axes of a feature",
        time=SWITCH,
        support=APPROXIMATE,
        note="blocked axes are held by a spring and a damper (chosen); " + _GUIDED,
        since=releases(None, "5.10", "10.0"),
    ),
    _row(
        "freedrive_mode_no_incorrect_payload_check",
        (),
        "None",
        "hand guiding without the check of the payload",
        time=SWITCH,
        since=releases("3.0", "5.24", "10.11"),
        support=APPROXIMATE,
        note=_GUIDED,
        source="URScript API Reference CB3 3.15.4, module motion; later e-Series directories",
    ),
    _row(
        "end_freedrive_mode",
        (),
        "None",
        "back to position control",
        time=SWITCH,
        support=APPROXIMATE,
        note=_GUIDED,
    ),
    _row(
        "get_freedrive_status",
        (),
        "int",
        "0 normal, 1 near, 2 too close to a singularity",
        support=APPROXIMATE,
        note="by the least singular value of the Jacobian: 0.1 and 0.04, chosen",
        since=releases(None, "5.10", "10.0"),
    ),
    _row(
        "teach_mode",
        (),
        "None",
        "old name of freedrive_mode",
        time=SWITCH,
        deprecated=True,
        support=APPROXIMATE,
        note=_GUIDED,
    ),
    _row(
        "end_teach_mode",
        (),
        "None",
        "old name of end_freedrive_mode",
        time=SWITCH,
        deprecated=True,
        support=APPROXIMATE,
        note=_GUIDED,
    ),
    _row(
        "screw_driving",
        (Param("f", NUMBER, unit="N"), Param("v_limit", NUMBER, unit="m/s")),
        "None",
        "follow a screw along the tool's Z axis",
        time=SWITCH,
        support=APPROXIMATE,
        note=_SCREW,
        since=NOT_CB3,
    ),
    _row(
        "end_screw_driving",
        (),
        "None",
        "leave screw driving",
        time=SWITCH,
        since=NOT_CB3,
        support=APPROXIMATE,
        note=_SCREW,
    ),
)

_OFFSET = "the filter acts once a cycle; what of it is not documented, such as the frame at rest, is chosen"

_PATH_OFFSET: tuple[Builtin, ...] = (
    _row(
        "path_offset_enable",
        (),
        "None",
        "superimpose an offset on all motion",
        since=NOT_CB3,
        support=APPROXIMATE,
        note=_OFFSET,
    ),
    _row(
        "path_offset_disable",
        (Param("a", NUMBER, 20, "rad/s^2"),),
        "None",
        "stop superimposing; the joints stop with a",
        time=MOTION,
        since=NOT_CB3,
        support=APPROXIMATE,
        note=_OFFSET,
    ),
    _row(
        "path_offset_set",
        (Param("offset", VECTOR6, unit="m, rad"), _OFFSET_TYPE),
        "None",
        "the offset to superimpose",
        since=NOT_CB3,
        support=APPROXIMATE,
        note=_OFFSET,
    ),
    _row(
        "path_offset_get",
        (_OFFSET_TYPE,),
        "pose, m and rad",
        "the offset in force",
        since=NOT_CB3,
        support=APPROXIMATE,
        note=_OFFSET,
    ),
    _row(
        "path_offset_set_alpha_filter",
        (Param("alpha", NUMBER, unit="0 to 1", low=0, high=1),),
        "None",
        "smooth the offset by an exponentially weighted average",
        since=NOT_CB3,
        support=APPROXIMATE,
        note=_OFFSET,
    ),
    _row(
        "path_offset_set_max_offset",
        (Param("transLimit", NUMBER, unit="m"), Param("rotLimit", NUMBER, unit="rad")),
        "None",
        "largest offset allowed, 0.1 m and 0.52 rad unless set",
        since=NOT_CB3,
        support=APPROXIMATE,
        note=_OFFSET,
    ),
)

_CONVEYORS: tuple[Builtin, ...] = (
    _row(
        "encoder_enable_pulse_decode",
        (
            _ENCODER_REQUIRED,
            Param(
                "decoder_type",
                INT,
                unit="0 off, 1 quadrature, 2 edges of A, 3 rising, 4 falling",
                low=0,
                high=4,
            ),
            _PIN_A,
            _PIN_B,
        ),
        "None",
        "count the pulses of a conveyor encoder on two digital inputs",
        support=APPROXIMATE,
        note="inputs are sampled once a cycle, not at 40 kHz",
    ),
    _row(
        "encoder_enable_set_tick_count",
        (_ENCODER_REQUIRED, Param("range_id", INT, unit="0 int32, 1 u8, 2 u16, 3 u24, 4 u32", low=0, high=4)),
        "None",
        "let the program feed the encoder",
        support=EXACT,
    ),
    _row(
        "encoder_set_tick_count",
        (_ENCODER_REQUIRED, Param("count", NUMBER, unit="ticks")),
        "None",
        "feed the encoder",
        support=EXACT,
    ),
    _row(
        "encoder_get_tick_count",
        (_ENCODER_REQUIRED,),
        "float, ticks",
        "the filtered count",
        since=releases("3.0", "5.0"),
        until=releases(None, "5.21"),
        support=APPROXIMATE,
        note="not filtered",
    ),
    _row(
        "encoder_get_tick_count",
        (_ENCODER_REQUIRED, Param("opt", STRING, "", 'empty or "raw"')),
        "int or float, ticks",
        "the filtered or the raw count",
        since=LATE_E_SERIES,
        source=MANUAL_LATE,
        support=APPROXIMATE,
        note="not filtered",
    ),
    _row(
        "encoder_unwind_delta_tick_count",
        (_ENCODER_REQUIRED, Param("delta_tick_count", NUMBER, unit="ticks")),
        "float or None, ticks",
        "remove the wrap from a difference of counts",
        support=EXACT,
    ),
    _row(
        "track_conveyor_linear",
        (
            Param("direction", POSE, unit="direction in base"),
            Param("ticks_per_meter", NUMBER, unit="1/m"),
            _ENCODER,
        ),
        "None",
        "let the following moves follow a linear conveyor",
        support=APPROXIMATE,
        note="smoothing of the count and the method to catch up with the belt are chosen",
    ),
    _row(
        "track_conveyor_circular",
        (
            Param("center", POSE, unit="m, rad"),
            Param("ticks_per_revolution", NUMBER, unit="ticks"),
            Param("rotate_tool", BOOL, False),
            _ENCODER,
        ),
        "None",
        "let the following moves follow a circular conveyor",
        support=APPROXIMATE,
        note="turns about the z axis of the centre; smoothing and the method to catch up are chosen",
    ),
    _row(
        "stop_conveyor_tracking",
        (Param("a", NUMBER, 20, "rad/s^2"),),
        "None",
        "stop tracking and bring the joints to rest",
        time=MOTION,
        support=EXACT,
    ),
    _row(
        "get_target_tcp_pose_along_path",
        (),
        "pose, m and rad",
        "target without conveyor and path offset",
        support=EXACT,
    ),
    _row(
        "get_target_tcp_speed_along_path",
        (),
        "pose, m/s and rad/s",
        "speed without conveyor and path offset",
        support=EXACT,
    ),
    _row(
        "conveyor_pulse_decode",
        (Param("type", INT, unit="0 off, 1 quadrature, 2 to 4 single", low=0, high=4), _PIN_A, _PIN_B),
        "None",
        "old form of encoder_enable_pulse_decode",
        deprecated=True,
        support=APPROXIMATE,
        note="inputs are sampled once a cycle, not at 40 kHz",
    ),
    _row(
        "get_conveyor_tick_count",
        (),
        "float, ticks",
        "old form of encoder_get_tick_count",
        deprecated=True,
        support=APPROXIMATE,
        note="not filtered",
    ),
    _row(
        "set_conveyor_tick_count",
        (
            Param("tick_count", NUMBER, unit="ticks"),
            Param("absolute_encoder_resolution", INT, 0, "range, 0 to 4"),
        ),
        "None",
        "old form of encoder_set_tick_count",
        deprecated=True,
        support=EXACT,
    ),
)

_WITH_5_22 = releases(None, "5.22", "10.9")  # 10.9 is of the same time
_WITH_5_24 = releases(None, "5.24", "10.11")
_TORQUE = "on the physics; acts without delay; what stops the arm, and how it stops, is chosen"
_WITH_SCALES = releases(None, "5.25", "10.12")  # in truth 5.25.1 and 10.12.1


def _list_text(numbers: tuple[float, ...]) -> str:
    return f"[{', '.join(map(str, numbers))}]"


_LATER: tuple[Builtin, ...] = (
    *tuple(
        _row(
            name,
            (
                Param("goal", ANY, unit="joints, pose, struct or frame name"),
                Param("a", NUMBER, 0.3, "fraction", low=0, high=1),
                Param("v", NUMBER, 0.3, "fraction", low=0, high=1),
                _BLEND,
            ),
            "None",
            summary,
            time=MOTION,
            support=APPROXIMATE,
            note="shares of what the drives can give; limited jerk without a blend",
            since=releases(None, "5.21", "10.8"),
            source=MANUAL_LATE,
        )
        for name, summary in (
            ("optimovej", "jerk-limited joint move"),
            ("optimovel", "jerk-limited straight tool move"),
        )
    ),
    _row(
        "motion_version_set",
        (Param("version", INT, unit="1 or 2", low=1, high=2),),
        "None",
        "choose the planner of movej and movel",
        support=APPROXIMATE,
        note="2: ramps of limited jerk, limits clamped to the arm's; blends as 1",
        since=_WITH_5_22,
        source=MANUAL_LATE,
    ),
    _row(
        "motion_version_get",
        (),
        "int",
        "the planner in force",
        since=_WITH_5_22,
        support=EXACT,
        source=MANUAL_LATE,
    ),
    _row(
        "jerk_gain_scaling_set",
        (Param("gain", NUMBER, unit="0.01 to 1", low=0.01, high=1),),
        "None",
        "scale the jerk limits",
        support=APPROXIMATE,
        note="accelerations change within 0.1 s at a gain of 1, chosen",
        since=_WITH_5_24,
        source=MANUAL_LATE,
    ),
    _row(
        "jerk_gain_scaling_get",
        (),
        "float",
        "the scale in force",
        since=_WITH_5_24,
        support=EXACT,
        source=MANUAL_LATE,
    ),
    _row(
        "direct_torque",
        (Param("torque", JOINTS, unit="Nm"), Param("friction_comp", BOOL, True)),
        "None",
        "one cycle of joint torque beside gravity compensation",
        time=MOTION,
        support=APPROXIMATE,
        note=_TORQUE,
        since=releases(None, "5.23", "10.11"),
        until=_WITH_SCALES,
        source=MANUAL_LATE,
    ),
    _row(
        "direct_torque",
        (
            Param("torque", JOINTS, unit="Nm"),
            Param("friction_comp", BOOL, None, "deprecated; not used beside a scale", shown="True"),
            Param("viscous_scale", JOINTS, None, "factors", shown=_list_text(VISCOUS_SCALE)),
            Param("coulomb_scale", JOINTS, None, "factors", shown=_list_text(COULOMB_SCALE)),
        ),
        "None",
        "one cycle of joint torque beside gravity compensation",
        time=MOTION,
        support=APPROXIMATE,
        note=_TORQUE,
        since=_WITH_SCALES,
        source=MANUAL_LATE,
    ),
    _row(
        "tool_wrench_limit_set",
        (
            Param("frame_offset", POSE, unit="m, rad"),
            *(Param(axis, NUMBER, None, unit="N", shown="no limit") for axis in ("Fx", "Fy", "Fz")),
            *(Param(axis, NUMBER, None, unit="Nm", shown="no limit") for axis in ("Mx", "My", "Mz")),
        ),
        "None",
        "limit the wrench that motion causes, in a frame at the flange",
        support=APPROXIMATE,
        note="of the declared payload, in moves to waypoints; not in their blends, in streams and in stops",
        since=releases(None, "5.19", "10.0"),
        source=MANUAL_LATE,
    ),
    _row(
        "tool_wrench_limit_disable",
        (),
        "None",
        "remove that limit",
        support=EXACT,
        since=releases(None, "5.19", "10.0"),
        source=MANUAL_LATE,
    ),
    _row(
        "force_mode_get_damping",
        (),
        "float",
        "damping in force",
        since=_WITH_5_24,
        support=EXACT,
        source=MANUAL_LATE,
    ),
    _row(
        "force_mode_get_gain_scaling",
        (),
        "float",
        "gain scaling in force",
        since=_WITH_5_24,
        support=EXACT,
        source=MANUAL_LATE,
    ),
)

ROWS: tuple[Builtin, ...] = _MOVES + _FORCE_AND_FREEDRIVE + _PATH_OFFSET + _CONVEYORS + _LATER

VARIABLES: tuple[ModuleVariable, ...] = tuple(
    ModuleVariable(name, value, unit, "motion", "URScript API Reference CB3 3.15.4, module motion, Variables")
    for name, value, unit in (
        ("a_joint_default", A_JOINT_DEFAULT, "rad/s^2"),
        ("a_tool_default", A_TOOL_DEFAULT, "m/s^2"),
        ("v_joint_default", V_JOINT_DEFAULT, "rad/s"),
        ("v_tool_default", V_TOOL_DEFAULT, "m/s"),
    )
)
