"""`ur-client movements`: through own points, by every generator, duplicates, lists; and the same calls in Python."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pc_client import Movement, cli
from pc_client.errors import MovementError
from pc_client.movements.durations import TOP_SPEED, default_durations
from pc_client.movements.generate import GENERATORS
from pc_client.movements.library_sets import library_names
from pc_client.movements.movement import Style, load_movement, load_targets
from pc_client.movements.uniform import Corners

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


def test_durations_of_a_table_are_given_once(tmp_path: Path) -> None:
    table = tmp_path / "targets.csv"
    table.write_text(".3 -.1 .2\n.3 0 .2\n")
    assert Movement.from_csv(table, durations=[2.0]).duration == 2.0
    table.write_text(".3 -.1 .2 0\n.3 0 .2 2\n")
    with pytest.raises(MovementError, match="has a column t: give only one of them"):
        Movement.from_csv(table, durations=[2.0])


@pytest.mark.parametrize("times", [None, (0.0, 2.0, 3.5)])
@pytest.mark.parametrize(("style", "corners"), [("human", "stop"), ("robot", "stop"), ("robot", "blend")])
def test_command_file_and_call_make_one_movement_which_is_checked_on_the_arm(
    style: Style,
    corners: Corners,
    times: tuple[float, ...] | None,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    table, out = tmp_path / "mine.csv", tmp_path / "mine.toml"
    rows = [[*point, *([] if times is None else [times[i]])] for i, point in enumerate(POINTS)]
    table.write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    command = ["movements", "new", "--targets", str(table), "--out", str(out)]
    assert cli.run([*command, "--style", style, "--corners", corners]) == 0
    assert "top joint speed" in capsys.readouterr().out
    durations = None if times is None else np.diff(times)
    wanted = Movement.through(POINTS, style, durations, name="mine", corners=corners)
    t = np.linspace(0.0, wanted.duration, 201)
    for made in (load_movement(out), Movement.from_csv(table, style, corners=corners)):
        assert (made.name, made.kind) == ("mine", wanted.kind)
        for got, expected in zip(made.motion(t), wanted.motion(t), strict=True):
            np.testing.assert_array_equal(got, expected)


def test_options_of_the_command_are_arguments_of_the_call(tmp_path: Path) -> None:
    table, out = tmp_path / "mine.csv", tmp_path / "mine.toml"
    table.write_text("".join(f"{x},{y},{z}\n" for x, y, z in POINTS))
    assert (
        cli.run(["movements", "new", "--targets", str(table), "--out", str(out), "--durations", "2,1.5"]) == 0
    )
    assert (load_movement(out).kind, load_movement(out).duration) == ("lognormal", 3.5)
    assert Movement.from_csv(table).kind == "lognormal"


def test_a_table_with_times_and_without_a_style_is_samples(tmp_path: Path) -> None:
    table = tmp_path / "mine.csv"
    table.write_text(".3 -.1 .2 0\n.3 0 .2 1\n.3 .1 .2 2\n")
    with pytest.raises(MovementError, match=r"3 samples; a movement needs at least 4 .* with a style"):
        Movement.from_csv(table)


TWO = ".3 -.1 .2\n.3 0 .2\n"


@pytest.mark.parametrize(
    ("table", "options", "complaint", "code"),
    [
        ("", [], "targets.csv: 0 target points; a movement needs at least 2", 1),
        ("x,y,z\n.3,0,.2\n", [], "targets.csv: 1 target points", 1),
        ("x,y\n1,2\n", [], "targets.csv, line 1: 2 columns; give x, y, z in m, and optionally t in s", 1),
        (".3,0,.2\n.3,0\n", [], "targets.csv, line 2: 2 columns", 1),
        (".3,0,.2\n\n.3,0,far\n", [], 'targets.csv, line 3: z is "far"; give a finite number', 1),
        (".3,0,.2\n.3,inf,.2\n", [], 'targets.csv, line 2: y is "inf"', 1),
        (
            "# here\n.3,0,.2\n.3,0,.2\n",
            [],
            "targets.csv, line 3: target point 2 is the same as target point 1",
            1,
        ),
        ("300,0,200\n300,100,200\n", [], "targets.csv, line 1: target point 1 is [300.0, 0.0, 200.0] m", 1),
        (
            ".3,0,.2,1\n.3,.1,.2,1\n",
            [],
            "targets.csv, line 2: t = 1 s after t = 1 s in line 1; times must increase",
            1,
        ),
        (TWO, ["--durations", "two"], "--durations two: give times in s", 2),
        (TWO, ["--durations", "1,2"], "2 stroke durations for 2 target points", 1),
        (TWO, ["--durations", "0.1"], "the TCP speed is", 1),
        (TWO, ["--style", "cat"], "'cat' is not one of 'human', 'robot'", 2),
        (TWO, ["--corners", "cut"], "'cut' is not one of 'stop', 'blend'", 2),
        (TWO, ["--corners", "blend"], 'corners go with style "robot"', 1),
        (".3 -.1 .2 0\n.3 0 .2 2\n", ["--durations", "1"], "has a column t: give only one of them", 2),
        (".3 -.1 .2\n.9 0 .2\n", [], "the elbow is stretched", 1),
        (TWO, ["--targets", "gone.csv"], "gone.csv: cannot be read", 1),
    ],
)
def test_what_cannot_be_made_of_a_table_is_one_line_with_file_and_line_and_saves_nothing(
    table: str,
    options: list[str],
    complaint: str,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "targets.csv").write_text(table)
    command = ["movements", "new", "--targets", "targets.csv", "--out", "mine.toml", *options]
    assert complaint in complaint_of(command, code, tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize(
    ("arguments", "words", "code"),
    [
        (["movements", "generate", "--kind", "jerk", "--out", "x.toml"], "minimum_jerk_via", 1),
        (
            ["movements", "generate", "--kind", "fitts", "--corners", "blend", "--out", "x.toml"],
            "kind uniform",
            1,
        ),
        (["movements", "list", "--set", "all"], "give one of paper, arcs", 1),
        (["movements", "duplicate", "uniform_4_1", "--out", "x.toml"], "give a lognormal", 1),
        (["movements", "duplicate", "lognorm_4_1", "--out", "x.csv"], "saved as a .toml", 1),
        (["movements", "duplicate", "lognorm_4_1", "--share", "2", "--out", "x.toml"], "share", 2),
        (["compare"], "--out", 2),
        (["compare", "--out", "o", "--sets", "0"], "sets", 2),
        (["compare", "--out", "o", "--robot", "127.0.0.1", "--controller", "pid"], "preview", 1),
    ],
)
def test_what_does_not_work_is_one_line_and_writes_nothing(
    arguments: list[str],
    words: str,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert words in complaint_of(arguments, code, tmp_path, monkeypatch, capsys)


def complaint_of(
    arguments: list[str],
    code: int,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> str:
    """The one line of a command that fails in a folder and leaves it as it was."""
    before = sorted(folder.iterdir())
    monkeypatch.chdir(folder)
    assert cli.run(arguments) == code
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert sorted(folder.iterdir()) == before
    return err


@pytest.mark.parametrize(
    ("options", "sets"),
    [([], ["paper", "arcs"]), (["--set", "arcs"], ["arcs"])],
)
def test_list_shows_all_sets_or_one(options, sets, capsys):
    assert cli.run(["movements", "list", *options]) == 0
    rows = [
        line.split()[0] for line in capsys.readouterr().out.splitlines() if "_5_" in line or "_4_" in line
    ]
    assert rows == [name for chosen in sets for name in library_names(chosen)]


def test_corners_of_a_generated_robot_like_movement_can_be_blended(tmp_path):
    file = tmp_path / "mine.toml"
    assert (
        cli.run(["movements", "generate", "--kind", "uniform", "--corners", "blend", "--out", str(file)]) == 0
    )
    assert (load_movement(file).trajectory.corners, load_movement(file).trajectory.blend) == ("blend", 0.03)


@pytest.mark.parametrize("kind", GENERATORS)
def test_every_kind_can_be_generated_and_planned(kind, tmp_path, capsys):
    file = tmp_path / "mine.toml"
    arguments = ["movements", "generate", "--kind", kind, "--targets", "2", "--seed", "2", "--out", str(file)]
    assert cli.run(arguments) == 0
    assert "top joint speed" in capsys.readouterr().out
    assert load_movement(file).name == "mine"
    assert len(load_movement(file).target_points) == 2


def test_duplicate_varies_a_movement_of_the_library(tmp_path, capsys):
    file = tmp_path / "again.toml"
    arguments = ["movements", "duplicate", "lognorm_4_1", "--seed", "5", "--share", "0.5", "--out", str(file)]
    assert cli.run(arguments) == 0
    assert "saved" in capsys.readouterr().out
    made = load_movement(file)
    assert made.provenance["duplicate_of"] == "lognorm_4_1"
    assert made.provenance["variation_share"] == 0.5


def test_kinds_lists_every_generator_and_says_that_a_duplicate_has_its_own_target_points(capsys):
    assert [kind for kind, generator in GENERATORS.items() if not generator.same_targets] == ["duplicate"]
    assert cli.run(["movements", "kinds"]) == 0
    out = capsys.readouterr().out
    assert all(kind in out for kind in GENERATORS)
    (row,) = [line for line in out.splitlines() if "own" in line]
    assert "duplicate" in row
    assert cli.run(["movements", "duplicate", "--help"]) == 0
    assert "Only the first target point stays" in capsys.readouterr().out
