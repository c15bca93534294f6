"""Files of movements: parameters, samples, poses, joint angles. What is written comes back equal, what is wrong is named."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pc_client import JointTrajectory
from pc_client.errors import MovementError
from pc_client.movements.description import describe
from pc_client.movements.generate import generate_movement, write_library
from pc_client.movements.library_sets import LIBRARY_FOLDER, LIBRARY_SETS, library_names
from pc_client.movements.lognormal import LiteralTiming, Lognormal, TwoSidedTiming
from pc_client.movements.movement import Movement, load_motion, load_movement
from pc_client.movements.samples import SampledTrajectory
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
from pc_client.movements.trajectory import Similarity
from pc_client.movements.uniform import Uniform

NAMES = [
    f"{kind}_{number}" for kind in ("uniform", "lognorm") for number in ("4_1", "4_2", "5_1", "5_2", "5_3")
]


def test_each_set_has_the_ten_of_table_one() -> None:
    assert library_names() == library_names("paper") == NAMES
    assert library_names("arcs") == [f"arcs/{name}" for name in NAMES]
    assert sorted(path.name for path in LIBRARY_FOLDER.iterdir()) == sorted(LIBRARY_SETS) == ["arcs", "paper"]
    for set_name in LIBRARY_SETS:
        assert sorted(path.stem for path in (LIBRARY_FOLDER / set_name).iterdir()) == sorted(NAMES)
    with pytest.raises(MovementError, match='no set of movements "arc": give one of paper, arcs'):
        library_names("arc")


def test_only_the_paper_set_has_the_names_of_table_one() -> None:
    """So nothing compares a movement of another set with the paper's figure."""
    for name in NAMES:
        assert load_movement(name).name == name
        assert load_movement(f"arcs/{name}").name == f"arcs_{name}"


def test_generation_reproduces_the_files_to_the_byte(tmp_path: Path) -> None:
    write_library(tmp_path)
    for set_name in LIBRARY_SETS:
        for name in NAMES:
            file = Path(set_name, f"{name}.toml")
            assert (tmp_path / file).read_bytes() == (LIBRARY_FOLDER / file).read_bytes()


def assert_equal(copy: Movement, movement: Movement) -> None:
    assert (copy.kind, copy.duration) == (movement.kind, movement.duration)
    np.testing.assert_array_equal(copy.target_points, movement.target_points)
    np.testing.assert_array_equal(copy.stroke_durations, movement.stroke_durations)
    t = np.linspace(0.0, movement.duration, 200)
    for got, expected in zip(copy.motion(t), movement.motion(t), strict=True):
        np.testing.assert_array_equal(got, expected)


def test_every_timing_and_corner_survives_saving(tmp_path: Path) -> None:
    points = np.array([[0.3, 0.0, 0.2], [0.35, 0.1, 0.2], [0.3, 0.1, 0.3], [0.3, 0.2, 0.2]])
    timings = (TwoSidedTiming(0.1, 1.0, 0.1, 3.0), LiteralTiming(0.6, 1.0, 1.5), Lognormal(0.2, 0.5, 0.1))
    trajectory = SigmaLognormal(points, tuple(Stroke(timing, 0.1 / 3.0, 2.0) for timing in timings), 4.0)
    human = Movement(
        "odd name, ü", trajectory, np.array([1.0, 1.0, 2.0]), {"a key": 'x "y"', "n": 3, "f": 0.1}
    )
    trajectory = Uniform(points, human.stroke_durations, (0.15,), "blend", 0.02)
    blended = Movement("blended", trajectory, human.stroke_durations)
    for movement in (human, blended):
        movement.save(tmp_path / "copy.toml")
        copy = load_movement(tmp_path / "copy.toml")
        assert copy.name == movement.name
        assert dict(copy.provenance) == dict(movement.provenance)
        assert_equal(copy, movement)


def test_samples_survive_saving(tmp_path: Path) -> None:
    movement = load_movement("lognorm_4_1")
    at = np.linspace(0.0, movement.duration, round(movement.duration / 0.01) + 1)
    trajectory = SampledTrajectory(at, movement.sample(at).p)
    Movement("mine", trajectory, np.array([trajectory.duration])).save(tmp_path / "mine.csv")
    copy = load_movement(tmp_path / "mine.csv")
    assert (copy.kind, copy.name) == ("samples", "mine")
    np.testing.assert_array_equal(copy.trajectory.points, trajectory.points)
    t = np.linspace(0.0, movement.duration, 777)
    np.testing.assert_allclose(copy.sample(t).p, movement.sample(t).p, atol=1e-6)
    np.testing.assert_allclose(copy.sample(t).v, movement.sample(t).v, atol=1e-4)
    np.testing.assert_array_equal(copy.target_points, trajectory.points[[0, -1]])


