"""The gripper of the package onrobot, and a box at the address that is fixed in the package.

    python onrobot_rg2.py 192.168.0.99

prints what the calls return, as JSON by name. It runs in a network in which the machine has that address.
"""

import json
import sys

from gripper_support import block_between_pads, move_to_place
from onRobot.gripper import RG2

from ur_emulator import ControlBox
from ur_emulator.machine.tools.onrobot import STATUS
from ur_hil.tools import TOOLS

TOOL = TOOLS["onrobot-rg2"]
BUSY = 1 << STATUS.index("busy")


def results(box):
    """Give names, and what the calls have returned."""
    gripper, other = RG2(), RG2(1)

    def status():
        return box.state.grippers[0]["status"]

    def grip(*arguments):
        """Return what the call returns, then width and status at its end: the client does not know the latter."""
        is_taken = gripper.rg_grip(*arguments)
        while status() & BUSY:
            pass
        return is_taken, gripper.get_rg_width(), status()

    yield "at first", gripper.get_rg_width()
    yield "by default", grip()
    with block_between_pads(box):
        yield "on a block", grip(20.5, 40.0)
        yield "too much", grip(300.0, 99.0)
    yield "whole numbers", grip(60, 20)
    yield "less than nothing", grip(-5.0, -1.0)
    yield "of another place", (other.rg_grip(20.0, 20.0), other.get_rg_width())
    box.run_program("set_tool_voltage(0)\nsleep(0.1)\n", wait=True)
    yield "without power", (gripper.rg_grip(20.0, 20.0), gripper.get_rg_width(), status())
    box.run_program("set_tool_voltage(24)\nsleep(0.1)\n", wait=True)
    yield "with power again", grip(50.0)


if __name__ == "__main__":
    with ControlBox("ur5e", host=sys.argv[1], pace="lockstep", seed=7, tool=TOOL.name) as box:
        move_to_place(box, TOOL)
        print(json.dumps(dict(results(box))))
