"""A gripper on the arm: its registers, its fingers, what they hold, and who reaches it."""

import socket
from pathlib import Path

import numpy as np
import pytest
from box_support import BareBox, FakeConnection
from e_series_support import ESeriesBench
from finger_support import PERIOD, DrivenFingers, ask, program_file, tool_box

from protocol.robotiq import Fault, Objects, Status
from protocol.ur_types import SoftwareVersion
from ur_emulator.errors import ArgumentError, ModelError, RefusedError
from ur_emulator.host.ports.robotiq import RobotiqPort
from ur_emulator.host.ports.tool_line import ToolLinePort
from ur_emulator.machine.models.generations import E_SERIES
from ur_emulator.machine.models.robots import robot_by_name
from ur_emulator.machine.models.things import Thing
from ur_emulator.machine.motion.generators import JointTarget
from ur_emulator.machine.plant.hand import FingerCommand
from ur_emulator.machine.plant.plant import Plant
from ur_emulator.machine.plant.scene import load_scene
from ur_emulator.machine.tools.robotiq import RobotiqGripper
from ur_hil.tools import TOOLS, tools_by_name

HAND = TOOLS["robotiq-2f85"]


class Fingers(DrivenFingers):
    def __init__(self):
        super().__init__(RobotiqGripper(HAND, PERIOD), width=0.04)

    def set(self, **values):
        self.gripper.set(*values.items())

    def get(self, *names):
        return tuple(self.gripper.get(name) for name in names)

    def activate(self):
        self.run(0.1)
        self.set(ACT=1)
        self.run(3.0)
        assert self.get("STA", "OBJ", "POS", "FLT") == (Status.ACTIVE, Objects.AT_TARGET, 3, Fault.NONE)


@pytest.fixture
def fingers():
    return Fingers()


def test_power_lets_it_be_activated(fingers):
    fingers.has_power = False
    fingers.run(0.1)
    assert fingers.get("STA", "POS") == (None, None)
    fingers.has_power = True
    fingers.run(0.1)
    assert fingers.get("ACT", "STA") == (0, Status.RESET)
    fingers.set(GTO=1)
    fingers.run(0.1)
    assert fingers.get("FLT") == (Fault.NOT_ACTIVATED,)
    fingers.set(GTO=0, ACT=1)
    fingers.run(0.05)
    assert fingers.get("ACT", "STA", "OBJ") == (1, Status.ACTIVATING, Objects.MOVING)
    fingers.set(POS=100, GTO=1)
    fingers.run(0.05)
    assert fingers.get("FLT") == (Fault.ACTION_DELAYED,)
    fingers.run(4.0)
    assert fingers.get("STA", "FLT", "POS", "OBJ") == (Status.ACTIVE, Fault.NONE, 100, Objects.AT_TARGET)
    fingers.has_power = False
    fingers.run(0.1)
    fingers.has_power = True
    fingers.run(0.1)
    assert fingers.get("ACT", "STA", "POS") == (0, Status.RESET, 100)


def test_a_target_shows_together_with_the_motion_towards_it(fingers):
    fingers.activate()
    fingers.set(POS=255, SPE=255, GTO=1)
    assert fingers.get("PRE", "OBJ") == (0, Objects.AT_TARGET)  # not yet taken
    while fingers.get("PRE") != (255,):
        fingers.run(PERIOD)
    assert fingers.get("OBJ") == (Objects.MOVING,)
    fingers.run(1.0)
    assert fingers.get("OBJ", "POS") == (Objects.AT_TARGET, 230)
    fingers.set(POS=0)
    fingers.run(0.2)
    fingers.set(GTO=0)
    fingers.run(0.1)
    (stopped,) = fingers.get("POS")
    fingers.run(0.5)
    assert fingers.get("POS") == (stopped,)
    assert 3 < stopped < 230


