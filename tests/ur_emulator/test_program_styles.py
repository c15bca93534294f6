"""Programs in the styles that are sent to robots run to their outcome: exports of PolyScope, driver scripts, grippers, lines."""

import re
import struct

import numpy as np
import pytest
from driver_program import (
    COMMANDS,
    CONSTANTS,
    FIRST_SMALL,
    PROGRAMS,
    SMALL_COMMANDS,
    driver_text,
    small_command,
)
from program_support import Box, frames

from ur_emulator.machine.commands.client_writes import WriteInputs
from ur_emulator.machine.commands.programs import AnswerRequest, ClosePopup
from urscript.check.checking import check_program

ABOVE = [-0.462, -1.757, -1.667, -1.289, 1.57, -0.462]


EXAMPLES = PROGRAMS.parent.parent / "examples" / "scripts"


def program(name):
    path = PROGRAMS / name
    return (path if path.exists() else EXAMPLES / name).read_bytes()


def events(box, kind):
    return [event for event in box.events if type(event).__name__ == kind]


def assert_clean(box):
    assert box.compile_errors == []
    assert box.failures == []
    assert box.reports == []


def tool_path(box):
    return np.array([snapshot.target_tcp_pose[:3] for snapshot in box.snapshots])


def nearest(box, x, y, z):
    return np.linalg.norm(tool_path(box) - (x, y, z), axis=1).min()


@pytest.mark.parametrize(
    "path", sorted([*PROGRAMS.glob("*.script"), *EXAMPLES.glob("*.script")]), ids=lambda path: path.stem
)
def test_every_program_checks_without_an_error(path):
    errors, _ = check_program(path.read_bytes().decode("latin-1"), name=path.name)
    assert errors == ()


# --- PolyScope ---------------------------------------------------------------------------------------------


class Operator:
    """Answers questions and popups as they come."""

    def __init__(self, box, answer):
        self.box, self.answer = box, answer
        self.seen = 0

    def work(self):
        for event in self.box.events[self.seen :]:
            if type(event).__name__ == "ValueRequested":
                self.box.tick(1, AnswerRequest(self.answer))
            elif type(event).__name__ == "PopupShown" and event.blocking:
                self.box.tick(1, ClosePopup())
        self.seen = len(self.box.events)


def test_an_export_with_threads_labels_and_an_endless_loop_sorts_its_parts():
    box = Box()
    io = box.controller.state.io
    box.send(b"movej([-0.462,-1.757,-1.667,-1.289,1.57,-0.462],a=8,v=3)\n")
    box.finish()
    box.send(program("polyscope_sorting_cell.script"))
    operator = Operator(box, 2)
    box.run_until(lambda box: operator.work() or box.controller.state.motion.is_moving)
    assert not io.digital_out & 2, "the lamp is off while it waits"
    assert io.digital_out & 8, "high while the program runs"
    box.run_until(lambda box: operator.work() or not box.controller.state.motion.is_moving)
    io.digital_in |= 0b11  # a part, and it is good
    box.run_until(lambda box: operator.work() or box.texts)
    assert box.texts == ["gut: 1, Ausschuss: 0"]
    io.digital_in &= ~0b10
    box.run_until(lambda box: operator.work() or not box.controller.programs.has_work)
    box.finish()
    assert box.texts == ["gut: 1, Ausschuss: 0", "gut: 1, Ausschuss: 1"]
    assert [event.text for event in events(box, "PopupShown")] == ["Alle Teile sind sortiert."]
    assert_clean(box)
    assert nearest(box, 0.28, -0.28, 0.12) < 1e-6, "taken"
    assert nearest(box, 0.30, -0.15, 0.12) < 1e-6, "laid down"
    assert nearest(box, 0.28, -0.28, 0.20) > 1e-3, "blended above"
    assert not io.digital_out & 8, "low when it has ended"
    assert box.controller.state.tool.tcp_offset == (0.0, 0.0, 0.05, 0.0, 0.0, 0.0)
    assert box.now.target_qd == (0.0,) * 6


