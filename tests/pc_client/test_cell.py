"""What stands around the arm and what it carries: its file, and that it counts in plans and approaches."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_form_ik import dh_pose
from hypothesis import given, settings
from hypothesis import strategies as st
from planning_paths import INSIDE_THE_BOX, StraightStrokes, prepare_experiment

from pc_client.errors import CellError, PlanningError
from pc_client.files import FILE_KINDS
from pc_client.kinematics.clearance import clearance_model
from pc_client.kinematics.model import robot_model
from pc_client.movements.movement import load_movement
from pc_client.movements.movement_file import toml_value
from pc_client.planning.approach import approach_text, plan_approach, plan_text
from pc_client.planning.plan import plan_movement
from ur_hil.cell import MOST_BODIES, NO_CELL, Cell, Solid, Tool, Wall, load_cell, parse_cell

SIZES = {"boxes": 3, "cylinders": 2, "spheres": 1, "capsules": 2}
EXAMPLE = Path(__file__).parents[2] / "examples" / "cell.toml"
HEAD = 'format = 1\nname = "bench"\n'
BOX = '[[boxes]]\nname = "press"\ncentre = [1, 0, 0]\nsize = [0.1, 0.2, 0.3]\n'


def refused(text: str) -> str:
    with pytest.raises(CellError) as caught:
        parse_cell(text, "cell.toml", FILE_KINDS["cell"])
    message = str(caught.value)
    assert message.startswith("cell.toml: ")
    assert "\n" not in message
    return message


def test_the_example_is_read_as_it_says():
    cell = load_cell(EXAMPLE, FILE_KINDS["cell"])
    assert cell.text == EXAMPLE.read_text()
    assert cell.name == "bench by the window"
    assert cell.walls[0] == Wall("window", (0.0, -1.0, 0.0), -0.6)
    slanted = cell.walls[1]
    assert math.hypot(*slanted.normal) == pytest.approx(1.0)
    assert slanted.normal[1] / slanted.normal[0] == pytest.approx(-0.2)
    assert slanted.offset == pytest.approx(-0.7 / math.hypot(1.0, 0.2))
    assert cell.solids[1] == Solid(
        "camera stand", "box", (0.06, 0.06, 0.6), (0.2, -0.42, 0.3), (0.0, 0.0, 0.785)
    )
    assert cell.tool.mass == 0.4
    assert [solid.title for solid in cell.tool.solids] == ["cylinder 'pen holder'", "capsule 'pen'"]
    assert "0.4 kg" in cell.summary
    assert "wall 'window'" in cell.summary


def test_a_file_with_a_name_alone_is_a_bare_arm_on_a_plane():
    cell = parse_cell(HEAD, "cell.toml", FILE_KINDS["cell"])
    assert (cell.floor_z, cell.walls, cell.solids, cell.tool) == (0.0, (), (), NO_CELL.tool)
    assert NO_CELL.summary == "no cell file: bare arm on a plane z = 0"


@pytest.mark.parametrize(
    ("side", "normal", "offset"),
    [
        ("x_min = -0.4", (1, 0, 0), -0.4),
        ("x_max = 0.4", (-1, 0, 0), -0.4),
        ("y_min = -0.3", (0, 1, 0), -0.3),
        ("z_max = 1.5", (0, 0, -1), -1.5),
    ],
)
def test_a_side_says_where_the_arm_stays(side, normal, offset):
    (wall,) = parse_cell(f'{HEAD}[[walls]]\nname = "w"\n{side}\n', "cell.toml", FILE_KINDS["cell"]).walls
    assert wall == Wall("w", normal, offset)


@pytest.mark.parametrize(
    ("text", "field", "says"),
    [
        ("format = 2\nname = 'x'", "format", "2; give 1"),
        ("name = 'x'", "format", "missing"),
        (HEAD + "q = 1", "q", "no such key; known are boxes, cylinders, spheres"),
        (HEAD + "[floor]\nz = 150", "floor.z", "give a number from -100 to 100 m"),
        (HEAD + BOX.replace("0.2", "0"), "boxes[0].size[1]", "give a number from 1e-06 to 100 m"),
        (
            HEAD + BOX.replace("[1, 0, 0]", "[350, 0, 0]"),
            "boxes[0].centre[0]",
            "give a number from -100 to 100 m",
        ),
        (HEAD + BOX + "rpy = [0, 0, 45]", "boxes[0].rpy[2]", "rad"),
        (HEAD + "[[walls]]\nname = 'w'", "walls[0].point", "give one of x_min"),
        (HEAD + "[[walls]]\nname = 'w'\nx_min = -1\ny_min = -1", "walls[0].point", "give one of x_min"),
        (HEAD + "[[walls]]\nname = 'w'\nx_min = 0.1", "walls[0].x_min", "stands behind this wall"),
        (HEAD + "[[walls]]\nname = 'w'\npoint = [1, 0, 0]", "walls[0].point", "and a normal"),
        (
            HEAD + "[[walls]]\nname = 'w'\npoint = [1, 0, 0]\nnormal = [0, 0, 0]",
            "walls[0].normal",
            "give a direction",
        ),
        (
            HEAD + "[[walls]]\nname = 'w'\npoint = [1, 0, 0]\nnormal = [1, 0, 0]",
            "walls[0].normal",
            "from the wall to the robot",
        ),
        (HEAD + "[tool]\nmass = -0.1", "tool.mass", "-0.1; give a number from 0 to 100 kg"),
    ],
)
def test_what_is_wrong_is_named(text, field, says):
    message = refused(text)
    assert f"cell.toml: {field}: " in message
    assert says in message


def test_two_bodies_of_one_name_are_refused():
    assert "two bodies are called 'press'" in refused(HEAD + BOX + BOX)


def test_too_many_bodies_are_refused():
    text = HEAD + "".join(BOX.replace("press", f"press {k}") for k in range(MOST_BODIES + 1))
    assert f"{MOST_BODIES} or fewer" in refused(text)


def test_a_file_that_is_not_there_or_no_text_is_named(tmp_path):
    with pytest.raises(CellError, match=r"cell.toml: cannot be read"):
        load_cell(tmp_path / "cell.toml", FILE_KINDS["cell"])
    (tmp_path / "cell.toml").write_bytes(b"name = '\xff'")
    with pytest.raises(CellError, match="not UTF-8"):
        load_cell(tmp_path / "cell.toml", FILE_KINDS["cell"])


_VALUES = st.one_of(
    st.none(),
    st.floats(),
    st.integers(),
    st.booleans(),
    st.text(max_size=5),
    st.lists(st.floats(), max_size=4),
)


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused_in_one_line(text):
    try:
        parse_cell(text, "cell.toml", FILE_KINDS["cell"])
    except CellError as error:
        assert "\n" not in str(error)  # noqa: PT017 - one of two allowed outcomes


@given(
    st.sampled_from(sorted(SIZES)),
    st.dictionaries(st.sampled_from(["name", "centre", "size", "radius", "length", "rpy", "x"]), _VALUES),
    st.sampled_from(["", "tool."]),
)
def test_any_solid_is_read_or_refused_in_one_line(kind, fields, where):
    lines = [f"{key} = {_toml(value)}" for key, value in fields.items() if value is not None]
    try:
        cell = parse_cell("\n".join([HEAD, f"[[{where}{kind}]]", *lines]), "cell.toml", FILE_KINDS["cell"])
    except CellError as error:
        assert str(error).startswith("cell.toml: ")  # noqa: PT017 - one of two allowed outcomes
        return
    (solid,) = cell.tool.solids if where else cell.solids
    assert len(solid.sizes) == SIZES[kind]
    assert min(solid.sizes) > 0.0
    assert all(map(math.isfinite, (*solid.centre, *solid.rpy)))


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return toml_value(value)


STROKES = StraightStrokes(INSIDE_THE_BOX, 1.5)
PLAN = plan_movement(STROKES, model=robot_model("ur3"))
START = PLAN.start_q
# The tool points forward and 45 deg down, the flange stands at about (.35, 0, .25) m.
POSTURE = np.radians((22.6, -101.1, -120.3, -5.9, 74.2, 106.4))
BALL = Tool((Solid("ball", "sphere", (0.03,), (0.0, 0.0, 0.2)),))


def measure(cell, q=POSTURE):
    return clearance_model(robot_model("ur3", cell)).along(q)


def ball_centre(q):
    """Centre of BALL in the base frame, by the DH table alone."""
    return (dh_pose(q) @ (0.0, 0.0, 0.2, 1.0))[:3]


@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_a_ball_at_the_flange_has_the_distance_that_the_dh_table_says(seed):
    # Solids around nothing but the ball: the arm's own links are far from a wall on the ball's side.
    rng = np.random.default_rng(seed)
    q = POSTURE + rng.uniform(-0.3, 0.3, 6)
    centre = ball_centre(q)
    flange = dh_pose(q)[:3, 3]
    out = (centre - flange) / np.linalg.norm(centre - flange)
    # A wall across the tool's axis, 100 mm before the ball's surface.
    point = centre + 0.13 * out
    wall = Wall("across", tuple(-out), float(-out @ point))
    distances = measure(Cell("c", walls=(wall,), tool=BALL), q).cell
    assert distances.least[0] == pytest.approx(0.1, abs=1e-6)
    assert distances.nearest[0] == ("tool sphere 'ball'", "wall 'across'", 5)


@settings(max_examples=40)
@given(
    st.sampled_from(["box", "sphere", "cylinder", "capsule"]),
    st.floats(-3.0, 3.0),
    st.floats(-1.5, 1.5),
)
def test_a_solid_of_any_shape_and_turn_has_the_distance_worked_out_by_hand(kind, yaw, pitch):
    # Far before the ball on the axis of the tool; the solid's z axis is turned by rpy = (0, pitch, yaw).
    centre = ball_centre(POSTURE)
    axis = dh_pose(POSTURE)[:3, 2]
    place = centre + 0.4 * axis
    sizes = {"box": (0.1, 0.06, 0.2), "sphere": (0.05,), "cylinder": (0.04, 0.2), "capsule": (0.04, 0.2)}
    solid = Solid("thing", kind, sizes[kind], tuple(place), (0.0, pitch, yaw))
    found = measure(Cell("c", solids=(solid,), tool=BALL)).cell
    assert found.nearest[0].first == "tool sphere 'ball'"
    # The ball's centre in the solid's own frame, and its distance from the solid by elementary geometry.
    cp, sp, cy, sy = np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    R = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    x, y, z = R.T @ (centre - place)
    beside, above = np.hypot(x, y), max(abs(z) - 0.1, 0.0)
    expected = {
        "box": np.linalg.norm(np.maximum(np.abs((x, y, z)) - (0.05, 0.03, 0.1), 0.0)),
        "sphere": 0.4 - 0.05,
        "cylinder": np.hypot(max(beside - 0.04, 0.0), above),
        "capsule": np.hypot(beside, above) - 0.04,
    }
    assert found.least[0] == pytest.approx(expected[kind] - 0.03, abs=1e-5)


def test_a_tool_counts_above_the_floor():
    centre = ball_centre(POSTURE)
    for z in (0.0, -0.2, 0.05):
        floor = measure(Cell("c", floor_z=z, tool=BALL)).floor
        assert floor.least[0] == pytest.approx(centre[2] - 0.03 - z, abs=1e-6)
        assert floor.nearest[0] == ("tool sphere 'ball'", f"the floor at z = {z:g} m", 5)


def test_a_tool_that_reaches_back_meets_the_forearm():
    back = Tool((Solid("bracket", "box", (0.02, 0.02, 0.5), (0.06, 0.0, -0.2)),))
    with_tool = measure(Cell("c", tool=back), np.radians((0, -90, 90, -90, 0, 0)))
    assert with_tool.own.nearest[0].first == "tool box 'bracket'"
    assert with_tool.own.least[0] < measure(NO_CELL, np.radians((0, -90, 90, -90, 0, 0))).own.least[0]


def test_a_tool_on_the_flange_does_not_count_against_the_link_that_carries_it():
    plate = Tool((Solid("plate", "cylinder", (0.03, 0.02), (0.0, 0.0, 0.01)),))
    bare, plated = measure(NO_CELL).own, measure(Cell("c", tool=plate)).own
    assert plated.least[0] == pytest.approx(bare.least[0])


@pytest.mark.parametrize("name", ["ur3", "ur5", "ur10"])
def test_a_table_as_a_box_under_the_base_keeps_nobody_from_moving(name):
    table = Cell("c", solids=(Solid("table", "box", (2.0, 2.0, 0.1), (0.0, 0.0, -0.05)),))
    model = robot_model(name, table)
    q = np.tile(model.description.q_branch, (20, 1))
    q[:, 0] = np.linspace(-3, 3, 20)
    assert clearance_model(model).along(q).cell.least.min() > 0.02


def test_without_a_cell_nothing_is_near():
    cell = measure(NO_CELL).cell
    assert cell.least[0] == np.inf
    assert cell.nearest == ()


def plan_refused(cell):
    with pytest.raises(PlanningError) as caught:
        plan_movement(STROKES, model=robot_model("ur3", cell))
    assert "\n" not in str(caught.value)
    return caught.value


def middle_of_the_path():
    return tuple(STROKES.sample(np.array([0.75]))[0][0])


def test_a_box_in_the_way_refuses_the_plan_and_is_named():
    error = plan_refused(Cell("c", solids=(Solid("press", "box", (0.02, 0.02, 0.02), middle_of_the_path()),)))
    assert " comes within " in str(error)
    assert "of box 'press', at least 20 mm is asked" in str(error)
    assert error.joint is not None
    # The sample that is named is the one that comes nearest.
    assert np.linalg.norm(PLAN.p[error.sample] - middle_of_the_path()) < 0.06


def test_a_wall_beside_the_path_refuses_the_plan():
    top = max(PLAN.p[:, 2])
    assert "wall 'ceiling'" in str(plan_refused(Cell("c", walls=(Wall("ceiling", (0, 0, -1), -top),))))


def test_a_raised_floor_refuses_the_plan():
    assert "the floor at z = 0.15 m, at least 30 mm is asked" in str(plan_refused(Cell("c", floor_z=0.15)))


def test_a_tool_that_reaches_the_floor_refuses_the_plan_of_a_bare_arm():
    long = Tool((Solid("rod", "capsule", (0.005, 0.4), (0.0, 0.0, 0.2)),))
    error = plan_refused(Cell("c", tool=long))
    assert "tool capsule 'rod' comes within" in str(error)
    assert error.joint == 5


def test_a_box_that_is_far_enough_is_reported_in_the_plan():
    far = Solid("press", "box", (0.1, 0.1, 0.1), (0.8, 0.0, 0.25))
    cell = Cell("bench", floor_z=-0.3, solids=(far,), tool=BALL)
    plan = plan_movement(STROKES, model=robot_model("ur3", cell))
    text = plan_text(plan)
    assert "'bench': floor at z = -0.3 m, box 'press'; tool of 0 kg, sphere 'ball'" in text
    least = plan.report.clearance.cell
    assert f"{least.extreme.value * 1e3:.0f} mm, tool sphere 'ball' from box 'press'" in text
    by_hand = 0.75 - max(ball_centre(q)[0] for q in plan.q) - 0.03
    assert least.extreme.value >= by_hand - 1e-6
    assert "no cell file: bare arm on a plane z = 0" in plan_text(PLAN)


def test_a_larger_margin_is_kept_when_asked():
    far = Cell("c", solids=(Solid("press", "box", (0.1, 0.1, 0.1), (0.8, 0.0, 0.25)),))
    limits = PLAN.report.limits
    limits = replace(limits, clearance_min=limits.clearance_min._replace(cell=1.0))
    with pytest.raises(PlanningError, match="at least 1000 mm is asked"):
        plan_movement(STROKES, model=robot_model("ur3", far), limits=limits)


def test_the_approach_goes_around_obstacles():
    # A post that the arm sweeps over on the direct line from its side, and clears with the arm straight up.
    q_now = START + np.array((2.8, 0, 0, 0, 0, 0))
    direct = plan_approach(PLAN, q_now, model=robot_model("ur3"))
    assert len(direct.waypoints) == 1
    half_way = 0.5 * (q_now + START)
    post = Solid("post", "cylinder", (0.02, 0.3), (*dh_pose(half_way)[:2, 3], 0.15))
    model = robot_model("ur3", Cell("c", solids=(post,)))
    plan = plan_movement(STROKES, model=model)
    path = plan_approach(plan, q_now, model=model)
    assert len(path.waypoints) > 1
    assert path.clearance.cell >= plan.report.limits.clearance_min.cell
    assert "of walls and solids of the cell" in approach_text(path)


def test_an_approach_without_a_free_route_is_refused_with_both_bodies():
    q_now = START + np.array((2.8, 0, 0, 0, 0, 0))
    half_way = 0.5 * (q_now + START)
    post = Solid("post", "cylinder", (0.02, 0.6), (*dh_pose(half_way)[:2, 3], 0.3))
    ceiling = Wall("ceiling", (0, 0, -1), -0.6)
    model = robot_model("ur3", Cell("c", walls=(ceiling,), solids=(post,)))
    plan = plan_movement(STROKES, model=model)
    with pytest.raises(PlanningError, match=r"the approach to the start, \d+ % along is not clear.*'post'"):
        plan_approach(plan, q_now, model=model)


def test_an_experiment_is_planned_in_its_cell(tmp_path):
    press = Cell("c", solids=(Solid("press", "sphere", (0.1,), (0.35, 0.0, 0.25)),), text="the file")
    movements = [load_movement("lognorm_4_1")]
    with pytest.raises(PlanningError, match="sphere 'press'"):
        prepare_experiment(movements, repeat=1, out=tmp_path, cell=press)
    far = replace(press, solids=(replace(press.solids[0], centre=(2.0, 0.0, 0.0)),))
    experiment = prepare_experiment(movements, repeat=1, out=tmp_path, cell=far)
    assert experiment.model.cell.text == "the file"
    assert experiment.planned[0].joints.report.cell is far
