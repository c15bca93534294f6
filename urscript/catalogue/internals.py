"""Builtins of the manual's module "internals": robot state, kinematics, settings, program flow, strings."""

from __future__ import annotations

from .chapter import DRIVER_SCRIPT, FIELD_USE, MANUAL_E, MANUAL_LATE, POLYSCOPE_EXPORT, Chapter
from .types import Builtin, Param, ParamType, Support, TimeClass
from .versions import LATE_E_SERIES, Generation, releases

_row = Chapter("internals").row

ANY, BOOL, INT, NUMBER, STRING = (
    ParamType.ANY,
    ParamType.BOOL,
    ParamType.INT,
    ParamType.NUMBER,
    ParamType.STRING,
)
POSE, JOINTS, VECTOR3, VECTOR6 = ParamType.POSE, ParamType.JOINTS, ParamType.VECTOR3, ParamType.VECTOR6
LIST, POSE_OR_JOINTS = ParamType.LIST, ParamType.POSE_OR_JOINTS
EXACT, APPROXIMATE = Support.EXACT, Support.APPROXIMATE
BOTH = (Generation.CB3, Generation.E_SERIES)
_WITH_3_14_3 = f"{MANUAL_E}, module internals; CB3: {DRIVER_SCRIPT}"

_ACTIVE_TCP = Param("tcp", POSE, None, "m, rad", shown="active TCP")
_Q_NEAR = Param("qnear", JOINTS, None, "rad", shown="current joint positions")
_TOLERANCES = (
    Param("maxPositionError", NUMBER, 1e-10, "m"),
    Param("maxOrientationError", NUMBER, 1e-10, "rad"),
)
_MASS = Param("m", NUMBER, unit="kg", low=0)
_STRING = Param("str", STRING)

_SIMULATED_SENSOR = "from the simulated arm; the real estimate filters differently"

_STATE: tuple[Builtin, ...] = (
    _row("get_actual_joint_positions", (), "list of 6, rad", "measured joint positions", support=EXACT),
    _row("get_target_joint_positions", (), "list of 6, rad", "commanded joint positions", support=EXACT),
    _row(
        "get_joint_positions",
        (),
        "list of 6, rad",
        "commanded joint positions without the offsets of force mode",
        support=EXACT,
        undocumented=BOTH,
        source=DRIVER_SCRIPT,
    ),
    _row("get_actual_joint_speeds", (), "list of 6, rad/s", "measured joint speeds", support=EXACT),
    _row("get_target_joint_speeds", (), "list of 6, rad/s", "commanded joint speeds", support=EXACT),
    _row(
        "get_actual_joint_positions_history",
        (Param("steps", INT, 0, "control cycles back", low=0),),
        "list of 6, rad",
        "measured joint positions some cycles ago",
        since=releases("3.14", "5.0", "10.0"),
        support=APPROXIMATE,
        undocumented=(Generation.CB3,),
        note="the length of the controller's buffer is not documented",
        source=_WITH_3_14_3,
    ),
    _row(
        "get_joint_torques",
        (),
        "list of 6, Nm",
        "torques less gravity and friction",
        support=APPROXIMATE,
        note=_SIMULATED_SENSOR,
    ),
    _row(
        "get_joint_temp",
        (Param("j", INT, unit="joint", low=0, high=5),),
        "float, degree C",
        "joint temperature",
        support=APPROXIMATE,
        note="no thermal model of the housing",
    ),
    _row(
        "get_controller_temp",
        (),
        "float, degree C",
        "control box temperature",
        support=APPROXIMATE,
        note="warms up by 8 degrees after the start, chosen",
    ),
    _row("get_actual_tcp_pose", (), "pose, m and rad", "measured TCP pose in base", support=EXACT),
    _row(
        "tool_pose",
        (),
        "pose, m and rad",
        "TCP pose in base, the frame of force mode in the tool feature",
        support=APPROXIMATE,
        undocumented=BOTH,
        note="taken as measured",
        source=POLYSCOPE_EXPORT,
    ),
    _row("get_target_tcp_pose", (), "pose, m and rad", "commanded TCP pose in base", support=EXACT),
    _row("get_actual_tool_flange_pose", (), "pose, m and rad", "measured flange pose in base", support=EXACT),
    _row(
        "get_actual_tcp_speed",
        (),
        "pose, m/s and rad/s",
        "measured TCP velocity in base",
        support=EXACT,
    ),
    _row(
        "get_target_tcp_speed",
        (),
        "pose, m/s and rad/s",
        "commanded TCP velocity in base",
        support=EXACT,
    ),
    _row(
        "get_target_waypoint",
        (),
        "pose, m and rad",
        "goal of the move in progress, else the commanded TCP pose",
        since=releases("3.0", "5.3", "10.0"),
        support=EXACT,
    ),
    _row(
        "get_tcp_force",
        (),
        "pose, N and Nm",
        "external wrench, in base orientation",
        support=APPROXIMATE,
        note=_SIMULATED_SENSOR,
    ),
    _row(
        "force", (), "float, N", "length of the external force", support=APPROXIMATE, note=_SIMULATED_SENSOR
    ),
    _row(
        "get_tcp_offset",
        (),
        "pose, m and rad",
        "active TCP offset from the flange",
        since=releases("3.6", "5.0", "10.0"),
        support=EXACT,
    ),
    _row(
        "get_tool_accelerometer_reading",
        (),
        "list of 3, m/s^2",
        "tool accelerometer",
        support=APPROXIMATE,
        note=_SIMULATED_SENSOR,
    ),
    _row(
        "get_tool_current",
        (),
        "float, A",
        "current drawn by the tool",
        support=APPROXIMATE,
        note="of a resistor at the tool's supply, chosen",
    ),
    _row("get_steptime", (), "float, s", "length of a control cycle", support=EXACT),
    _row("get_target_payload", (), "float, kg", "active payload mass", support=EXACT),
    _row(
        "get_target_payload_cog",
        (),
        "list of 3, m",
        "active centre of gravity from the flange",
        support=EXACT,
    ),
    _row(
        "get_target_payload_inertia",
        (),
        "list of 6, kg m^2",
        "active payload inertia",
        since=releases(None, "5.10", "10.0"),
        support=EXACT,
    ),
    _row("is_steady", (), "bool", "whether the target velocity has been zero for 0.5 s", support=EXACT),
    _row(
        "is_within_safety_limits",
        (
            Param("pose", POSE_OR_JOINTS, unit="m, rad, or joint positions in rad"),
            _Q_NEAR,
        ),
        "bool",
        "whether a pose or joint position is reachable inside the safety limits",
        support=APPROXIMATE,
        note="checks reach, joint ranges, safety planes and tool direction",
    ),
    _row(
        "tool_contact",
        (Param("direction", VECTOR6, [0, 0, 0, 0, 0, 0], "in base; zero for any"),),
        "int",
        "cycles back to the start of a contact, 0 for none",
        since=releases("3.14", "5.4", "10.0"),
        support=APPROXIMATE,
        note="a force that has risen by 15 N within a second",
        undocumented=(Generation.CB3,),
        source=_WITH_3_14_3,
    ),
)