def test_a_target_without_go_waits_and_is_not_reached(fingers):
    fingers.activate()
    fingers.set(POS=100)
    fingers.run(0.1)
    assert fingers.get("PRE", "OBJ", "POS") == (100, Objects.MOVING, 3)
    fingers.set(GTO=1)
    fingers.run(1.0)
    assert fingers.get("OBJ", "POS") == (Objects.AT_TARGET, 100)


def test_what_is_in_the_way_is_gripped_and_its_loss_is_seen(fingers):
    fingers.activate()
    fingers.block = 0.04
    fingers.set(POS=255, GTO=1)
    fingers.run(1.0)
    assert fingers.get("OBJ", "POS") == (Objects.CONTACT_CLOSING, HAND.count_of(0.04))
    fingers.set(POS=0)
    fingers.run(1.0)
    assert fingers.get("OBJ", "POS") == (Objects.AT_TARGET, 3)
    fingers.set(POS=255)
    fingers.run(1.0)
    fingers.block = 0.0
    fingers.run(1.0)
    assert fingers.get("OBJ", "POS") == (Objects.AT_TARGET, 230)


def test_a_reset_ends_a_motion_and_an_activation_begins_anew(fingers):
    fingers.activate()
    fingers.set(POS=200, SPE=0, GTO=1)
    fingers.run(0.5)
    fingers.set(ACT=1)
    fingers.run(0.5)
    assert fingers.get("STA", "OBJ") == (Status.ACTIVE, Objects.MOVING)
    fingers.set(ACT=0)
    fingers.run(0.1)
    (stopped,) = fingers.get("POS")
    fingers.run(0.5)
    assert fingers.get("STA", "POS") == (Status.RESET, stopped)
    assert 3 < stopped < 200
    fingers.set(ACT=1, SPE=255)
    fingers.run(0.5)
    assert fingers.get("STA") == (Status.ACTIVATING,)
    fingers.run(4.0)
    assert fingers.get("STA", "OBJ", "POS") == (Status.ACTIVE, Objects.AT_TARGET, 200)


def test_automatic_release_needs_a_new_activation(fingers):
    fingers.activate()
    fingers.set(POS=255, GTO=1)
    fingers.run(1.0)
    fingers.set(ATR=1)
    fingers.run(0.1)
    assert fingers.get("FLT", "OBJ") == (Fault.RELEASING, Objects.MOVING)
    fingers.run(6.0)
    assert fingers.get("FLT", "STA", "POS") == (Fault.RELEASED, Status.RESET, 3)
    fingers.set(POS=100, ATR=0)
    fingers.run(1.0)
    assert fingers.get("POS") == (3,)
    fingers.set(ACT=0)
    fingers.run(0.1)
    assert fingers.get("FLT") == (Fault.NONE,)


def test_registers_of_the_serial_line_are_those_of_the_manual(fingers):
    gripper = fingers.gripper
    fingers.run(0.1)
    gripper.write_registers(0x03E8, (0, 0, 0))
    gripper.write_registers(0x03E8, (0x0100,))
    assert gripper.read_registers(0x07D0, 1) == [0x1100]  # a driver reads once, and does not wait if it is 0
    fingers.run(3.0)
    assert gripper.read_registers(0x07D0, 1) == [0x3100]
    gripper.write_registers(0x03E8, (0x0900, 0x00FF, 0xFFFF))
    assert gripper.read_registers(0x07D0, 2) == [0x3900, 0x00FF]
    fingers.run(1.0)
    assert gripper.read_registers(0x07D0, 6) == [0xF900, 0x00FF, 0xE600, 0, 0, 0]
    assert gripper.read_registers(0x03E8, 3) == [0x0900, 0x00FF, 0xFFFF]
    for address, count in ((0x07CF, 1), (0x07D0, 17), (0, 1)):
        with pytest.raises(LookupError):
            gripper.read_registers(address, count)
    with pytest.raises(LookupError):
        gripper.write_registers(0x03E8, (0,) * 4)


# --- in the physics