def test_samples_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "hand.csv"
    path.write_text("# mine\n\nt; x; y; z\n1.0; 0.0; 0; 3\n1.5; 0.1; 0; 3\n2.5; .3; 0; 3\n3; .4; 0; 3\n")
    movement = load_movement(path)
    assert movement.duration == 2.0
    # a natural spline through points on a line is the line
    np.testing.assert_allclose(
        movement.sample([0.0, 1.0, 2.0]).p, [[0, 0, 3], [0.2, 0, 3], [0.4, 0, 3]], atol=1e-15
    )
    np.testing.assert_allclose(movement.speed([0.0, 1.0, 2.0]), 0.2, atol=1e-14)
    path.write_text("0 0 0 0\n0 0 1 1\n0 0 2 2\n0 0 3 3.0\n")
    np.testing.assert_allclose(load_movement(path).sample(1.5).p, [[0.0, 0.0, 1.5]], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("0,0,0,0\n0,0,1\n", "line 2: 3 columns"),
        ("0,0,0,0\n0,0,nan,1\n", 'line 2: z is "nan"'),
        ("x,y,z,t\n0,a,0,0\n", 'line 2: y is "a"'),
        ("0,0,0,0\n0,0,0,1\n0,0,0,1\n", "line 3: t = 1 s after t = 1 s in line 2"),
        ("0,0,0,0\n0,0,0,1\n0,0,0,2\n", "3 samples"),
        ("", "0 samples"),
        ("a,b,c,d\n0,0,0,0\n", 'line 1: x is "a"'),
    ],
)
def test_bad_samples_are_named_by_line(text: str, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(MovementError, match=r"bad\.csv") as caught:
        load_movement(path)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


HUMAN = load_movement("arcs/lognorm_4_1").text
ROBOT = load_movement("arcs/uniform_4_1").text
JERK = generate_movement("minimum_jerk", 4, 1).text
POWER = generate_movement("power_law", 4, 1).text


@pytest.mark.parametrize(
    ("text", "change", "complaint"),
    [
        (HUMAN, ("format = 1", "format = 2"), "format: 2"),
        (HUMAN, ("format = 1", ""), "format: missing"),
        (HUMAN, ('kind = "lognormal"', 'kind = "human"'), "kind: 'human'; give one of lognormal, uniform"),
        (HUMAN, ("duration = 5.901", "duration = 4.0"), "add up to 5.901000 s"),
        (HUMAN, ("sigma = 0.183", "sigma = -1"), "sigma -1"),
        (
            HUMAN,
            ("tilt = 1.327", "tlit = 1.327"),
            "strokes[0].tlit: no such key; did you mean tilt?",
        ),
        (
            HUMAN,
            ("sigma = 0.183", "mu = 0.183"),
            "a stroke with start, duration, mu; give start, duration, sigma",
        ),
        (
            HUMAN,
            ("[provenance]", "[provenance]\ndone = true"),
            "provenance.done: True; give a text or a number",
        ),
        (HUMAN, ("    [0.3061, 0.1286, 0.2948],\n", ""), "3 strokes with target points of shape (3, 3)"),
        (HUMAN, ("format = 1", "format = = 1"), "line 3"),
        (ROBOT, ("[profile]", "[profil]"), "profile: missing"),
        (
            ROBOT,
            ('corners = "stop"', 'corners = "round"'),
            "profile.corners: 'round'; give 'stop' or 'blend'",
        ),
        (ROBOT, ("ramps = [0.16, 0.05]", "ramps = 0.2"), "profile.ramps: 0.2; give a list"),
        (ROBOT, ("ramps = [0.16, 0.05]", "ramps = [0.2, 0.1, 0.1]"), "one boxcar width"),
        (ROBOT, ("ramps = [0.16, 0.05]", "ramps = [2.2, 0.1]"), "every stroke must last longer"),
        (ROBOT, ("duration = 5.901", "duration = 6"), "duration: 6.0 s"),
        (ROBOT, ("stroke_durations", "durations"), "stroke_durations: missing"),
        (JERK, ('passing = "stop"', 'passing = "blend"'), "profile.passing: 'blend'; give 'stop' or 'via'"),
        (JERK, ("duration = 8.685", "duration = 6.0"), "duration: 6.0 s"),
        (POWER, ("largest_radius = 1.0", "largest_radius = -1.0"), "largest radius of -1.0 m"),
        (POWER, ("exponent = 0.3333333333333333", "exponent = 3.0"), "exponent 3.0"),
    ],
)
def test_bad_files_are_named_by_field(
    text: str, change: tuple[str, str], complaint: str, tmp_path: Path
) -> None:
    assert change[0] in text
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(*change))
    with pytest.raises(MovementError, match=r"bad\.toml") as caught:
        load_movement(path)
    assert complaint in str(caught.value)
    assert str(caught.value).count("bad.toml") == 1
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "tolerance"), [(HUMAN, 1.1e-3), (POWER, 1e-9)], ids=["lognormal", "power law"]
)
def test_without_stroke_durations_they_are_the_speed_minima_or_the_passages(
    text: str, tolerance: float, tmp_path: Path
) -> None:
    whole, short = tmp_path / "whole.toml", tmp_path / "short.toml"
    whole.write_text(text)
    short.write_text("\n".join(line for line in text.splitlines() if not line.startswith("stroke_durations")))
    np.testing.assert_allclose(
        load_movement(short).stroke_durations, load_movement(whole).stroke_durations, atol=tolerance
    )