_KINEMATICS: tuple[Builtin, ...] = (
    _row(
        "get_forward_kin",
        (Param("q", JOINTS, None, "rad", shown="current joint positions"), _ACTIVE_TCP),
        "pose, m and rad",
        "forward kinematics of the calibrated arm",
        support=EXACT,
    ),
    _row(
        "get_inverse_kin",
        (Param("x", POSE, unit="m, rad"), _Q_NEAR, *_TOLERANCES, _ACTIVE_TCP),
        "list of 6, rad",
        "joint positions nearest qnear that put the TCP at x; run-time error if there are none",
        support=EXACT,
    ),
    _row(
        "get_inverse_kin_has_solution",
        (Param("pose", POSE, unit="m, rad"), _Q_NEAR, *_TOLERANCES, _ACTIVE_TCP),
        "bool",
        "whether get_inverse_kin would find a solution",
        since=releases("3.15", "5.9", "10.0"),
        support=EXACT,
    ),
)

_SETTINGS: tuple[Builtin, ...] = (
    _row(
        "set_tcp",
        (Param("pose", POSE, unit="m, rad"),),
        "None",
        "active TCP offset from the flange",
        since=releases("3.0", "5.0"),
        until=releases(None, "5.21"),
        support=EXACT,
    ),
    _row(
        "set_tcp",
        (Param("pose", POSE, unit="m, rad"), Param("tcp_name", STRING, "")),
        "None",
        "active TCP offset from the flange",
        since=LATE_E_SERIES,
        source=MANUAL_LATE,
        support=APPROXIMATE,
        note="the name is not used",
    ),
    _row(
        "set_payload",
        (_MASS, Param("cog", VECTOR3, None, "m from the flange", shown="the TCP")),
        "None",
        "payload mass and centre of gravity",
        support=EXACT,
    ),
    _row("set_payload_mass", (_MASS,), "None", "payload mass alone", support=EXACT),
    _row(
        "set_payload_cog",
        (Param("CoG", VECTOR3, unit="m from the flange"),),
        "None",
        "centre of gravity alone",
        support=EXACT,
    ),
    _row(
        "set_target_payload",
        (
            _MASS,
            Param("cog", VECTOR3, unit="m"),
            Param("inertia", JOINTS, [0, 0, 0, 0, 0, 0], "kg m^2"),
            Param("transition_time", NUMBER, 0, "s", low=0),
        ),
        "None",
        "payload mass, centre of gravity and inertia at once",
        support=APPROXIMATE,
        note="the arm carries what is declared; a transition is a straight line (chosen)",
        since=releases(None, "5.10", "10.0"),
        # The manual of 5.11 has no fourth parameter; the maker's driver gives it from 5.10 on.
        source=f"{MANUAL_E}, module internals, and the maker's driver script",
    ),
    _row(
        "set_gravity",
        (Param("d", VECTOR3, unit="m/s^2"),),
        "None",
        "acceleration of the base against gravity",
        support=APPROXIMATE,
        note="kept only; the arm always stands upright",
    ),
)