def test_an_export_of_the_3_3_era_fills_its_pallet():
    box = Box()
    box.controller.state.io.digital_in |= 0b100
    box.send(program("polyscope_33_pallet.script"))
    box.finish()
    assert_clean(box)
    floats = box.now.registers.output_floats
    assert floats[1:7] == pytest.approx([0.22] * 3 + [0.30] * 3, abs=1e-6)
    assert floats[11:17] == pytest.approx([-0.30, -0.25, -0.20] * 2, abs=1e-6)
    assert box.now.registers.output_integers[0] == 6
    assert box.now.target_q == pytest.approx(ABOVE)
    assert [event.text for event in events(box, "PopupShown")] == ["pallet full"]
    assert box.controller.state.io.digital_out >> 16 & 1, "the event thread saw the input"


@pytest.mark.nightly
def test_the_pallet_of_the_examples_gets_full():
    box = Box()
    box.send(program("pallet.script"))
    texts = box.finish()
    assert_clean(box)
    assert len(texts) == 13
    assert texts[0] == "placed 1 at p[0.2, -0.3, 0.1, 2.221, -2.221, 0]"
    assert texts[8] == "placed 9 at p[0.2, -0.2, 0.13, 2.221, -2.221, 0]"
    for x in (0.20, 0.30):
        for y in (-0.30, -0.25, -0.20):
            for z in (0.10, 0.13):
                assert nearest(box, x, y, z) < 1e-6


# --- drivers -----------------------------------------------------------------------------------------------


class Driver:
    """The client of the driver script: commands by registers, points by socket."""

    def __init__(self, points=()):
        self.box = Box(peers={50003: frames(*points)})
        self.box.send(f"movej({ABOVE}, a=8, v=3)\n".encode())
        self.box.finish()
        self.number = 0
        self.box.send(driver_text().encode())
        self.box.run_until(lambda box: box.now.registers.output_integers[0] == CONSTANTS["STATE_READY"])

    def write(self, **values):
        inputs = tuple((f"input_{name}", value) for name, value in values.items())
        self.box.tick(1, WriteInputs(inputs))

    def command(self, name, *floats, kind=0, kind2=0):
        number = COMMANDS.get(name, name)
        self.number += 1
        doubles = {f"double_register_{index}": value for index, value in enumerate(floats)}
        self.write(**doubles, int_register_0=number, int_register_2=kind, int_register_3=kind2)
        self.write(int_register_1=self.number)
        self.box.run_until(lambda box: box.now.registers.output_integers[1] == self.number, limit=2000)
        return self.box.now

    def rest(self):
        self.box.run_until(lambda box: not self.command("BUSY").registers.output_integers[2])
        return self.box.now


def test_a_driver_script_of_1400_lines_moves_servos_and_streams():
    driver = Driver()
    assert driver_text().count("\n") > 1200
    goal = [-0.4, -1.7, -1.6, -1.2, 1.5, -0.3]
    driver.command("MOVE", *goal, 2.0, 1.0, 0.0, 0.0)
    assert driver.rest().target_q == pytest.approx(goal)
    above = (0.25, -0.25, 0.25, 2.221, -2.221, 0.0)
    driver.command("MOVE", *above, 1.2, 0.3, kind=CONSTANTS["KIND_LINE"])
    assert driver.rest().target_tcp_pose[:3] == pytest.approx(above[:3], abs=1e-6)

    start = driver.box.now.target_q
    for step in range(1, 101):
        driver.command("SERVO", *(q + 0.002 * step for q in start))
    assert driver.box.now.target_q == pytest.approx([q + 0.2 for q in start], abs=0.05)
    driver.command("STOP")
    assert driver.box.now.target_qd == pytest.approx((0.0,) * 6, abs=1e-9)

    driver.command("SPEED", 0.1, 0, 0, 0, 0, -0.2, 0.0)
    driver.box.tick(100)
    assert driver.box.now.target_qd == pytest.approx((0.1, 0, 0, 0, 0, -0.2), abs=1e-9)
    driver.command("STOP")
    driver.command("SPEED", 0, 0, 0.05, 0, 0, 0, 0.0, kind=1)
    driver.box.tick(60)
    assert driver.box.now.target_tcp_speed[:3] == pytest.approx((0, 0, 0.05), abs=1e-6)
    driver.command("END")
    texts = driver.box.finish()
    assert texts[0] == "driver starts, step: 0.008"
    assert texts[-1].startswith("driver ends, missed: ")
    assert_clean(driver.box)


