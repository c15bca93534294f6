"""Recordings in the readers of others: a moving arm, in frames and names that ROS, Foxglove and Rerun know."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from recording_samples import provenance
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from scipy.spatial.transform import Rotation

from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import robot_model, tcp_pose
from pc_client.recording.arm_view import arm_tree
from pc_client.recording.recorder import Recorder
from pc_client.recording.recording import load_recording
from pc_client.recording.rows import Phase
from protocol.realtime.layout import COLUMNS

SIGNALS = [(column.name, column.count, column.unit) for column in COLUMNS]
NAMES = [name for name, count, _ in SIGNALS for _ in range(count)]
JOINTS = [
    f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
]
N_ROWS = 100
RERUN = Path(sys.executable).with_name("rerun")


def angles(row: int) -> np.ndarray:
    """Joint angles of a row: every joint turns, wrist 3 beyond pi."""
    return np.array([0.3, -1.7, -2.0, -0.4, 1.4, 2.0]) + 0.01 * row * np.array([1, -0.4, 0.7, -1, 0.5, 2])


def record(
    path: Path,
    arm: str = "ur3",
    cycle: float = 0.008,
    n_rows: int = N_ROWS,
    view: bool = True,
    now: Callable[[], int] | None = None,
) -> Path:
    """An arm that moves as `angles` says; the reference is 0.02 rad ahead."""
    model = robot_model(arm)
    tree = arm_tree(model.description) if view else None
    with Recorder(path, provenance(cycle_time_s=cycle), SIGNALS, arm=tree, now=now) as recorder:
        for row in range(n_rows):
            q, frame = angles(row), np.zeros(len(NAMES))
            pose = tcp_pose(model, q)
            turn = Rotation.from_matrix(pose[:3, :3]).as_rotvec()
            frame[0] = 50.0 + cycle * row
            for name, values in {
                "actual_q": q, "actual_qd": q / 9, "actual_TCP_pose": [*pose[:3, 3], *turn]
            }.items():  # fmt: skip
                frame[NAMES.index(name) :][:6] = values
            wanted = tcp_pose(model, q + 0.02)[:3, 3]
            recorder.append(frame, cycle * row, q + 0.02, q, wanted, wanted, q, Phase.MOVEMENT)
    return path


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("view") / "a.mcap")


def decoded(path: Path) -> list[tuple[str, int, object]]:
    """Topic, log time and message as `mcap-ros2-support` decodes them."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [(c.topic, m.log_time, message) for _, c, m, message in reader.iter_decoded_messages()]


def transforms(path: Path) -> list[tuple[int, dict[str, tuple[str, np.ndarray]]]]:
    """Log time and child -> (parent, T_parent_child) of every `/tf`, fixed ones included, as `rosbags` reads them."""
    fixed, moments = {}, []
    with AnyReader([path]) as reader:
        for connection, log_time, raw in reader.messages():
            if connection.topic not in ("/tf", "/tf_static"):
                continue
            links = {}
            for each in reader.deserialize(raw, connection.msgtype).transforms:
                p, r, T = each.transform.translation, each.transform.rotation, np.eye(4)
                T[:3, :3] = Rotation.from_quat([r.x, r.y, r.z, r.w]).as_matrix()
                T[:3, 3] = p.x, p.y, p.z
                links[each.child_frame_id] = (each.header.frame_id, T)
            if connection.topic == "/tf_static":
                fixed = links
            else:
                moments.append((log_time, {**fixed, **links}))
    return moments


def in_root(links: dict[str, tuple[str, np.ndarray]], frame: str) -> np.ndarray:
    """T_root_frame."""
    T = np.eye(4)
    while frame in links:
        frame, step = links[frame]
        T = step @ T
    assert frame == "base_link"
    return T


