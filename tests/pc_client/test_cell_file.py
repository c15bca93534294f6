"""Cell files: what is read is what the file says, and what is wrong is named by file and field in one line."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pc_client.errors import CellError
from pc_client.kinematics.cell import MOST_BODIES, NO_CELL, Solid, Wall, load_cell, parse_cell
from pc_client.movements.movement_file import toml_value

SIZES = {"boxes": 3, "cylinders": 2, "spheres": 1, "capsules": 2}
EXAMPLE = Path(__file__).parents[2] / "examples" / "cell.toml"
HEAD = 'format = 1\nname = "bench"\n'
BOX = '[[boxes]]\nname = "press"\ncentre = [1, 0, 0]\nsize = [0.1, 0.2, 0.3]\n'


def refused(text: str) -> str:
    with pytest.raises(CellError) as caught:
        parse_cell(text, "cell.toml")
    message = str(caught.value)
    assert message.startswith("cell.toml: ")
    assert "\n" not in message
    return message


def test_the_example_is_read_as_it_says():
    cell = load_cell(EXAMPLE)
    assert cell.text == EXAMPLE.read_text()
    assert cell.name == "bench by the window"
    assert cell.walls[0] == Wall("window", (0.0, -1.0, 0.0), -0.6)
    slanted = cell.walls[1]
    assert math.hypot(*slanted.normal) == pytest.approx(1.0)
    assert slanted.normal[1] / slanted.normal[0] == pytest.approx(-0.2)
    assert slanted.offset == pytest.approx(-0.7 / math.hypot(1.0, 0.2))
    assert cell.solids[1] == Solid(
        "camera stand", "boxes", (0.06, 0.06, 0.6), (0.2, -0.42, 0.3), (0.0, 0.0, 0.785)
    )
    assert cell.tool.mass == 0.4
    assert [solid.title for solid in cell.tool.solids] == ["cylinder 'pen holder'", "capsule 'pen'"]
    assert "0.4 kg" in cell.summary
    assert "wall 'window'" in cell.summary


def test_a_file_with_a_name_alone_is_a_bare_arm_on_a_plane():
    cell = parse_cell(HEAD, "cell.toml")
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
    (wall,) = parse_cell(f'{HEAD}[[walls]]\nname = "w"\n{side}\n', "cell.toml").walls
    assert wall == Wall("w", normal, offset)


@pytest.mark.parametrize(
    ("text", "field", "says"),
    [
        ("format = 2\nname = 'x'", "format", "2; give 1"),
        ("name = 'x'", "format", "missing"),
        ("format = 1", "name", "missing"),
        ("format = 1\nname = ''", "name", "give a text"),
        ('format = 1\nname = "a\\nb"', "name", "one line"),
        (HEAD + "q = 1", "q", "no such key; known are boxes, cylinders, spheres"),
        (HEAD + "[floor]\nz = nan", "floor.z", "give a number"),
        (HEAD + "[floor]\nz = 150", "floor.z", "give a number from -100 to 100 m"),
        (HEAD + "[floor]\ny = 1", "floor.z", "missing"),
        (HEAD + f"[floor]\nz = {'9' * 400}", "floor.z", "give a number"),
        (HEAD + BOX.replace("0.2", "0"), "boxes[0].size[1]", "give a number from 1e-06 to 100 m"),
        (HEAD + BOX.replace("0.2", "-1"), "boxes[0].size[1]", "give a number from 1e-06 to 100 m"),
        (HEAD + BOX.replace("0.2", "inf"), "boxes[0].size[1]", "inf; give a number"),
        (HEAD + BOX.replace("0.2, ", ""), "boxes[0].size[2]", "missing; give a number"),
        (
            HEAD + BOX.replace("[1, 0, 0]", "[350, 0, 0]"),
            "boxes[0].centre[0]",
            "give a number from -100 to 100 m",
        ),
        (HEAD + BOX + "rpy = [0, 0, 45]", "boxes[0].rpy[2]", "rad"),
        (HEAD + BOX + "colour = 'red'", "boxes[0].colour", "no such key"),
        (HEAD + BOX.replace("size", "radius"), "boxes[0].size", "missing"),
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
        (HEAD + "[tool]\nweight = 1", "tool.weight", "no such key"),
        (HEAD + "tool = 3", "tool", "3; give a table"),
        (HEAD + f"boxes = 0x{'f' * 4000}", "boxes", "a number of thousands of digits; give a list"),
        (HEAD + "boxes = 3", "boxes", "3; give a list"),
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
        load_cell(tmp_path / "cell.toml")
    (tmp_path / "cell.toml").write_bytes(b"name = '\xff'")
    with pytest.raises(CellError, match="not UTF-8"):
        load_cell(tmp_path / "cell.toml")


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
        parse_cell(text, "cell.toml")
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
        cell = parse_cell("\n".join([HEAD, f"[[{where}{kind}]]", *lines]), "cell.toml")
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