def test_a_stroke_by_k_is_a_stroke_by_its_lead(tmp_path: Path) -> None:
    text = 'format = 1\nname = "one"\nkind = "lognormal"\nduration = 1.2\n'
    text += "target_points = [[0, 0, 0], [0.1, 0, 0]]\n"
    trajectories = []
    for field in ("k = 1.5", "lead = 0.5"):
        (tmp_path / "one.toml").write_text(text + f"[[strokes]]\nstart = 0.1\nduration = 1.0\n{field}\n")
        trajectories.append(load_movement(tmp_path / "one.toml").sample([0.5]).p)
    np.testing.assert_allclose(trajectories[0], trajectories[1], atol=1e-15)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("lognorm_4_3", "did you mean lognorm_"),
        ("nothing like it", "known are uniform_4_1"),
        ("gone/away.toml", "away.toml: cannot be read (No such file"),
        ("movement.json", ".toml (parameters) or .csv"),
    ],
)
def test_unreachable_movements(name: str, complaint: str) -> None:
    with pytest.raises(MovementError) as caught:
        load_movement(name)
    assert complaint in str(caught.value)


def test_folders_binaries_and_wrong_suffixes(tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    for name in ("folder.toml", "binary.csv"):
        with pytest.raises(MovementError, match=name):
            load_movement(tmp_path / name)
    movement = load_movement("uniform_5_1")
    with pytest.raises(MovementError, match=r"saved as a \.toml file"):
        movement.save(tmp_path / "movement.csv")
    with pytest.raises(MovementError, match="cannot be written"):
        movement.save(tmp_path / "no" / "movement.toml")


def test_rest_outside_of_the_movement() -> None:
    movement = generate_movement("uniform", 3, 5)
    sample = movement.sample([-1.0, movement.duration + 1.0])
    np.testing.assert_allclose(sample.p, movement.target_points[[0, -1]], atol=1e-15)
    np.testing.assert_array_equal(sample.v, 0.0)
    with pytest.raises(MovementError):
        movement.sample(np.nan)


def test_description_is_plain_data() -> None:
    human, robot = describe(load_movement("lognorm_5_2")), describe(load_movement("uniform_5_2"))
    assert (human["kind"], robot["kind"]) == ("lognormal", "uniform")
    assert human["stroke_durations_s"] == robot["stroke_durations_s"]
    assert len(human["strokes"]) == 4
    assert "strokes" not in robot
    assert human["expected_snr_db"]["20 ms"] > human["expected_snr_db"]["28 ms"]
    assert human["provenance"] == dict(load_movement("lognorm_5_2").provenance)
    assert human["provenance"]["seed"] == 4


T = np.linspace(0.0, 2.0, 9)
PATH = np.column_stack((0.3 + 0.01 * T, 0.1 * T, 0.3 + 0.0 * T))
TURNS = Rotation.from_rotvec(np.outer(T, [0.1, 0.0, 0.2]))


def written(folder, header, columns, name="poses.csv"):
    path = folder / name
    rows = [",".join(f"{value:.12g}" for value in row) for row in np.column_stack(columns)]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("x,y,z,rx,ry,rz,t", (PATH, TURNS.as_rotvec(), T)),
        ("t,x,y,z,rx,ry,rz", (T, PATH, TURNS.as_rotvec())),
        ("x,y,z,qx,qy,qz,qw,t", (PATH, TURNS.as_quat(), T)),
    ],
)
def test_a_file_of_poses_turns_the_tool(tmp_path, header, columns):
    movement = Movement.from_csv(written(tmp_path, header, columns))
    np.testing.assert_allclose(movement.rotations(T), TURNS.as_matrix(), atol=1e-9)
    np.testing.assert_allclose(movement.sample(T).p, PATH, atol=1e-9)


