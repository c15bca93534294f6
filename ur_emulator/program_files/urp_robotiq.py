"""Nodes of Robotiq's grippers in program files: Gripper, Gripper Activate and Grip Check.

They become calls of the functions in `robotiq.script`, which stand before all nodes of such a program.
Source: program files and the scripts saved beside them (reference `grippers.md` 5), as are popups' titles.
"""

import math
from importlib import resources

from ur_emulator.program_files.installation import GripperCalibration
from ur_emulator.program_files.script_writer import ScriptWriter
from ur_emulator.program_files.urp_nodes import Node

ROBOTIQ = "Robotiq_Grippers"  # name of the software that the nodes are of
# Number of a gripper in programs <- its number on the serial line, and the number itself.
_NUMBERS = {"9": 1, "1": 1, "2": 2, "3": 3, "4": 4}


def declare_functions(writer: ScriptWriter) -> None:
    """Put the functions before all nodes, and what the installation gives for them."""
    setup = writer.installation.grippers
    rows = [setup.calibrations.get(n, GripperCalibration()) for n in range(1, 5)]
    writer.declare(
        ROBOTIQ,
        f"rq_current_limit_enabled = {setup.is_current_limited}",
        *(
            f"gripper_{name} = {[getattr(row, name) for row in rows]}"
            for name in GripperCalibration.__slots__
        ),
        resources.files(__package__).joinpath("robotiq.script").read_text("utf-8"),
        "rq_init()",
    )


def write_gripper_node(writer: ScriptWriter, node: Node) -> None:
    """Write a node by its type."""
    declare_functions(writer)
    match node.get("strategyProgramNodeType"):
        case "Gripper":
            _write_motion(writer, node)
        case "Gripper Activate":
            reset = node.data.get("ResetAndActivateKey") == "true"
            label = f"Gripper {'Reset and ' if reset else ''}Activate"
            writer.put(node, label, "rq_init()", f"rq_activate_all_grippers({reset})")
        case "Grip Check":
            _write_check(writer, node)
        case kind:
            raise node.tree.unknown(f"a node {kind!r} of the URCap {ROBOTIQ!r}")


def _write_motion(writer: ScriptWriter, node: Node) -> None:
    """Write the motion of one or more grippers: each has its target before the first of them moves."""
    grippers = _grippers(node, "slaveIds")
    percents = [_percent(node, f"{key}InDouble", key) for key in ("position", "speed", "force")]
    request = ", ".join(f"{_rounded(percent * 255.0 / 100.0)}" for percent in percents)
    calibration = writer.installation.grippers.calibrations.get(grippers[0])
    if percents[0] in (0.0, 100.0):
        motion = "Close" if percents[0] else "Open"
    elif calibration is None:
        motion = f"Move{_rounded(percents[0])}%"
    else:
        motion = f"Move{_rounded(calibration.width(percents[0]))}mm"
    writer.put(node, f"Gripper {motion} ({', '.join(map(str, grippers))})")
    for n in grippers:
        with writer.block(f"if not(gripper_connected[{n - 1}]):"):
            writer.add(f'popup("Gripper {n} does not answer.", "No connection", False, True, True)')
        with writer.block(f'if not(rq_is_gripper_activated("{n}")):'):
            writer.add(f'popup("Gripper {n} must be activated first.", "Not activated", False, True, True)')
        for function in ("rq_set_pos_spd_for", "rq_wait_pos_spe_for_request"):
            writer.add(f'{function}({request}, "{n}")')
    writer.add(*(f'rq_go_to("{n}")' for n in grippers))
    if node.data.get("blocking", "true") == "true":
        writer.add(*(f'rq_wait("{n}")' for n in grippers))


def _write_check(writer: ScriptWriter, node: Node) -> None:
    data, (n, *others) = node.data, _grippers(node, "GripperIdKey")
    branches = {child.get("strategyProgramNodeType"): child for child in node.children}
    if branches.keys() != {"If", "Else"} or others:
        raise node.tree.undefined("a Grip Check node needs one gripper, an If and an Else")
    detects = data.get("ObjectDetectedKey", "true") == "true"
    label = "If object detected" if detects else "If object not detected"
    condition = f'{"" if detects else "not "}rq_is_object_detected("{n}")'
    if data.get("DimensionValidationKey") == "true":
        keys = ("DimensionKey", "DimensionDimensionPositiveGapKey", "DimensionNegativeGapKey")
        middle, more, less = (_percent(node, key) * 2.55 for key in keys)
        label, position = "If grip validated", f'rq_current_pos("{n}")'
        condition += f" and {position} >= {middle - less:.2f} and {position} <= {middle + more:.2f}"
    writer.put(node, "Grip Check")
    writer.put(branches["If"], label + " " * 10, mark="noBreak")
    with writer.branch(f"if ({condition}):"):
        writer.write_children(branches["If"])
    with writer.block("else:"):
        writer.put(branches["Else"], "Else", mark="noBreak")
        writer.write_children(branches["Else"])


def _grippers(node: Node, key: str) -> list[int]:
    """Return the numbers of the grippers that a node names, in its order; gripper 1 if it names none."""
    names = (node.data.get(key, "").strip("[] ") or "9").split(",")
    numbers = [_NUMBERS.get(name.strip(), 0) for name in names]
    if 0 in numbers or len({*numbers}) < len(numbers):
        raise node.tree.unknown(f"a node of the grippers {','.join(names)[:100]!r}")
    return numbers


def _percent(node: Node, *keys: str) -> float:
    """Return the value under the first of the keys that is there [%]; UndefinedError without one."""
    text = next((node.data[key] for key in keys if key in node.data), None)
    value = node.tree.number(text, f"{keys[-1]} of a {node.get('strategyProgramNodeType')} node")
    if not 0.0 <= value <= 100.0:
        raise node.tree.undefined(f"{keys[-1]} is {value:g} %: use 0 to 100")
    return value


def _rounded(value: float) -> int:
    """Return the nearest whole number; a half is rounded up."""
    return math.floor(value + 0.5)
