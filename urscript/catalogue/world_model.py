"""Builtins of the world model: named frames to attach, move and track (late 5.2x and PolyScope X)."""

from __future__ import annotations

from .chapter import MANUAL_X, Chapter
from .types import Builtin, Param, ParamType, Support
from .versions import releases

_row = Chapter("world_model").row

STRING, POSE = ParamType.STRING, ParamType.POSE

_NAME = Param("name", STRING)
_POSE = Param("pose", POSE, unit="m, rad")
_REFERENCE = Param("ref_name", STRING, "base")
_TRACKING = "frames that move by themselves are those of external axes (MotionPlus), which are not modelled"

ROWS: tuple[Builtin, ...] = tuple(
    _row(
        name,
        params,
        returns,
        summary,
        since=releases(None, "5.24", "10.11"),
        source=MANUAL_X,
        support=Support.DECLARED_ONLY if note is _TRACKING else Support.APPROXIMATE,
        note=note,
    )
    for name, params, returns, summary, note in (
        ("add_frame", (_NAME, _POSE, _REFERENCE), "None", "add a frame to the world", "at most 50 frames"),
        (
            "attach_frame",
            (Param("child", STRING), Param("parent", STRING)),
            "None",
            "attach a frame to another one; it stays where it is",
            "flange and TCP are those of the target",
        ),
        (
            "delete_frame",
            (_NAME,),
            "None",
            "remove a frame; what is attached to it stays where it is",
            "error texts are chosen",
        ),
        ("delete_all_frames", (), "None", "remove all added frames", "its masses too (chosen)"),
        (
            "move_frame",
            (_NAME, _POSE, _REFERENCE),
            "None",
            "place a frame anew",
            "also the base; error texts are chosen",
        ),
        (
            "get_pose",
            (_NAME, Param("rel_name", STRING), Param("ref_name", STRING, None, shown="rel_name")),
            "pose, m and rad",
            "one frame from another, in the axes of a third one",
            "flange and TCP are those of the target",
        ),
        (
            "convert_pose",
            (_POSE, Param("from_frame", STRING), Param("to_frame", STRING)),
            "pose, m and rad",
            "a pose in another frame",
            "flange and TCP are those of the target",
        ),
        ("reset_world_model", (), "None", "remove everything added; the base to the origin", "masses too"),
        ("is_frame", (_NAME,), "bool", "whether a frame of that name exists", "also those of the robot"),
        (
            "get_frame_parent",
            (_NAME,),
            "string",
            "what a frame is attached to",
            "run-time error for the world (chosen)",
        ),
        ("get_children", (_NAME,), "list of strings", "what is attached to a frame", "the oldest first"),
        (
            "frame_tracking_enable",
            (Param("frame_name", STRING),),
            "None",
            "let motion follow a frame",
            _TRACKING,
        ),
        ("frame_tracking_disable", (), "None", "stop following", _TRACKING),
        (
            "set_mass_properties",
            (
                Param("frame", STRING),
                Param("m", ParamType.NUMBER, unit="kg", low=0.0),
                Param("cog", ParamType.VECTOR3, unit="m"),
                Param("inertia", ParamType.JOINTS, unit="kg m^2"),
            ),
            "None",
            "mass, centre of gravity and inertia of a frame",
            "kept until the frame is removed",
        ),
        (
            "set_payload_from_attached_frames",
            (),
            "None",
            "payload from what is attached to the tool",
            "of all frames that hang on flange or TCP (chosen)",
        ),
    )
)