def test_poses_are_written_and_read_back(tmp_path):
    movement = Movement.from_samples(T, PATH, TURNS.as_quat(), name="turn")
    movement.save(tmp_path / "turn.csv")
    again = load_movement(tmp_path / "turn.csv")
    np.testing.assert_array_equal(again.sample(T).p, movement.sample(T).p)
    np.testing.assert_allclose(again.rotations(T), movement.rotations(T), atol=1e-12)


def test_poses_that_are_turned_elsewhere_turn_the_tool_too():
    R = Rotation.from_rotvec([0.0, 0.0, 0.5]).as_matrix()
    movement = Movement.from_samples(T, PATH, TURNS.as_rotvec()).transformed(Similarity(1.0, R, np.zeros(3)))
    np.testing.assert_allclose(movement.rotations(T), R @ TURNS.as_matrix(), atol=1e-9)
    assert isinstance(movement, Movement)


def test_positions_alone_leave_the_orientation_to_planning():
    assert Movement.from_samples(T, PATH).rotations(T) is None
    assert Movement.library("uniform_4_1").rotations(T) is None


def test_a_file_of_joint_angles_is_a_trajectory_of_joints(tmp_path):
    q = np.outer(T, np.arange(6.0) / 10)
    path = written(tmp_path, "t,q0,q1,q2,q3,q4,q5", (T, q))
    trajectory = load_motion(path)
    assert isinstance(trajectory, JointTrajectory)
    assert trajectory.name == "poses"
    np.testing.assert_allclose(trajectory.q, q)
    with pytest.raises(MovementError, match="holds joint angles"):
        load_movement(path)


def test_seven_columns_without_names_are_not_guessed(tmp_path):
    path = tmp_path / "seven.csv"
    path.write_text("0,0,0,0,0,0,0\n")
    with pytest.raises(MovementError, match="name them in the first line"):
        load_motion(path)


@pytest.mark.parametrize(
    ("rotations", "complaint"),
    [
        (np.zeros((9, 2)), "give \\(n, 3\\) rotation vectors"),
        (np.zeros((9, 4)), "give one of length 1"),
        (np.full((9, 3), np.nan), "give finite ones"),
        (np.zeros((8, 3)), "give one for each"),
    ],
)
def test_orientations_that_make_no_sense_are_refused(rotations, complaint):
    with pytest.raises(MovementError, match=complaint):
        Movement.from_samples(T, PATH, rotations)


@pytest.mark.parametrize(
    ("t", "q", "complaint"),
    [
        (T, np.zeros((9, 5)), "six angles"),
        (T[:3], np.zeros((3, 6)), "at least 4"),
        (T, np.full((9, 6), np.inf), "not finite"),
        (T[::-1], np.zeros((9, 6)), "times must increase"),
        (1e4 * T, np.zeros((9, 6)), "duration"),
    ],
)
def test_joint_angles_that_make_no_sense_are_refused(t, q, complaint):
    with pytest.raises(MovementError, match=complaint):
        JointTrajectory(t, q)


@given(
    t=st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=6, unique=True).map(sorted),
    turn=st.lists(st.tuples(*3 * [st.floats(width=32)]), min_size=4, max_size=6),
)
def test_samples_of_any_numbers_make_a_movement_or_one_error(t, turn):
    n = min(len(t), len(turn))
    with suppress(MovementError):
        movement = Movement.from_samples(t[:n], np.zeros((n, 3)), turn[:n])
        assert np.isfinite(movement.rotations(movement.duration * np.linspace(0.0, 1.0, 5))).all()
