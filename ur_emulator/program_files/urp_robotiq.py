"""Nodes of Robotiq's grippers in program files: Gripper, Gripper Activate and Grip Check.

They become calls of functions whose names begin with `rq_`. Those are in `robotiq.script` beside this module
and stand before all nodes of a program that calls one of them. Source: program files and the scripts that
PolyScope saved beside them (reference `grippers.md` 5). Titles of popups are the maker's.
"""

import math
from importlib import resources

from ur_emulator.program_files.installation import GripperCalibration
from ur_emulator.program_files.reader import number
from ur_emulator.program_files.urp_maker import Around, UrpMaker
from ur_emulator.program_files.urp_nodes import Node

ROBOTIQ = "Robotiq_Grippers"
"""Name of the software that the nodes are of."""

# Number of a gripper in programs <- its number on the serial line, and the number itself.
_NUMBERS = {"9": 1, "1": 1, "2": 2, "3": 3, "4": 4}


def declare_functions(maker: UrpMaker) -> None:
    """Put the functions before all nodes, and what the installation gives for them."""
    setup = maker.installation.grippers
    known = {} if setup is None else setup.calibrations
    rows = [known.get(number, GripperCalibration()) for number in range(1, 5)]
    maker.declare(
        ROBOTIQ,
        f"rq_current_limit_enabled = {setup is not None and setup.is_current_limited}",
        f"gripper_closed_norm = {[row.closed_position for row in rows]}",
        f"gripper_open_norm = {[row.open_position for row in rows]}",
        f"gripper_closed_mm = {[row.closed_width for row in rows]}",
        f"gripper_open_mm = {[row.open_width for row in rows]}",
        resources.files(__package__).joinpath("robotiq.script").read_text("utf-8"),
        "rq_init()",
    )


def write_gripper_node(maker: UrpMaker, node: Node, around: Around) -> None:
    """Write a node by its type."""
    kind = node.get("strategyProgramNodeType")
    declare_functions(maker)
    match kind:
        case "Gripper":
            _write_motion(maker, node, around)
        case "Gripper Activate":
            reset = node.data.get("ResetAndActivateKey") == "true"
            maker.writer.label(
                node.number, "Gripper Reset and Activate" if reset else "Gripper Activate", around.mark
            )
            maker.writer.add("rq_init()", f"rq_activate_all_grippers({reset})")
        case "Grip Check":
            _write_check(maker, node, around)
        case _:
            raise node.source.unknown(f"a node {kind!r} of the URCap {ROBOTIQ!r}")


def _write_motion(maker: UrpMaker, node: Node, around: Around) -> None:
    writer, n = maker.writer, _gripper(node, "slaveIds")
    position, speed, force = (_percent(node, f"{key}InDouble", key) for key in ("position", "speed", "force"))
    writer.label(node.number, f"Gripper {_motion(maker, n, position)} ({n})", around.mark)
    request = f'{_counts(position)}, {_counts(speed)}, {_counts(force)}, "{n}"'
    with writer.block(f"if not(gripper_connected[{n - 1}]):"):
        writer.add(f'popup("Gripper {n} does not answer.", "No connection", False, True, True)')
    with writer.block(f'if not(rq_is_gripper_activated("{n}")):'):
        writer.add(f'popup("Gripper {n} must be activated first.", "Not activated", False, True, True)')
    writer.add(f"rq_set_pos_spd_for({request})", f"rq_wait_pos_spe_for_request({request})")
    writer.add(f'rq_go_to("{n}")')
    if node.data.get("blocking", "true") == "true":
        writer.add(f'rq_wait("{n}")')


def _motion(maker: UrpMaker, n: int, position: float) -> str:
    """Return what a label says of a motion to a position [%]."""
    if position in (0.0, 100.0):
        return "Close" if position else "Open"
    setup = maker.installation.grippers
    calibration = None if setup is None else setup.calibrations.get(n)
    if calibration is None:
        return f"Move{_rounded(position)}%"
    return f"Move{_rounded(calibration.width(position))}mm"


def _write_check(maker: UrpMaker, node: Node, around: Around) -> None:
    writer, data, n = maker.writer, node.data, _gripper(node, "GripperIdKey")
    branches = {child.get("strategyProgramNodeType"): child for child in node.children}
    if "If" not in branches:
        raise node.source.error("a Grip Check node has no If")
    detects = data.get("ObjectDetectedKey", "true") == "true"
    condition = f'{"" if detects else "not "}rq_is_object_detected("{n}")'
    label = "If object detected" if detects else "If object not detected"
    if data.get("DimensionValidationKey") == "true":
        middle, more, less = (
            _percent(node, key)
            for key in ("DimensionKey", "DimensionDimensionPositiveGapKey", "DimensionNegativeGapKey")
        )
        low, high = round((middle - less) * 2.55, 2), round((middle + more) * 2.55, 2)
        position = f'rq_current_pos("{n}")'
        condition += f" and {position} >= {low} and {position} <= {high}"
        label = "If grip validated"
    writer.label(node.number, "Grip Check", around.mark)
    writer.label(branches["If"].number, label + " " * 10, "noBreak")
    with writer.branch(f"if ({condition}):"):
        maker.write_children(branches["If"], around)
    if "Else" in branches:
        with writer.branch("else:"):
            writer.label(branches["Else"].number, "Else", "noBreak")
            maker.write_children(branches["Else"], around)
    writer.add("end")


def _gripper(node: Node, key: str) -> int:
    """Return the number of the gripper that a node names, 1 if it names none."""
    name = node.data.get(key, "").strip("[] ") or "9"
    if name not in _NUMBERS:
        raise node.source.unknown(f"a node of the grippers {name[:100]!r}")
    return _NUMBERS[name]


def _percent(node: Node, *keys: str) -> float:
    """Return the value under the first of the keys that is there [%]; ProgramFileError without one."""
    text = next((node.data[key] for key in keys if key in node.data), None)
    value = number(node.source.tree, text, f"{keys[-1]} of a {node.get('strategyProgramNodeType')} node")
    if not 0.0 <= value <= 100.0:
        raise node.source.error(f"{keys[-1]} is {value:g} %: use 0 to 100")
    return value


def _counts(percent: float) -> int:
    return _rounded(percent * 255.0 / 100.0)


def _rounded(value: float) -> int:
    """Return the nearest whole number; a half is rounded up."""
    return math.floor(value + 0.5)