_FLOW: tuple[Builtin, ...] = (
    _row(
        "sleep",
        (Param("t", NUMBER, unit="s"),),
        "None",
        "let time pass",
        time=TimeClass.FRAMES,
        support=EXACT,
    ),
    _row("sync", (), "None", "give up the rest of this control cycle", time=TimeClass.FRAMES, support=EXACT),
    _row(
        "textmsg",
        (Param("s1", ANY), Param("s2", ANY, "")),
        "None",
        "write a line to the log",
        support=EXACT,
        nan_ok=True,
    ),
    _row(
        "varmsg",
        (Param("name", STRING), Param("value", ANY)),
        "None",
        "show a value under a name",
        since=releases("3.0", "5.0"),
        support=APPROXIMATE,
        note="no document says where; it has no effect here",
        undocumented=BOTH,
        source=FIELD_USE,
    ),
    _row(
        "popup",
        (
            Param("s", ANY),
            Param("title", STRING, "Popup"),
            Param("warning", BOOL, False),
            Param("error", BOOL, False),
            Param("blocking", BOOL, False),
        ),
        "None",
        "show a message to the operator",
        time=TimeClass.BLOCKING,
        support=APPROXIMATE,
        note="the text is sent to the clients; the dashboard's close popup presses Continue",
    ),
    *(
        _row(
            f"request_{kind}_from_primary_client",
            (Param("text", STRING),),
            returned,
            f"ask the operator for a {kind}",
            time=TimeClass.BLOCKING,
            support=APPROXIMATE,
            undocumented=BOTH,
            note="waits for AnswerRequest of the controller; no client's reply is known",
            source=POLYSCOPE_EXPORT,
        )
        for kind, returned in (
            ("boolean", "bool"),
            ("integer", "int"),
            ("float", "float"),
            ("string", "string"),
        )
    ),
    _row(
        "powerdown",
        (),
        "None",
        "shut down the arm and the controller",
        support=APPROXIMATE,
        note="the arm loses its power, the controller stays up",
    ),
    _row(
        "protective_stop",
        (),
        "None",
        "trigger a protective stop, which pauses the program",
        since=releases("3.8", "5.0", "10.0"),
        support=EXACT,
        undocumented=BOTH,
        source=FIELD_USE,
    ),
)

_STRINGS: tuple[Builtin, ...] = tuple(
    _row(name, params, returns, summary, since=releases("3.8", "5.0", "10.0"), support=EXACT, nan_ok=True)
    for name, params, returns, summary in (
        # A maintainer of the ROS 2 driver (issue 952) names 3.8.0 as the first release.
        ("str_at", (Param("src", STRING), Param("index", INT)), "string", "one byte of a string"),
        ("str_cat", (Param("op1", ANY), Param("op2", ANY)), "string", "the texts of two values, joined"),
        ("str_empty", (_STRING,), "bool", "whether a string has no bytes"),
        ("str_len", (_STRING,), "int", "number of bytes"),
        (
            "str_find",
            (Param("src", STRING), Param("target", STRING), Param("start_from", INT, 0)),
            "int",
            "index of the first occurrence, -1 if there is none",
        ),
        (
            "str_sub",
            (Param("src", STRING), Param("index", INT), Param("len", INT, None, shown="to the end")),
            "string",
            "part of a string",
        ),
        ("to_num", (_STRING,), "int or float", "the number a string spells"),
        ("to_str", (Param("val", ANY),), "string", "text of a value"),
    )
)

_HOLDING = "a resting joint gives way by 0.3 rad before it is stopped; disabled as a moving one; chosen"
_LIGHT = "accepted without effect: no port shows the light"
_MODEL = "of the model that the drives use, with the declared payload (chosen)"
_JOINT_ARGUMENTS = (Param("q", JOINTS, None, "rad", shown="current joint positions"),)