def test_a_driver_script_follows_points_that_a_socket_brings():
    first, second = [-0.4, -1.7, -1.6, -1.2, 1.5, -0.4], [-0.3, -1.6, -1.5, -1.1, 1.6, -0.3]

    def point(kind, q, qd=(0,) * 6, milliseconds=0):
        return struct.pack(">14i", *(round(1e6 * x) for x in (*q, *qd)), milliseconds, kind)

    driver = Driver([point(0, first), point(1, second, [0.1] * 6, 800), point(1, first, milliseconds=1200)])
    driver.command("PATH", kind=3)
    driver.box.run_until(lambda box: "spline comes to rest" in box.texts)
    assert driver.rest().target_q == pytest.approx(first, abs=2e-3)
    passed = min(np.abs(np.subtract(s.target_q, second)).max() for s in driver.box.snapshots)
    assert passed < 5e-3
    assert driver.box.network.sent_to(50003) == struct.pack(">i", CONSTANTS["RESULT_DONE"])
    assert_clean(driver.box)


def test_a_driver_script_dispatches_all_its_commands():
    driver = Driver()
    for number in range(FIRST_SMALL, FIRST_SMALL + SMALL_COMMANDS):
        now = driver.command(number, 2.5, 0.75)
        assert now.registers.output_floats[0] == pytest.approx(small_command(number)(2.5, 0.75))
    driver.command("OUTPUTS", kind=0b10101, kind2=0b00101)
    assert driver.box.controller.state.io.digital_out & 0xFF == 0b101
    pose = driver.command("FORWARD", *ABOVE).registers.output_floats[:6]
    assert driver.command("INVERSE", *pose).registers.output_floats[:6] == pytest.approx(ABOVE, abs=1e-6)
    assert driver.command(199).registers.output_integers[0] == CONSTANTS["STATE_REFUSED"]
    assert driver.box.texts[-1] == "unknown command 199"
    assert_clean(driver.box)


# --- grippers, cameras ---------------------------------------------------------------------------------------


class Gripper:
    """Answers SET with "ack" and GET with its variables; takes some rounds to become active and to move."""

    def __init__(self):
        self.variables = {"ACT": 0, "GTO": 0, "POS": 0, "OBJ": 3, "STA": 0}
        self.sets = []
        self._rounds = 0

    def __call__(self, unread):
        used = said = b""
        while (match := re.match(rb"(SET (\w+) (\d+) ?|GET (\w+))\n", unread[len(used) :])) is not None:
            used += match[0]
            said += self._set(match) if match[2] else self._get(match[4].decode())
        return len(used), said

    def _set(self, match):
        name, value = match[2].decode(), int(match[3])
        self.sets.append((name, value))
        self.variables[name] = value
        if name in ("ACT", "GTO"):
            self._rounds = 3
        return b"ack"

    def _get(self, name):
        if name == "VER":
            return b"VER 1.2-beta!"
        self._rounds -= 1
        moving = self._rounds > 0
        if name == "STA":
            return f"STA {0 if moving else 3}\n".encode()
        if name == "OBJ":
            done = 2 if self.variables["POS"] > 100 else 3
            return f"OBJ {0 if moving else done}\n".encode()
        return f"{name} {self.variables[name]}\n".encode()


def test_a_gripper_preamble_talks_to_its_server():
    gripper = Gripper()
    box = Box(peers={63352: gripper})
    box.send(program("gripper_preamble.script"))
    texts = box.finish()
    assert texts == ["open: 3", "close: 2", "position: 255", "version: 1.2-beta", "after close: 0"]
    assert gripper.sets == [
        ("ACT", 0), ("ACT", 1), ("POS", 0), ("GTO", 1), ("POS", 255), ("GTO", 1),
    ]  # fmt: skip
    assert_clean(box)
    assert not any(sock.is_open for sock in box.network.sockets)


def test_a_gripper_preamble_says_when_nobody_answers():
    box = Box()
    box.send(program("gripper_preamble.script"))
    box.run_until(lambda box: events(box, "PopupShown"))
    (popup,) = events(box, "PopupShown")
    assert (popup.text, popup.title) == ("the gripper does not answer", "No connection")
    assert (popup.warning, popup.error, popup.blocking) == (False, True, True)
    assert box.controller.waits_outside
    box.tick(1, ClosePopup())
    box.finish()
    assert_clean(box)


class Camera:
    """Sees two parts, one of them out of reach, with a blind moment between."""

    def __init__(self):
        self.asked, self.reports = [], []
        self._seen = [[1.0, 0.03, 0.02, 0.3], [0.0] * 4, [1.0, 0.6, 0.6, 0.0], [1.0, -0.02, 0.01, 0.0]]

    def name(self):
        return "lens ä"

    def find_part(self, number, pose):
        self.asked.append(sorted(pose))
        return self._seen.pop(0) if self._seen else [0.0] * 4

    def report(self, *what):
        self.reports.append(what)
        return True


