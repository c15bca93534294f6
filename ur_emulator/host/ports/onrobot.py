"""Port 41414: grippers of OnRobot by XML-RPC, as the maker's software on a robot, or its box, has it.

Types are strict: an int for a double is a fault. A device that is not there, or has no power, answers with
values that cannot be. Source: reference `grippers.md` 3.1; codes of faults: of the library whose -501 it is.
"""

import json
from collections.abc import Sequence
from math import isfinite
from typing import Any, Final
from xmlrpc.client import Fault, dumps

from protocol.errors import RemoteProtocolError
from protocol.xmlrpc import CallReader
from ur_emulator.host.ports.http import HttpAnswer, HttpError, HttpRequest, check_origin
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.grippers import OperateGrippers
from ur_emulator.machine.tools.onrobot import FIRST_UNIT, STATUS, OnRobotGripper

MOST_BYTES: Final = 8 * 1024  # of a call: it is read in one go
_MOST_VALUES: Final = 32  # of a call: no method takes more than four, and a thousand take 3 ms

_2FG, _VG = "of a 2FG, which is not there", "of a VG10, which is not there"
# Result, arguments, meaning, methods; the first argument of a device is its place: 0; 1 and 2 of two.
_TABLE: Final = (
    ("array", "", "names of all methods", "system.listMethods"),
    ("array", "string", "types of result and arguments", "system.methodSignature"),
    ("string", "string", "what a method does", "system.methodHelp"),
    ("string", "", "the devices, as JSON", "get_discovery"),
    ("boolean", "int int", "whether a place has a device with a product code", "cb_is_device_connected"),
    ("int", "int", "takes the type of the robot", "cb_report_robot_type"),
    ("int", "", "turns the supply of the tool off and on", "cb_reset_tool_power"),
    ("int", "int double double", "goes to a width [mm] with a force [N]", "rg_grip"),
    ("int", "int", "stops", "rg_stop"),
    ("int", "int double", "sets the thickness of a fingertip [mm]", "rg_set_fingertip_offset"),
    ("int", "int double", "calibrates the width", "rg_calibration"),
    ("struct", "int", "all values below, by name", "rg_get_all_variables"),
    ("double", "int", "mm", "rg_get_width rg_get_depth rg_get_relative_depth rg_get_fingertip_offset"),
    ("double", "int", "mm/s", "rg_get_speed"),
    ("double", "int", "of an arm, rad and rad/s", "rg_get_angle rg_get_angle_speed"),
    ("int", "int", "the bits below, the first is the lowest", "rg_get_status"),
    ("boolean", "int", "a bit of the status", " ".join(f"rg_get_{name}" for name in STATUS)),
    ("int", "int double int int", _2FG, "twofg_grip_external twofg_grip_internal"),
    ("int", "int", _2FG, "twofg_stop twofg_get_max_force twofg_get_force twofg_get_status"),
    ("boolean", "int", _2FG, "twofg_get_busy twofg_get_grip_detected"),
    ("double", "int", _2FG, "twofg_get_external_width twofg_get_internal_width"),
    ("double", "int", _2FG, "twofg_get_min_external_width twofg_get_max_external_width"),
    ("double", "int", _2FG, "twofg_get_min_internal_width twofg_get_max_internal_width"),
    ("int", "int int double", _VG, "vg10_grip"),
    ("int", "int boolean boolean", _VG, "vg10_release vg10_idle"),
    ("struct", "int", _VG, "vg10_get_vacuum"),
    ("array", "int", _VG, "vg10_get_all_double_variables"),
)
METHODS: Final = {name: row[:3] for row in _TABLE for name in row[3].split()}

# Methods that change the gripper, and what it then does.
_OPERATIONS: Final = {"rg_grip": "grip", "rg_stop": "stop", "rg_set_fingertip_offset": "set_offset"}
_TYPES: Final = {bool: "boolean", int: "int", float: "double", str: "string"}
# What a device that is not there answers, by method or by type of its result; -4 by what does something.
_ABSENT: Final = {"int": -1, "double": -999.0, "boolean": False, "struct": {}, "array": [-999.0, -999.0]} | {
    "rg_get_busy": True,
    "rg_get_safety_failed": True,
    "vg10_get_vacuum": {"a_vacuum": -999.0, "b_vacuum": -999.0},
}


class OnRobotAnswers:
    """Answers calls: from the present state, or after the cycle in which the call has acted."""

    def __init__(self, box: ServedBox, grippers: Sequence[OnRobotGripper], own_host: str) -> None:
        """`own_host` is the address that the port is bound to."""
        self._box = box
        self._grippers = {gripper.unit - FIRST_UNIT: gripper for gripper in grippers}
        self._own_host = own_host

    def answer(self, request: HttpRequest, connection: Connection) -> Steps[HttpAnswer]:
        """Answer a call."""
        check_origin(request.headers, self._own_host)
        if request.method != "POST":
            raise HttpError(405, f"{request.method} given: calls come with POST", ("Allow", "POST"))
        try:
            reader = CallReader(_MOST_VALUES)
            reader.feed(request.body)
            answer: Any = ((yield from self._call(*reader.result())),)
        except RemoteProtocolError as error:
            answer = Fault(-503, str(error))
        except KeyError as name:
            answer = Fault(-506, f"there is no method {str(name)[:80]}: see system.listMethods")
        except Fault as fault:
            answer = fault
        return HttpAnswer(200, dumps(answer, methodresponse=True).encode(), content_type="text/xml")

    def _call(self, name: str, arguments: list[Any]) -> Steps[Any]:
        """Return the result of a call, or raise its Fault."""
        result, expected, _ = METHODS[name]
        given = " ".join(_TYPES.get(type(argument), "other") for argument in arguments)
        if given != expected:
            raise Fault(-501, f"{name} takes ({expected}), not ({given})")
        if not all(isfinite(argument) for argument in arguments if type(argument) is float):
            raise Fault(-501, f"{name} takes finite numbers, not {arguments}"[:200])
        if result == "int" and name.startswith("cb_"):
            if name == "cb_reset_tool_power":
                units = tuple(gripper.unit for gripper in self._grippers.values())
                yield from self._box.apply(OperateGrippers(units, "cycle_power"))
            return 0
        match name, arguments:
            case "system.listMethods", _:
                return list(METHODS)
            case "system.methodSignature", (other,):
                return [[METHODS[other][0], *METHODS[other][1].split()]]
            case "system.methodHelp", (other,):
                return METHODS[other][2]
            case "get_discovery", _:
                return json.dumps({"devices": [*map(_described, self._grippers.values())]})
        gripper = self._grippers.get(arguments[0])
        if gripper is None or not gripper.has_power or not name.startswith(("rg_", "cb_")):
            return -4 if result == "int" and "_get_" not in name else _ABSENT.get(name, _ABSENT[result])
        match name, arguments[1:]:
            case "cb_is_device_connected", (product,):
                return product == gripper.linkage.product
            case "rg_get_all_variables", _:
                return gripper.values()
            case method, values if operation := _OPERATIONS.get(method):
                yield from self._box.apply(OperateGrippers((gripper.unit,), operation, tuple(values)))
            case _, ():
                return gripper.values()[name.removeprefix("rg_get_")]
        return 0


def _described(gripper: OnRobotGripper) -> dict[str, Any]:
    names = ("deviceId", "deviceName", "productCode", "status", "serial", "warning", "error", "update")
    place, product, status = gripper.unit - FIRST_UNIT, gripper.linkage.product, gripper.summary()["status"]
    return dict(zip(names, (place, gripper.tool.title, product, status, "", "", "", ""), strict=True))