class Bench:
    """An arm at rest with its gripper, and a block of 40 mm between its pads."""

    def __init__(self, mass=0.2, friction=0.3):
        robot = robot_by_name("ur5e")
        self.plant = Plant(robot, robot.generation.fidelity("typical"), 7, (HAND,))
        self.plant.set_payload(HAND.mass, HAND.cog)
        # The fingers are level: what they hold can fall past both.
        q = (0.0, -1.5, 1.5, -1.570796, -1.570796, 0.0)
        self.plant.reset(q)
        self._target = JointTarget(q, (0.0,) * 6, (0.0,) * 6)
        self._period = robot.generation.period_s
        self.run(0.6, 0.085)
        physics = self.plant._physics
        rotation = physics.flange_rotation.copy()
        self.place = (*physics.flange_position + rotation @ [0.0, 0.0, HAND.length], np.pi, 0.0, 0.0)
        self.scene = physics.scene
        self.scene.put(Thing("block", "box", (0.04, 0.04, 0.06), mass, friction, self.place))

    def run(self, seconds, width, force=50.0, held=False):
        self.plant.finger_commands = [FingerCommand(width, 0.15, force)]
        for _ in range(round(seconds / self._period)):
            self.plant.step(self._target)
            self.plant.sense()
            if held:
                self.scene.move("block", self.place)

    def grip(self, force):
        self.run(0.6, 0.0, force, held=True)
        self.run(0.2, 0.0, force)

    @property
    def drop(self):
        """How far the block has fallen [m]."""
        return self.place[2] - self.scene.state("block").pose[2]


@pytest.mark.parametrize("force", [20.0, 120.0, 235.0])
def test_a_block_is_gripped_with_the_force_and_at_the_place_of_the_table(force):
    bench = Bench()
    bench.grip(force)
    physics = bench.plant._physics
    assert abs(HAND.count_of(bench.plant.fingers[0].width) - HAND.count_of(0.04)) <= 3
    assert float(np.abs(physics.data.actuator_force[6])) / 2.0 == pytest.approx(force, rel=0.1)
    assert bench.drop < 0.001
    assert bench.scene.state("block").touches_tool


@pytest.mark.parametrize(("share", "holds"), [(0.85, True), (1.15, False)])
def test_a_block_slips_at_the_load_that_friction_carries(share, holds):
    force = 20.0
    bench = Bench(mass=share * 2.0 * HAND.friction * force / 9.81)
    bench.grip(force)
    before = bench.drop
    bench.run(1.0, 0.0, force)
    assert bool(bench.drop - before < 0.002) is holds


def test_the_load_that_nobody_declared_is_felt():
    bench = Bench(mass=1.0)
    bench.grip(100.0)
    with_block = bench.plant.sense().estimated_force[2]
    bench.scene.remove("thing", "block")
    bench.run(0.5, 0.0, 100.0)
    assert bench.plant.sense().estimated_force[2] - with_block == pytest.approx(9.81, abs=2.0)


def test_things_come_and_go_and_the_arm_stays():
    bench = Bench()
    q = bench.plant.q_true.copy()
    with pytest.raises(RefusedError, match="the arm is where it should be"):
        bench.scene.put(Thing("anvil", "sphere", (0.2,), 5.0, 0.5, bench.place))
    assert bench.scene.names == ("block",)
    bench.scene.put(Thing("ball", "sphere", (0.03,), 0.1, 0.5, (0.5, 0.5, 0.2, 0.0, 0.0, 0.0)))
    bench.run(1.0, 0.085)
    assert bench.scene.state("ball").pose[2] == pytest.approx(0.01, abs=0.002)  # on the table
    np.testing.assert_allclose(bench.plant.q_true, q, atol=2e-4)
    bench.scene.remove("thing", "block")
    assert bench.scene.names == ("ball",)