def test_joint_states_and_poses_are_those_of_the_rows(recording: Path) -> None:
    messages = decoded(recording)
    rows = load_recording(recording)
    stamps = {round(t * 1e9): row for row, t in enumerate(rows.t)}
    counts = {topic: 0 for topic, _, _ in messages}
    for topic, log_time, message in messages:
        counts[topic] += 1
        row = stamps[log_time]
        if topic == "/joint_states":
            assert message.name == JOINTS
            assert message.position == list(rows.column("actual_q")[row])
            assert message.velocity == list(rows.column("actual_qd")[row])
        if topic in ("/tcp_pose", "/desired_tcp_pose"):
            q = rows.column("actual_q" if topic == "/tcp_pose" else "ref_q")[row]
            pose = tcp_pose(robot_model(), q)
            p, r = message.pose.position, message.pose.orientation
            assert message.header.frame_id == "base"
            np.testing.assert_allclose((p.x, p.y, p.z), pose[:3, 3], atol=1e-9)
            turn = Rotation.from_quat([r.x, r.y, r.z, r.w]).as_matrix()
            np.testing.assert_allclose(turn, pose[:3, :3], atol=1e-9)
        if hasattr(message, "header"):
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == log_time
    seldom = dict.fromkeys(("/tf", "/joint_states", "/tcp_pose", "/desired_tcp_pose"), N_ROWS // 5)
    often = dict.fromkeys(("/robot_state", "/reference", "/command"), N_ROWS)
    assert counts == {**often, **seldom, "/robot_description": 1, "/tf_static": 1}


@pytest.mark.parametrize("arm", ROBOTS)
def test_the_transforms_are_a_tree_that_ends_at_the_tcp(tmp_path: Path, arm: str) -> None:
    moments = transforms(record(tmp_path / "a.mcap", arm, n_rows=6))
    assert len(moments) == 2
    for number, (_, links) in enumerate(moments):
        assert links.keys() == {
            *("base", "shoulder_link", "upper_arm_link", "forearm_link", "wrist_1_link", "wrist_2_link"),
            *("wrist_3_link", "tool0", "actual_tcp", "desired_tcp"),
        }
        T_base_root = np.linalg.inv(in_root(links, "base"))
        for frame, ahead in (("tool0", 0.0), ("actual_tcp", 0.0), ("desired_tcp", 0.02)):
            expected = tcp_pose(robot_model(arm), angles(5 * number) + ahead)
            np.testing.assert_allclose(T_base_root @ in_root(links, frame), expected, atol=1e-9)


@pytest.mark.parametrize("arm", ROBOTS)
def test_the_urdf_is_the_arm_and_needs_no_other_file(tmp_path: Path, arm: str) -> None:
    path = record(tmp_path / "a.mcap", arm, n_rows=1)
    with path.open("rb") as stream:
        (attachment,) = make_reader(stream).iter_attachments()
    (text,) = (message.data for topic, _, message in decoded(path) if topic == "/robot_description")
    assert attachment.name == f"{arm}.urdf"
    assert attachment.data.decode() == text
    assert "mesh" not in text
    assert len(text) < 8000
    model = pin.buildModelFromXML(text)
    assert list(model.names)[1:] == JOINTS
    np.testing.assert_allclose(model.upperPositionLimit, ROBOTS[arm].limits.q_max, rtol=1e-5)
    np.testing.assert_allclose(model.velocityLimit, ROBOTS[arm].limits.qd_max, rtol=1e-5)
    data = model.createData()
    for row in (0, 77, 150):
        pin.framesForwardKinematics(model, data, angles(row))
        frames = {name: data.oMf[model.getFrameId(name)] for name in ("base", "tool0")}
        T = (frames["base"].inverse() * frames["tool0"]).homogeneous
        np.testing.assert_allclose(T, tcp_pose(robot_model(arm), angles(row)), atol=1e-9)


def test_the_bodies_of_the_urdf_reach_from_joint_to_joint() -> None:
    robot = ElementTree.fromstring(arm_tree(ROBOTS["ur3"]).urdf)
    # A tube for each offset, and a disc at the joint that moves the link.
    assert [(link.get("name"), len(link.findall("visual"))) for link in robot.findall("link")] == [
        ("base_link", 1), ("shoulder_link", 2), ("upper_arm_link", 3), ("forearm_link", 2),
        ("wrist_1_link", 2), ("wrist_2_link", 2), ("wrist_3_link", 2), ("base", 0), ("tool0", 0),
    ]  # fmt: skip


def test_what_is_written_once_is_latched(recording: Path) -> None:
    with AnyReader([recording]) as reader:
        qualities = {each.topic: each.ext.offered_qos_profiles for each in reader.connections}
    latched = {topic for topic, offered in qualities.items() if offered}
    assert latched == {"/robot_description", "/tf_static"}
    assert all(qualities[topic][0].durability is QosDurability.TRANSIENT_LOCAL for topic in latched)


@pytest.mark.parametrize(("cycle", "n_views"), [(0.002, 5), (0.1, 100)])
def test_the_arm_is_shown_25_times_a_second_at_most(tmp_path: Path, cycle: float, n_views: int) -> None:
    assert len(transforms(record(tmp_path / "a.mcap", cycle=cycle))) == n_views


def test_the_view_makes_a_recording_a_fifth_longer(tmp_path: Path) -> None:
    with_view = record(tmp_path / "with.mcap", n_rows=512).stat().st_size
    without = record(tmp_path / "without.mcap", n_rows=512, view=False).stat().st_size
    assert with_view < 1.22 * without


def test_absolute_times_follow_the_clock_of_the_controller(tmp_path: Path) -> None:
    begin = 1_700_000_000_123_456_789
    readings = iter([begin])  # the clock is read once
    path = record(tmp_path / "a.mcap", n_rows=9, now=lambda: next(readings))
    times = [log_time for topic, log_time, _ in decoded(path) if topic == "/robot_state"]
    assert times == [begin + 8_000_000 * row for row in range(9)]
    assert min(time for time, _ in transforms(path)) == begin
    with path.open("rb") as stream:
        units = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}["units"]
    assert units["log_time"] == "ns since 1970-01-01T00:00:00Z, clock of the PC"
    assert load_recording(path).t[0] == 50.0