_LATER: tuple[Builtin, ...] = (
    *(
        _row(name, params, returns, summary, since=since, source=MANUAL_LATE, support=support, note=note)
        for since, rows in (
            (
                releases(None, "5.15", "10.0"),
                (
                    (
                        "set_base_acceleration",
                        (Param("a", VECTOR3, unit="m/s^2"),),
                        "None",
                        "acceleration of the base",
                        APPROXIMATE,
                        "kept only; the base of the simulated arm never moves",
                    ),
                    (
                        "estimate_payload",
                        (Param("poses", LIST, unit="at least four"), Param("wrenches", LIST)),
                        "struct(mass, cog)",
                        "payload from wrenches measured at several poses",
                        APPROXIMATE,
                        "least squares (chosen)",
                    ),
                    (
                        "high_holding_torque_disable",
                        (),
                        "None",
                        "hold with less torque at rest",
                        APPROXIMATE,
                        _HOLDING,
                    ),
                    (
                        "high_holding_torque_enable",
                        (),
                        "None",
                        "hold with full torque at rest",
                        APPROXIMATE,
                        _HOLDING,
                    ),
                    ("set_baselight_off", (), "None", "base light off (UR20, UR30)", APPROXIMATE, _LIGHT),
                    (
                        "set_baselight_iec",
                        (),
                        "None",
                        "base light shows the state (UR20, UR30)",
                        APPROXIMATE,
                        _LIGHT,
                    ),
                    (
                        "set_baselight_solid",
                        tuple(Param(colour, INT, unit="0 to 255", low=0, high=255) for colour in "rgb"),
                        "None",
                        "base light in one colour (UR20, UR30)",
                        APPROXIMATE,
                        _LIGHT,
                    ),
                ),
            ),
            (
                releases(None, "5.17", "10.0"),
                (
                    (
                        "get_tool_temp",
                        (),
                        "float, degree C",
                        "tool temperature",
                        APPROXIMATE,
                        "that of the last joint",
                    ),
                    ("get_gravity", (), "list of 3, m/s^2", "gravity in force", EXACT, ""),
                    (
                        "get_base_acceleration",
                        (),
                        "list of 3, m/s^2",
                        "base acceleration in force",
                        EXACT,
                        "",
                    ),
                ),
            ),
            (
                releases(None, "5.24", "10.11"),
                (
                    (
                        "get_actual_joint_accelerations",
                        (),
                        "list of 6, rad/s^2",
                        "measured joint accelerations",
                        APPROXIMATE,
                        "of a parabola through the positions of the last 20 ms, so 10 ms old; chosen",
                    ),
                    (
                        "get_target_joint_accelerations",
                        (),
                        "list of 6, rad/s^2",
                        "commanded joint accelerations",
                        EXACT,
                        "",
                    ),
                ),
            ),
        )
        for name, params, returns, summary, support, note in rows
    ),
    *(
        _row(
            name,
            params,
            returns,
            summary,
            since=releases(None, "5.23", "10.11"),
            source=MANUAL_LATE,
            support=APPROXIMATE if note else EXACT,
            note=note,
        )
        for name, params, returns, summary, note in (
            (
                "get_jacobian",
                (*_JOINT_ARGUMENTS, _ACTIVE_TCP),
                "matrix 6 x 6",
                "geometric Jacobian in base",
                "",
            ),
            (
                "get_jacobian_time_derivative",
                (*_JOINT_ARGUMENTS, Param("qd", JOINTS, None, "rad/s", shown="current speeds"), _ACTIVE_TCP),
                "matrix 6 x 6",
                "time derivative of the Jacobian",
                "",
            ),
            (
                "get_mass_matrix",
                (*_JOINT_ARGUMENTS, Param("include_rotors_inertia", BOOL, False)),
                "matrix 6 x 6, kg m^2",
                "joint space inertia",
                _MODEL,
            ),
            (
                "get_coriolis_and_centrifugal_torques",
                (*_JOINT_ARGUMENTS, Param("qd", JOINTS, None, "rad/s", shown="current speeds")),
                "list of 6, Nm",
                "torques due to motion",
                _MODEL,
            ),
        )
    ),
    _row(
        "time",
        (),
        "struct(sec, nanosec)",
        "time since the controller was started",
        support=EXACT,
        since=releases(None, "5.17"),
        until=releases(None, "5.18"),
        source=MANUAL_LATE,
    ),
    _row(
        "time",
        (Param("mode", INT, 0, "0 uptime, 2 system GMT", choices=(0, 2)),),
        "struct(sec, nanosec)",
        "clock of the controller",
        support=APPROXIMATE,
        note="the system's clock begins on 2021-11-30 with the controller and counts robot time",
        since=releases(None, "5.18", "10.0"),
        source=MANUAL_LATE,
    ),
)

ROWS: tuple[Builtin, ...] = _STATE + _KINEMATICS + _SETTINGS + _FLOW + _STRINGS + _LATER