@pytest.mark.parametrize("width", [0.085, 0.0])  # closed, the fingers are where the block was put
def test_a_thing_that_has_moved_stays_when_it_cannot_be_put_again(width):
    bench = Bench()
    bench.scene.put(Thing("ball", "sphere", (0.03,), 0.1, 0.5, (0.6, 0.0, 0.9, 0.0, 0.0, 0.0)))
    bench.scene.move("block", (0.5, 0.5, 0.9, 0.0, 0.0, 0.0))
    bench.run(0.3, width)
    before = {name: bench.scene.state(name) for name in bench.scene.names}
    assert before["block"].speed[2] < -2.0  # they fall
    with pytest.raises(RefusedError, match="the arm is where it should be"):
        bench.scene.put(Thing("block", "sphere", (0.2,), 5.0, 0.5, bench.place))
    assert {name: bench.scene.state(name) for name in bench.scene.names} == before
    bench.scene.put(Thing("block", "sphere", (0.02,), 0.1, 0.5, (0.5, 0.0, 1.5, 0.0, 0.0, 0.0)))
    assert bench.scene.state("block").pose == pytest.approx((0.5, 0.0, 1.5, 0.0, 0.0, 0.0))
    assert bench.scene.state("ball") == before["ball"]


# --- tools


def test_a_tool_of_a_file(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text('based_on = "robotiq-2f85"\nmass = 0.5\nstroke = 0.04\n')
    (tool,) = tools_by_name(str(path), ModelError)
    assert (tool.name, tool.mass, tool.stroke, tool.counts) == ("small", 0.5, 0.04, (3, 230))
    with pytest.raises(
        ModelError, match=r"unknown tool 'hand': choose one of none, robotiq-2f85, .* or give FILE"
    ):
        tools_by_name("hand", ModelError)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('based_on = "hand"', r"based_on: 'hand'; give one of robotiq-2f85"),
        ('based_on = "robotiq-2f85"\nmass = -1', "mass: -1; give a number from 0.001 to 100 kg"),
        ('based_on = "robotiq-2f85"\nforce = [9, 3]', "force: 9 is not below 3; give the smaller one first"),
        ('based_on = "robotiq-2f85"\nstroke = 0', "stroke: 0; give a number from 0.001 to 1 m"),
    ],
)
def test_a_wrong_file_of_a_tool_is_one_line(tmp_path, text, said):
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(ModelError, match=said):
        tools_by_name(str(path), ModelError)


# --- from outside, and from programs


@pytest.fixture(scope="module")
def box():
    with tool_box("robotiq-2f85") as box:
        yield box


@pytest.fixture
def client(box):
    with socket.create_connection((box.host, box.ports.gripper), timeout=10.0) as client:
        yield client


def until(client, **values):
    for name, value in values.items():
        while ask(client, f"GET {name}\n") != f"{name} {value}\n":
            pass


def activate(client):
    for words in ("ACT 0", "ATR 0"):
        assert ask(client, f"SET {words}\n") == "ack"
    until(client, ACT=0, STA=0)
    assert ask(client, "SET ACT 1\n") == "ack"
    until(client, ACT=1, STA=3)


def test_a_client_activates_calibrates_and_moves_it(client):
    """As the helper that ur_rtde has for Python."""
    assert ask(client, "GET SID") == "[9]"
    activate(client)
    for target, position in ((0, 3), (255, 230), (0, 3), (100, 100)):
        assert ask(client, f"SET POS {target} SPE 255 FOR 1 GTO 1\n") == "ack"
        until(client, PRE=target)
        while (objects := ask(client, "GET OBJ\n")) == "OBJ 0\n":
            pass
        assert objects == "OBJ 3\n"
        assert ask(client, "GET POS\n") == f"POS {position}\n"
    # Whoever asks for several at once reads once.
    assert ask(client, "GET STA\nGET OBJ\nGET SPE\n") == "STA 3\nOBJ 3\nSPE 255\n"
    assert ask(client, "GET SPEED\n") == "?\n"
    assert ask(client, "SET MUTE 0 TOOL 1\n") == "ack"
    assert ask(client, "SET POS 999\n") == "nak"
    assert ask(client, "SET SID 2\n") == "nak"  # a program would take it for connected
    assert ask(client, "GET POS\n") == "POS ?\n"