def test_units_of_all_signals_are_in_the_file(recording: Path) -> None:
    with recording.open("rb") as stream:
        units = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}["units"]
    assert units.keys() == {"log_time", *(signal.name for signal in load_recording(recording).signals)}
    assert units["log_time"] == "ns since the controller started"
    assert (units["actual_q"], units["actual_TCP_pose"], units["cmd_qd"]) == ("rad", "m, rad", "rad/s")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("timestamp", np.nan), ("timestamp", -1.7e308), ("actual_q", np.inf),
        ("actual_TCP_pose", np.nan), ("actual_TCP_pose", -1.7e308),
    ],
)  # fmt: skip
def test_a_frame_without_sense_is_recorded_as_it_is(tmp_path: Path, name: str, value: float) -> None:
    frame = np.zeros(len(NAMES))
    frame[NAMES.index(name) :][:6] = value
    zeros = np.zeros(6)
    arm = arm_tree(ROBOTS["ur3"])
    with Recorder(tmp_path / "a.mcap", provenance(), SIGNALS, arm=arm) as recorder:
        recorder.append(frame, 0.0, zeros, zeros, zeros[:3], zeros[:3], zeros, Phase.MOVEMENT)
    column = load_recording(tmp_path / "a.mcap").column(name)
    np.testing.assert_equal(column.flat[0], value)
    decoded(tmp_path / "a.mcap")


@pytest.mark.skipif(not RERUN.exists(), reason="needs rerun-sdk, 500 MB: pip install rerun-sdk")
def test_rerun_shows_bodies_of_all_links_in_the_frames_that_tf_moves(recording: Path, tmp_path: Path) -> None:
    def rerun(*arguments: object) -> str:
        words = [RERUN, *map(str, arguments)]
        return subprocess.run(words, check=True, capture_output=True, text=True).stdout

    assert rerun("mcap", "check", recording).count("ok ") == 9
    rerun("mcap", "convert", recording, "-o", tmp_path / "shown.rrd")
    listed = rerun("rrd", "print", tmp_path / "shown.rrd").splitlines()
    for link in ElementTree.fromstring(arm_tree(ROBOTS["ur3"]).urdf).findall("link"):
        for number in range(len(link.findall("visual"))):
            body = f"/ur3/visual_geometries/{link.get('name')}/visual_{number} "
            assert any("Cylinders3D" in line for line in listed if body in line)
    assert any(" /tf " in line and "Transform3D:quaternion" in line for line in listed)
