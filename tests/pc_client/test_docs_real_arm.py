"""docs/real-arm.md says what the code says: messages, port, margins, and the plan that it shows."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from planning_paths import prepare_experiment

from pc_client.control.controller import APPROACH, CONTROLLERS
from pc_client.driver.receiver import MISSED_ALLOWED, REVERSE_PORT
from pc_client.driver.watchdog import (
    control,
    program_state,
    robot_mode,
    safety_mode,
    software,
    speed_scaling,
    speed_slider,
)
from pc_client.errors import CellError
from pc_client.experiment.experiment import experiment_text
from pc_client.experiment.preflight import operational_mode, payload, tcp_offset
from pc_client.files import FILE_KINDS
from pc_client.kinematics.model import robot_model
from pc_client.kinematics.tool import surroundings
from pc_client.movements.movement import load_motion
from pc_client.planning.approach import approach_text, plan_approach
from pc_client.planning.limits import limits_of
from protocol.primary.layout import RobotModeData
from protocol.ur_types import ProgramState, RobotMode, SafetyMode, SoftwareVersion
from ur_hil.cell import load_cell, parse_cell

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "real-arm.md").read_text(encoding="utf-8")
START = (ROOT / "docs" / "start" / "real-ur3.md").read_text(encoding="utf-8")
CELL = load_cell(ROOT / "examples" / "cell.toml", FILE_KINDS["cell"])
MESSAGES = [
    message
    for row in PAGE.partition("## What can go wrong")[2].partition("## When the client dies")[0].splitlines()
    if row.startswith("| ")
    for message in re.findall(r"`([^`]+)`", row.split(" | ")[1])
]


def templates():
    """All texts of the client: its literals, with … for values."""
    for path in (ROOT / "pc_client").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.value
            elif isinstance(node, ast.JoinedStr):
                yield "".join(
                    str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values
                )


@cache
def patterns():
    return [
        re.compile(".+".join(map(re.escape, text.split("…"))))
        for text in templates()
        if len(text.replace("…", "")) >= 25 and "\n" not in text
    ]


def conditions():
    """The page's refusals of a robot that is not as it must be."""
    frame = SimpleNamespace(
        safety_mode=float(SafetyMode.ROBOT_EMERGENCY_STOP),
        robot_mode=float(RobotMode.IDLE),
        runtime_state=float(ProgramState.PLAYING),
        speed_scaling=0.6,
    )
    protective = SimpleNamespace(safety_mode=float(SafetyMode.PROTECTIVE_STOP))
    report = SimpleNamespace(
        tcp_offset=(0.0, 0.0, 0.15, 0.0, 0.0, 0.0), payload=0.0, payload_cog=None, operational_mode="MANUAL"
    )
    model, gripper = robot_model("ur3", CELL), robot_model("ur3", surroundings(None, "robotiq-2f85"))
    flange = SimpleNamespace(tcp_offset=(0.0,) * 6, payload=0.0, payload_cog=None)
    return [
        software(SoftwareVersion(10, 11, 0)),
        safety_mode(frame),
        safety_mode(protective),
        control(remote=False),
        operational_mode(report, model),
        robot_mode(frame),
        program_state(frame),
        speed_slider(RobotModeData(target_speed_fraction=0.5)),
        speed_scaling(frame),
        tcp_offset(report, model),
        payload(report, model),
        tcp_offset(flange, gripper),
        payload(flange, gripper),
    ]


def cell_error():
    with pytest.raises(CellError) as caught:
        parse_cell(
            CELL.text.replace("size = [0.2, 0.45, 0.4]", "size = [0.2, 0, 0.4]"),
            "cell.toml",
            FILE_KINDS["cell"],
        )
    return str(caught.value)


COMPLAINTS = [condition.complaint for condition in conditions()] + [cell_error()]


@pytest.mark.parametrize("message", COMPLAINTS)
def test_every_condition_is_on_the_page_in_its_own_words(message):
    assert f"`{message}`" in PAGE


@pytest.mark.parametrize("message", MESSAGES)
def test_every_message_of_the_page_is_one_of_the_client(message):
    if message in COMPLAINTS or message in ("…", "the robot's safety mode is …"):
        return
    assert any(pattern.search(message) for pattern in patterns()), message


def test_the_page_has_the_messages_that_this_test_looks_for():
    assert len(MESSAGES) > 30


def test_port_margins_and_tolerances_are_those_of_the_code():
    limits = limits_of(robot_model("ur3"))
    assert f"TCP **{REVERSE_PORT}**" in PAGE
    assert PAGE.count(str(REVERSE_PORT)) >= 5
    floor, own, around = (round(1e3 * margin) for margin in limits.clearance_min)
    page = " ".join(PAGE.split())
    margins = (
        f"{floor} mm from the floor, {around} mm from walls and solids, and {own} mm between links and tool"
    )
    assert f"at least {margins}" in page
    preview, approach = CONTROLLERS["preview"].path_tolerance, APPROACH.path_tolerance
    assert f"by {1e3 * preview:g} mm before a run ends" in page
    assert f"{1e3 * approach:g} mm in an approach)" in page
    assert f"repeats the last velocity for {1e3 * MISSED_ALLOWED:g} ms, then `stopj`" in PAGE


def test_the_start_page_is_for_the_arms_and_the_software_that_the_client_takes():
    assert f"TCP port {REVERSE_PORT}" in START
    page = " ".join(START.split())
    for said, taken in (
        ("3.2 to 3.15", (3, 2)),
        ("3.2 to 3.15", (3, 15)),
        ("5.0 to 5.25", (5, 0)),
        ("5.0 to 5.25", (5, 25)),
    ):
        assert f"software {said}" in page
        assert software(SoftwareVersion(*taken)).holds
    assert "`ur-client` refuses an arm with PolyScope X" in page
    assert not software(SoftwareVersion(10, 11)).holds
    for condition in (
        control(remote=False),
        operational_mode(SimpleNamespace(operational_mode="MANUAL"), None),
    ):
        assert condition.name in page


def test_the_cell_of_the_page_is_one():
    text = PAGE.partition("```toml\n")[2].partition("```")[0]
    cell = parse_cell(text, "docs/real-arm.md", FILE_KINDS["cell"])
    assert cell.tool.mass == CELL.tool.mass
    assert cell.solids == CELL.solids[:1]


def test_the_plan_of_the_page_is_the_clients(tmp_path):
    experiment = prepare_experiment([load_motion("lognorm_4_1")], repeat=1, out=tmp_path, cell=CELL)
    assert experiment_text(experiment) in PAGE
    q_now = np.radians((22.6, -101.1, -120.3, -5.9, 74.2, 106.4))
    way = plan_approach(experiment.planned[0].joints, q_now, model=experiment.model)
    assert approach_text(way) in PAGE