def test_a_program_reaches_it_at_its_usual_port(box):
    said = len(box.log)
    box.run_program(program_file("gripper_socket"), wait=True)
    texts = [entry.text for entry in box.log[said:] if entry.source == "Program"]
    assert [text for text in texts if text[:3] in ("sid", "ack", "mA ", "pre", "pos")] == [
        "sid [3,91,57,93,-1,-1]",
        "ack [3,97,99,107]",
        "mA 100",
        "pre [3,50,53,53]",
        "pos 230",
        "sid [2,91,93]",
    ]


def test_a_power_cut_leaves_the_grip_and_needs_a_new_activation(box, client):
    activate(client)
    box.run_program("movej(get_inverse_kin(p[0.5, 0.2, 0.15, 3.14159, 0, 0]), a=8, v=2)\n", wait=True)
    box.add_thing("block", "box", (0.04, 0.04, 0.04), 0.2, (0.5, 0.2, 0.0, 0.0, 0.0, 0.0))
    assert ask(client, "SET POS 255 FOR 100 GTO 1\n") == "ack"
    until(client, PRE=255, OBJ=2)
    box.run_program("movel(pose_add(get_actual_tcp_pose(), p[0, 0, 0.05, 0, 0, 0]), a=3, v=1)\n", wait=True)
    for cut, mend in ((box.power_off, None), (box.emergency_stop, box.release_emergency_stop)):
        cut()
        box.wait_until(robot_mode="POWER_OFF")
        until(client, POS="?")
        assert ask(client, "GET SID") == "[]"
        assert ask(client, "SET POS 0 GTO 1\n") == "ack"
        if mend is not None:
            mend()
        box.power_on()
        box.release_brakes()
        box.wait_until(robot_mode="RUNNING")
        assert ask(client, "GET STA\nGET ACT\nGET FLT\n") == "STA 0\nACT 0\nFLT 0\n"
        assert box.state.things[0].pose[2] > 0.04  # the brakes shake it a little
    box.remove_thing("block")


def leave(box, client):
    """Disconnect, and wait until the box knows it."""
    peer = "{}:{}".format(*client.getsockname())
    client.close()
    box.wait_until(log=f"{peer} disconnected")


STATUS_REQUEST = bytes.fromhex("09 04 07 D0 00 01 30 0F")


def test_the_serial_line_has_one_user_at_a_time(box, client):
    one, three = STATUS_REQUEST, bytes.fromhex("09 04 07 D0 00 03 B1 CE")
    with (
        socket.create_connection((box.host, box.ports.tool_line), timeout=10.0) as first,
        socket.create_connection((box.host, box.ports.tool_line), timeout=10.0) as second,
    ):
        # What is lost is never answered: the first answer is that to what is asked later.
        first.sendall(one)
        # The box accepts `first` in the turn of the first question at the latest, and reads it in the next.
        for _ in range(3):
            assert ask(client, "GET PCO\n") == "PCO 0\n"
        leave(box, client)
        second.sendall(one)
        first.sendall(three)
        assert first.recv(100)[:3] == bytes.fromhex("09 04 06")
        leave(box, first)
        second.sendall(three)
        assert second.recv(100)[:3] == bytes.fromhex("09 04 06")


