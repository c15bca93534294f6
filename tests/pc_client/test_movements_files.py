"""Movement files: the library of ten, what is written comes back equal, what is wrong is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pc_client.errors import MovementError
from pc_client.movements.description import describe
from pc_client.movements.generate import generate_library, generate_movement, write_library
from pc_client.movements.library_sets import LIBRARY_FOLDER, LIBRARY_SETS, library_names
from pc_client.movements.lognormal import LiteralTiming, Lognormal, TwoSidedTiming
from pc_client.movements.movement import Movement, load_movement
from pc_client.movements.samples import SampledTrajectory
from pc_client.movements.sigma_lognormal import SigmaLognormal, Stroke
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


def test_another_seed_gives_other_movements() -> None:
    other = generate_library("paper", seed=100)
    assert list(other) == NAMES
    assert not np.allclose(other["lognorm_4_1"].target_points, load_movement("lognorm_4_1").target_points)


@pytest.mark.parametrize("name", library_names("paper") + library_names("arcs"))
def test_library_movement_survives_saving(name: str, tmp_path: Path) -> None:
    movement = load_movement(name)
    movement.save(tmp_path / "copy.toml")
    copy = load_movement(tmp_path / "copy.toml")
    assert_equal(copy, movement)
    assert copy.name == name.replace("/", "_")
    assert dict(copy.provenance) == dict(movement.provenance)


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


@pytest.mark.parametrize(
    ("text", "change", "complaint"),
    [
        (HUMAN, ("format = 1", "format = 2"), "format: 2"),
        (HUMAN, ("format = 1", ""), "format: missing"),
        (HUMAN, ('name = "arcs_lognorm_4_1"', "name = 3"), "name: 3; give a text"),
        (HUMAN, ('kind = "lognormal"', 'kind = "human"'), "kind: 'human'; give one of lognormal, uniform"),
        (
            HUMAN,
            ("duration = 5.901", 'duration = "long"'),
            "duration: 'long'; give a number from 0 to 1200 s",
        ),
        (HUMAN, ("duration = 5.901", "duration = 4.0"), "add up to 5.901000 s"),
        (HUMAN, ("sigma = 0.183", "sigma = -1"), "sigma -1"),
        (HUMAN, ("sigma = 0.183", "sigma = nan"), "strokes[1].sigma: nan"),
        (HUMAN, ("sigma = 0.183", "sigma = true"), "strokes[1].sigma: True"),
        (
            HUMAN,
            ("tilt = 1.327", "tlit = 1.327"),
            "strokes[0].tlit: no such key; did you mean tilt?",
        ),
        (HUMAN, ("[[strokes]]", "[[stroke]]"), "strokes: missing"),
        (HUMAN, ("[provenance]", "[provenanc]"), "provenanc: no such key; did you mean provenance?"),
        (HUMAN, ('kind = "lognormal"', ""), "kind: nothing; give one of lognormal, uniform"),
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
        (
            HUMAN,
            ("0.3061, 0.1286, 0.2948", "0.3061, 0.1286"),
            "target_points[0][2]: missing; give a finite number in m, robot base frame",
        ),
        (HUMAN, ("0.3061, 0.1286, 0.2948", "0.3061, 0.1286, inf"), "target_points[0][2]: inf"),
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


def test_without_stroke_durations_they_are_the_speed_minima(tmp_path: Path) -> None:
    path = tmp_path / "short.toml"
    path.write_text("\n".join(line for line in HUMAN.splitlines() if not line.startswith("stroke_durations")))
    np.testing.assert_allclose(
        load_movement(path).stroke_durations, load_movement("arcs/lognorm_4_1").stroke_durations, atol=1.1e-3
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
    assert human["stroke_durations_s"] == robot["stroke_durations_s"]
    assert len(human["strokes"]) == 4
    assert "strokes" not in robot
    assert human["expected_snr_db"]["22 ms"] > human["expected_snr_db"]["35 ms"]
    assert human["provenance"] == dict(load_movement("lognorm_5_2").provenance)
    assert human["provenance"]["seed"] == 4
