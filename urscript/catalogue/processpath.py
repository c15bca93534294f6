"""Builtins of the manual's module "processpath": queued tool paths of the Remote TCP package (e-Series only).

Without that package installed a controller does not know these names.
"""

from __future__ import annotations

from .chapter import Chapter
from .types import Builtin, Param, ParamType, TimeClass
from .versions import NOT_CB3

_row = Chapter("processpath").row

BOOL, INT, NUMBER, STRING, POSE = (
    ParamType.BOOL,
    ParamType.INT,
    ParamType.NUMBER,
    ParamType.STRING,
    ParamType.POSE,
)

_A = Param("a", NUMBER, unit="m/s^2")
_V = Param("v", NUMBER, unit="m/s")
_R = Param("r", NUMBER, unit="m")

_MISSING = "needs the package Remote TCP, which is not installed: a real box then does not know the name"

ROWS: tuple[Builtin, ...] = tuple(
    _row(name, params, returns, summary, time=time, since=NOT_CB3, note=_MISSING)
    for name, params, returns, summary, time in (
        (
            "mc_initialize",
            (Param("mode", INT), Param("tcp", POSE), Param("doc", INT, 6, "degrees of constraint")),
            "None",
            "start a path",
            TimeClass.ZERO,
        ),
        ("mc_set_pcs", (Param("pcs", POSE),), "None", "frame of the path", TimeClass.ZERO),
        ("mc_add_linear", (Param("pose", POSE), _A, _V, _R), "int", "queue a line", TimeClass.ZERO),
        (
            "mc_add_circular",
            (Param("pose_via", POSE), Param("pose_to", POSE), _A, _V, _R, Param("mode", INT, 0)),
            "int",
            "queue an arc",
            TimeClass.ZERO,
        ),
        (
            "mc_load_path",
            (Param("nc_file", STRING), Param("useFeedRate", BOOL)),
            "int",
            "read a path file",
            TimeClass.ZERO,
        ),
        (
            "mc_add_path",
            (Param("path_id", INT), _A, _V, _R),
            "int",
            "queue a path read from a file",
            TimeClass.ZERO,
        ),
        (
            "mc_run_motion",
            (Param("id", INT, -1),),
            "None",
            "run the queue up to an id, -1 for all",
            TimeClass.MOTION,
        ),
        ("mc_set_speed_factor", (Param("s", NUMBER),), "None", "scale the speed of the path", TimeClass.ZERO),
        ("mc_get_target_rtcp_speed", (), "float, m/s", "speed along the path", TimeClass.ZERO),
    )
)