@pytest.mark.parametrize("n_others", [0, 1])
def test_a_client_of_the_serial_line_may_leave_before_its_answer(n_others):
    bench, commands = ESeriesBench(version=(5, 25), tools=[HAND]), []
    bench.tick()  # the gripper has its supply
    bare = BareBox(E_SERIES.software(SoftwareVersion(5, 25)), bench.controller, commands)
    port = ToolLinePort(bare, [RobotiqPort(bare, [])])
    client = FakeConnection(port)
    others = [FakeConnection(port) for _ in range(n_others)]
    client.say(STATUS_REQUEST)
    client.close()
    asked = 0
    while commands:
        asked += 1
        taken, commands[:] = list(commands), []
        bare.steps.publish(bench.tick(1, *taken))
    assert asked == 2
    assert client.sent == []
    for other in others:
        other.say(STATUS_REQUEST)
        assert commands


def test_people_put_move_and_remove_things(box):
    box.add_thing("ball", "sphere", (0.03,), 0.1, (0.5, 0.5, 0.2, 0.0, 0.0, 0.0))
    (ball,) = box.state.things
    assert (ball.name, ball.touches_tool) == ("ball", False)
    box.move_thing("ball", (0.5, 0.4, 0.01, 0.0, 0.0, 0.0))
    assert box.state.things[0].pose[:2] == pytest.approx((0.5, 0.4), abs=1e-3)
    box.run_program("def p():\n  sleep(1.0)\nend", wait=True)
    (contact,) = box.state.contacts
    assert {contact.first, contact.second} == {"table", "ball"}
    assert contact.force[2] == pytest.approx(0.1 * 9.81, rel=0.05)
    with pytest.raises(RefusedError, match="there is no thing 'cube': there are ball"):
        box.move_thing("cube", (0.5, 0.4, 0.1, 0.0, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="a cylinder needs 2 numbers"):
        box.add_thing("can", "cylinder", (0.03,), 0.1, (0.5, 0.5, 0.2, 0.0, 0.0, 0.0))
    box.remove_thing("ball")
    assert box.state.things == ()
    assert box.state.grippers[0].keys() == {"SID", "width", "STA", "OBJ", "FLT"}


def test_an_exact_arm_moves_its_fingers_and_has_no_things():
    with tool_box("robotiq-hande", robot="ur3", fidelity="exact") as box:
        with pytest.raises(RefusedError, match="nothing acts on an arm of fidelity exact"):
            box.add_thing("ball", "sphere", (0.03,), 0.1, (0.5, 0.5, 0.2, 0.0, 0.0, 0.0))
        with socket.create_connection((box.host, box.ports.gripper), timeout=10.0) as client:
            box.run_program("set_tool_voltage(0)\n", wait=True)  # a cable comes from the control box
            assert ask(client, "SET ACT 1 POS 255 GTO 1\n") == "ack"
            while ask(client, "GET POS\n") != "POS 250\n":
                pass
        assert box.ports.tool_line == 0  # a CB3 arm has no such line


# --- a cup


@pytest.mark.parametrize(
    ("mass", "carried"), [(0.5, "True"), pytest.param(8.0, "False", marks=pytest.mark.nightly)]
)
def test_a_cup_lifts_what_it_can_hold_and_reports_its_vacuum(mass, carried):
    with tool_box("vacuum") as box:
        box.add_thing("plate", "box", (0.1, 0.1, 0.04), mass, (0.5, 0.2, 0.0, 0.0, 0.0, 0.0))
        box.run_program(program_file("gripper_cup"), wait=True)
        texts = [entry.text for entry in box.log if entry.source == "Program"]
        assert texts[1:4] == ["in the air False", f"carried {carried}", "let go False"]
        assert box.state.things[0].pose[2] < 0.01
        assert box.ports.gripper == 0


def test_two_grippers_on_a_flange_are_reached_by_their_numbers():
    with (
        tool_box("robotiq-2f85,robotiq-hande") as box,
        socket.create_connection((box.host, box.ports.gripper), timeout=10.0) as first,
        socket.create_connection((box.host, box.ports.gripper), timeout=10.0) as second,
    ):
        assert ask(first, "GET SID") == "[9, 2]"
        assert ask(second, "SET SID 2\n") == "ack"
        assert ask(second, "SET ACT 1 POS 255 GTO 1\n") == "ack"
        while ask(second, "GET POS\n") != "POS 250\n":
            pass
        assert ask(first, "GET STA\n") == "STA 0\n"
        assert [gripper["SID"] for gripper in box.state.grippers] == [9, 2]


# --- a scene

EXAMPLE = Path(__file__).parents[2] / "examples" / "scene.toml"
IN_THE_WAY = "the arm is where something should stand"
MJCF = """<mujoco>
  <worldbody>
    <geom name="shelf" type="box" size="0.1 0.1 0.05" pos="0.5 0.3 0.03"/>
    <body name="mug" pos="0.5 0.3 0.2"><freejoint/><geom type="cylinder" size="0.03 0.05" mass="0.2"/></body>
    <body name="door" pos="0 0.8 0.3"><joint type="hinge" axis="0 0 1"/><geom type="box" size="0.2 0.01 0.2"/></body>
  </worldbody>
</mujoco>"""


def furnished(scene):
    robot = robot_by_name("ur5e")
    plant = Plant(robot, robot.generation.fidelity("typical"), 7)
    plant.furnish(scene)
    home = JointTarget(robot.home_q, (0.0,) * 6, (0.0,) * 6)
    for _ in range(500):
        plant.step(home)
        plant.sense()
    return plant


def test_a_cell_file_is_the_scene_of_a_box_and_the_surroundings_of_a_plan():
    plant = furnished(load_scene(EXAMPLE))
    assert plant.physics.scene.names == ("block", "can")
    assert plant.physics.scene.state("block").pose[2] == pytest.approx(0.0, abs=1e-3)  # on the floor
    assert plant.physics.scene.state("can").pose[2] == pytest.approx(0.13, abs=1e-3)  # on the shelf
    assert [solid.name for solid in load_scene(EXAMPLE).solids] == ["shelf"]


def test_a_fragment_of_mjcf_is_a_scene(tmp_path):
    path = tmp_path / "kitchen.xml"
    path.write_text(MJCF)
    plant = furnished(load_scene(path))
    assert plant.physics.scene.names == ("mug",)
    assert plant.physics.scene.state("mug").pose[2] == pytest.approx(0.13, abs=1e-3)
    plant.physics.scene.remove("thing", "mug")
    plant.physics.scene.put(Thing("mug", "sphere", (0.03,), 0.1, 0.5, (0.5, -0.3, 0.2, 0.0, 0.0, 0.0)))
    assert plant.physics.scene.names == ("mug",)


@pytest.mark.parametrize(
    ("name", "text", "error", "said"),
    [
        ("a.xml", "<mujoco><worldbody><geom/></worldbody></mujoco>", ModelError, "a.xml: .*; give a file of MJCF"),
        ("a.xml", MJCF.replace("</mujoco>", '<actuator><motor joint="hinge"/></actuator></mujoco>'), ModelError,
         "a.xml: a scene has no actuators"),
        ("b.xml", MJCF.replace("box", "file"), ModelError, "b.xml: .*; give a file of MJCF"),
        ("a.json", "{}", ModelError, "a.json: give a cell file"),
        ("a.toml", "format = 2", ModelError, "a.toml: format: 2; give 1"),
        ("full.xml", '<mujoco><worldbody><geom type="box" size="1 1 1"/></worldbody></mujoco>', RefusedError, IN_THE_WAY),
        ("high.toml", 'format = 1\nname = "high"\n[floor]\nz = 0.5', RefusedError, IN_THE_WAY),
        ("wall.toml", 'format = 1\nname = "wall"\n[[walls]]\nname = "near"\nx_max = 0.1', RefusedError, IN_THE_WAY),
    ],
)  # fmt: skip
def test_a_scene_that_makes_no_sense_or_stands_where_the_arm_is_is_one_line(
    tmp_path, name, text, error, said
):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(error, match=said):
        furnished(load_scene(path))
