"""Builtins of the world model: named frames to attach, move and track (late 5.2x and PolyScope X)."""

from __future__ import annotations

from .chapter import MANUAL_X, Chapter
from .types import Builtin, Param, ParamType
from .versions import releases

_row = Chapter("world_model").row

STRING, POSE, NUMBER = ParamType.STRING, ParamType.POSE, ParamType.NUMBER

_NAME = Param("name", STRING)
_POSE = Param("pose", POSE, unit="m, rad")
_REFERENCE = Param("ref_name", STRING, "base")

ROWS: tuple[Builtin, ...] = tuple(
    _row(name, params, returns, summary, since=releases(None, "5.24", "10.11"), source=MANUAL_X)
    for name, params, returns, summary in (
        ("add_frame", (_NAME, _POSE, _REFERENCE), "None", "add a frame"),
        ("attach_frame", (Param("child", STRING), Param("parent", STRING)), "None", "attach one to another"),
        ("delete_frame", (_NAME,), "None", "remove a frame"),
        ("delete_all_frames", (), "None", "remove all added frames"),
        ("move_frame", (_NAME, _POSE, _REFERENCE), "None", "place a frame anew"),
        (
            "get_pose",
            (_NAME, Param("rel_name", STRING), _REFERENCE),
            "pose, m and rad",
            "one frame from another",
        ),
        (
            "convert_pose",
            (_POSE, Param("from_frame", STRING), Param("to_frame", STRING)),
            "pose, m and rad",
            "a pose in another frame",
        ),
        ("reset_world_model", (), "None", "remove everything added"),
        ("is_frame", (_NAME,), "bool", "whether a frame of that name exists"),
        ("get_frame_parent", (_NAME,), "string", "what a frame is attached to"),
        ("get_children", (_NAME,), "list of strings", "what is attached to a frame"),
        ("frame_tracking_enable", (Param("frame_name", STRING),), "None", "let motion follow a frame"),
        ("frame_tracking_disable", (), "None", "stop following"),
        (
            "set_mass_properties",
            (
                Param("frame", STRING),
                Param("m", NUMBER, unit="kg"),
                Param("cog", ParamType.VECTOR3, unit="m"),
                Param("inertia", ParamType.JOINTS, unit="kg m^2"),
            ),
            "None",
            "mass, centre of gravity and inertia of a frame",
        ),
        ("set_payload_from_attached_frames", (), "None", "payload from what is attached to the tool"),
    )
)
