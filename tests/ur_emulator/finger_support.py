"""Grippers whose fingers move as they are driven, boxes with tools, and a client's question."""

from pathlib import Path

from ur_emulator import ControlBox
from ur_emulator.machine.controller.io.lines import InputOutput
from ur_emulator.machine.plant.hand import FingerState

PERIOD = 0.008


class DrivenFingers:
    """A gripper whose fingers move as they are driven; `block` is in their way [m]."""

    def __init__(self, gripper, width):
        self.gripper, self.width, self.block = gripper, width, 0.0
        self.has_power, self.io = True, InputOutput()
        self._speed = self._share = 0.0

    def run(self, seconds):
        for _ in range(round(seconds / PERIOD)):
            state = FingerState(self.width, self._speed, self._share)
            command = self.gripper.step(state, self.has_power, self.io)
            self._speed = self._share = 0.0
            if command is not None:
                most = command.speed * PERIOD
                wanted = self.width + max(-most, min(most, command.width - self.width))
                stopped = max(wanted, min(self.block, self.width))
                self._speed, self._share = (stopped - self.width) / PERIOD, -float(stopped > wanted)
                self.width = stopped


def tool_box(tool, robot="ur5e", **options):
    """A box in this process, in lockstep, with tools."""
    return ControlBox(robot, in_process=True, pace="lockstep", port_base=None, seed=7, tool=tool, **options)


def program_file(name):
    """The text of a program of `tests/programs`."""
    return (Path(__file__).parents[1] / "programs" / f"{name}.script").read_text()


def ask(client, text):
    client.sendall(text.encode())
    return client.recv(1000).decode()