def test_a_vision_program_picks_what_the_camera_sees():
    camera = Camera()
    box = Box(servers={"http://192.168.0.20:8080/RPC2": camera})
    box.send(f"movej({ABOVE}, a=8, v=3)\n".encode())
    box.finish()
    box.send(program("vision_pick.script"))
    texts = box.finish()
    assert texts[0].encode("latin-1").decode() == "camera lens ä"
    assert texts[1].startswith("out of reach: p[0.85,0.35,0.15")
    assert texts[2:] == ["picked 2"]
    assert [report[0] for report in camera.reports] == [1, 2]
    assert camera.reports[0][1] == pytest.approx([0.28, -0.23])
    assert camera.asked[0] == ["rx", "ry", "rz", "x", "y", "z"]
    assert len(camera.asked) == 7
    assert_clean(box)
    assert nearest(box, 0.28, -0.23, 0.15) < 1e-6


def test_the_force_program_of_the_examples_presses_on_the_table():
    box = Box(fidelity="typical")
    box.send(program("press_on_table.script"))
    assert box.finish() == ["contact: True", "pressed: True"]
    assert_clean(box)
    lowest = tool_path(box)[:, 2].min()
    assert -0.03 < lowest < -0.018, "the table lies 20 mm below the base"
    assert box.now.target_tcp_pose[:3] == pytest.approx((0.25, -0.25, 0.06), abs=1e-6)


# --- lines -------------------------------------------------------------------------------------------------

SPELLINGS = {
    "unix": b"def myProg():\n  movej(%s, a=4, v=2)\n  textmsg(\"there\")\nend\n",
    "windows": b"def myProg():\r\n\tmovej(%s, a=4, v=2)\r\n\ttextmsg(\"there\")\r\nend\r\n",
    "column 1": b"def myProg():\nmovej(%s, a=4, v=2)\ntextmsg(\"there\")\nend\n",
    "one line": b"def myProg(): movej(%s, a=4, v=2) textmsg(\"there\") end\n",
    "mixed": b" \n# before\ndef myProg (  )  :\n \t movej( # now\n\n%s,\n a\t=4 ,v=\n2)\n\t\ttextmsg(\"there\")# said\n \n end\n",
    "blank lines": b"\n\n\ndef myProg():\n\n\n movej(%s, a=4, v=2)\n\n textmsg(\"there\")\n\nend\n\n\n",
    "called after": b"def myProg():\n movej(%s, a=4, v=2)\n textmsg(\"there\")\nend\nmyProg()\n",
}  # fmt: skip


@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize("size", [1, 10_000])
def test_a_short_program_runs_however_it_is_laid_out_and_cut(spelling, size):
    goal = [0.1, -1.5, -0.2, -1.6, 0.1, 0.2]
    data = SPELLINGS[spelling] % str(goal).encode()
    box = Box()
    for start in range(0, len(data), size):
        box.send(data[start : start + size])
    assert box.finish() == ["there"]
    assert box.now.target_q == pytest.approx(goal)
    assert box.failures == []
    wrong = [error.wire_text for error in box.compile_errors]
    assert wrong == (["compile_error_name_not_found:myProg:"] if spelling == "called after" else [])


def test_text_beyond_ascii_goes_through_as_its_bytes():
    box = Box()
    box.send('def u():\n  $ 1 "Größe≔3"\n  x = "µ→°"  # ±\n  textmsg(x, str_len(x))\nend\n'.encode())
    (text,) = box.finish()
    assert text.encode("latin-1").decode() == "µ→°7"
    assert_clean(box)


def test_lines_that_replace_each_other_give_one_steady_motion():
    box = Box()
    for _ in range(60):
        box.send(b"speedj([0.2,0,0,0,0,0.1], 2.0, 0.008)\n")
    assert box.now.target_qd == pytest.approx((0.2, 0, 0, 0, 0, 0.1))
    slowest = min(s.target_qd[0] for s in box.snapshots[30:])
    assert slowest == pytest.approx(0.2)
    box.send(b"stopj(4)\n")
    box.finish()
    assert box.now.target_qd == (0.0,) * 6
    assert_clean(box)
