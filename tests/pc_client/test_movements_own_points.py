"""Movements through one's own points: in Python, from a file, by `ur-client movements new`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client import Movement, cli
from pc_client.errors import MovementError
from pc_client.movements.durations import TOP_SPEED, default_durations
from pc_client.movements.movement import Style, load_movement, load_targets

POINTS = [[0.3, -0.1, 0.2], [0.35, 0.0, 0.25], [0.3, 0.1, 0.2]]


@pytest.mark.parametrize(("style", "kind"), [("human", "lognormal"), ("robot", "uniform")])
def test_goes_through_the_points_in_the_time_given(style: str, kind: str) -> None:
    movement = Movement.through(POINTS, style, [2.0, 1.5], name="mine")
    assert (movement.name, movement.kind, movement.duration) == ("mine", kind, 3.5)
    np.testing.assert_array_equal(movement.stroke_durations, [2.0, 1.5])
    np.testing.assert_allclose(movement.sample([0.0, 2.0, 3.5]).p, POINTS, atol=1e-5)
    assert movement.speed([0.0, 2.0, 3.5]).max() < 1e-4


def test_both_styles_have_the_same_strokes_by_default() -> None:
    human, robot = Movement.through(POINTS), Movement.through(POINTS, "robot")
    np.testing.assert_array_equal(human.stroke_durations, robot.stroke_durations)
    np.testing.assert_array_equal(human.stroke_durations, default_durations(POINTS))


@settings(max_examples=40)
@given(st.lists(st.tuples(*(st.floats(-0.5, 0.5),) * 3), min_size=2, max_size=6))
def test_default_durations_keep_the_top_speed_and_are_never_short(
    points: list[tuple[float, float, float]],
) -> None:
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if legs.min() < 1e-3:
        return
    movement = Movement.through(points)
    assert movement.stroke_durations.min() >= 1.0
    top = movement.speed(np.linspace(0.0, movement.duration, 8001)).max()
    assert top <= TOP_SPEED * (1.0 + 1e-3)
    if movement.stroke_durations.min() > 1.0:
        assert top >= TOP_SPEED * 0.99
        np.testing.assert_allclose(
            np.diff(np.log(movement.stroke_durations)), 0.3 * np.diff(np.log(legs)), atol=2e-3
        )


def test_corners_of_a_robot_are_blended_when_asked() -> None:
    blended = Movement.through(POINTS, "robot", corners="blend", setback=0.02)
    assert blended.speed(blended.stroke_durations[0]).min() > 0.03
    assert 1e-3 < np.linalg.norm(blended.sample(blended.stroke_durations[0]).p[0] - POINTS[1]) < 0.02


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (([],), "points of shape (0,): give a list of [x, y, z]"),
        (("abc",), "points that are not a table of numbers"),
        (([[0, 0, 0], [0, 1]],), "points that are not a table of numbers"),
        (([[0, 0, 0]],), "1 target points: a movement needs at least 2"),
        (([[0, 0, 0], [0, 0, np.nan]],), "points with nan: give finite numbers"),
        (([[0, 0, 0], [0, 0, 0]],), "target point 2 is the same as target point 1"),
        (
            ([[0, 0, 0], [0, 0, 200]],),
            "target point 2 is [0.0, 0.0, 200.0] m: that is beyond any arm; give metres",
        ),
        ((POINTS, "wild"), 'style "wild": give "human" or "robot"'),
        ((POINTS, "human", [1.0]), "1 stroke durations for 3 target points: give 2"),
        ((POINTS, "robot", [1.0]), "1 stroke durations for 3 target points: give 2"),
        ((POINTS, "human", [1.0, -1.0]), "give times above 0, at most 600 s"),
        ((POINTS, "human", [1.0, 1e9]), "give times above 0, at most 600 s"),
        ((POINTS, "human", 3.0), "durations of shape (): give a list of times"),
        ((POINTS, "human", "fast"), "durations that are not a table of numbers"),
        ((POINTS, "robot", [0.1, 1.0]), "every stroke must last longer than all ramps together"),
    ],
)
def test_nonsense_is_refused_in_one_line(arguments: tuple[object, ...], complaint: str) -> None:
    with pytest.raises(MovementError) as caught:
        Movement.through(*arguments)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_blends_are_for_robots() -> None:
    with pytest.raises(MovementError, match='corners go with style "robot"'):
        Movement.through(POINTS, corners="blend")


@pytest.mark.parametrize(
    "text",
    [
        ".3,-.1,.2\n.35,0,.25\n.3,.1,.2\n",
        "# mine\nx; y; z\n.3; -.1; .2\n\n.35; 0; .25\n.3; .1; .2\n",
        "\ufeffz\ty\tx\n.2\t-.1\t.3\n.25\t0\t.35\n.2\t.1\t.3",
        ".3 -.1 .2 1\n.35 0 .25 3\n.3 .1 .2 4.5\n",
        "t,x,y,z\n1,.3,-.1,.2\n3,.35,0,.25\n4.5,.3,.1,.2\n",
    ],
)
def test_every_form_of_a_table_of_points_is_read(text: str, tmp_path: Path) -> None:
    (tmp_path / "targets.csv").write_text(text, encoding="utf-8")
    points, durations = load_targets(tmp_path / "targets.csv")
    np.testing.assert_array_equal(points, POINTS)
    if durations is not None:
        np.testing.assert_array_equal(durations, [2.0, 1.5])
    assert (durations is None) == ("4.5" not in text)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "targets.csv: 0 target points; a movement needs at least 2"),
        ("x,y,z\n.3,0,.2\n", "targets.csv: 1 target points"),
        ("x,y\n1,2\n", "targets.csv, line 1: 2 columns; give x, y, z in m, and optionally t in s"),
        (".3,0,.2\n.3,0\n", "targets.csv, line 2: 2 columns"),
        (".3,0,.2\n\n.3,0,far\n", 'targets.csv, line 3: z is "far"; give a finite number'),
        (".3,0,.2\n.3,inf,.2\n", 'targets.csv, line 2: y is "inf"'),
        ("# here\n.3,0,.2\n.3,0,.2\n", "targets.csv, line 3: target point 2 is the same as target point 1"),
        ("300,0,200\n300,100,200\n", "targets.csv, line 1: target point 1 is [300.0, 0.0, 200.0] m"),
        (
            ".3,0,.2,1\n.3,.1,.2,1\n",
            "targets.csv, line 2: t = 1 s after t = 1 s in line 1; times must increase",
        ),
    ],
)
def test_what_is_wrong_with_a_table_is_named_by_file_and_line(
    text: str,
    complaint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("targets.csv").write_text(text)
    assert cli.run(["movements", "new", "--targets", "targets.csv", "--out", "mine.toml"]) == 1
    err = capsys.readouterr().err
    assert complaint in err
    assert err.count("\n") == 1
    assert not Path("mine.toml").exists()


@pytest.mark.parametrize("times", [None, (0.0, 2.0, 3.5)])
@pytest.mark.parametrize("style", [None, "human", "robot"])
def test_a_table_that_the_command_takes_is_a_movement_in_python(
    style: Style | None, times: tuple[float, ...] | None, tmp_path: Path
) -> None:
    table, out = tmp_path / "mine.csv", tmp_path / "mine.toml"
    rows = [[*point, *([] if times is None else [times[i]])] for i, point in enumerate(POINTS)]
    table.write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    command = ["movements", "new", "--targets", str(table), "--out", str(out), "--style", style or "human"]
    assert cli.run(command) == 0
    if style is None and times is not None:  # samples over time
        with pytest.raises(MovementError, match=r"3 samples; a movement needs at least 4 .* with a style"):
            Movement.from_csv(table)
        return
    made, wanted = Movement.from_csv(table, style), load_movement(out)
    assert (made.name, made.kind) == (wanted.name, wanted.kind)
    t = np.linspace(0.0, wanted.duration, 51)
    np.testing.assert_array_equal(made.motion(t).p, wanted.motion(t).p)


def test_durations_of_a_table_are_given_once(tmp_path: Path) -> None:
    table = tmp_path / "targets.csv"
    table.write_text(".3 -.1 .2\n.3 0 .2\n")
    assert Movement.from_csv(table, durations=[2.0]).duration == 2.0
    table.write_text(".3 -.1 .2 0\n.3 0 .2 2\n")
    with pytest.raises(MovementError, match="has a column t: give only one of them"):
        Movement.from_csv(table, durations=[2.0])


@pytest.mark.parametrize(
    ("options", "style", "durations", "corners"),
    [
        ([], "human", None, "stop"),
        (["--style", "robot"], "robot", None, "stop"),
        (["--style", "robot", "--durations", "2,1.5", "--corners", "blend"], "robot", [2.0, 1.5], "blend"),
    ],
)
def test_the_command_does_what_the_call_does_and_checks_it_on_the_arm(
    options: list[str],
    style: str,
    durations: list[float] | None,
    corners: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    table, out = tmp_path / "targets.csv", tmp_path / "mine.toml"
    table.write_text("".join(f"{x},{y},{z}\n" for x, y, z in POINTS))
    assert cli.run(["movements", "new", "--targets", str(table), "--out", str(out), *options]) == 0
    assert "top joint speed" in capsys.readouterr().out
    made, wanted = (
        load_movement(out),
        Movement.through(POINTS, style, durations, name="mine", corners=corners),
    )
    assert (made.name, made.kind) == ("mine", wanted.kind)
    t = np.linspace(0.0, wanted.duration, 201)
    for got, expected in zip(made.motion(t), wanted.motion(t), strict=True):
        np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize(
    ("table", "options", "complaint", "code"),
    [
        (".3 -.1 .2\n.3 0 .2\n", ["--durations", "two"], "--durations two: give times in s", 2),
        (".3 -.1 .2\n.3 0 .2\n", ["--durations", "1,2"], "2 stroke durations for 2 target points", 1),
        (".3 -.1 .2\n.3 0 .2\n", ["--durations", "0.1"], "the TCP speed is", 1),
        (".3 -.1 .2\n.3 0 .2\n", ["--style", "cat"], "'cat' is not one of 'human', 'robot'", 2),
        (".3 -.1 .2\n.3 0 .2\n", ["--corners", "cut"], "'cut' is not one of 'stop', 'blend'", 2),
        (".3 -.1 .2\n.3 0 .2\n", ["--corners", "blend"], 'corners go with style "robot"', 1),
        (".3 -.1 .2 0\n.3 0 .2 2\n", ["--durations", "1"], "has a column t: give only one of them", 2),
        (".3 -.1 .2\n.9 0 .2\n", [], "the elbow is stretched", 1),
        (".3 -.1 .2\n.3 0 .2\n", ["--targets", "gone.csv"], "gone.csv: cannot be read", 1),
    ],
)
def test_what_the_command_cannot_do_is_one_line_and_saves_nothing(
    table: str,
    options: list[str],
    complaint: str,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("targets.csv").write_text(table)
    assert cli.run(["movements", "new", "--targets", "targets.csv", "--out", "mine.toml", *options]) == code
    err = capsys.readouterr().err
    assert complaint in err
    assert err.count("\n") == 1
    assert not Path("mine.toml").exists()
