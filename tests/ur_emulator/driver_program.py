"""A control script of the size that drivers upload: `driver_control.template` with its generated parts filled in.

Generated are the constants, a hundred small commands, each a function that is called before it is defined,
and their arms in the command switch.
"""

from pathlib import Path

PROGRAMS = Path(__file__).parent.parent / "programs"

CONSTANTS = {
    "MULT": 1000000,
    "STOP_ACCELERATION": 8.0,
    "SPEED_ACCELERATION": 3.0,
    "MAX_LOG_LINES": 50,
    "POINT_SIZE": 14,
    "POINT_MOVE": 0,
    "POINT_SPLINE": 1,
    "RESULT_DONE": 0,
    "RESULT_CANCELLED": 1,
    "RESULT_FAILED": 2,
    "REG_COMMAND": 0,
    "REG_SEQUENCE": 1,
    "REG_KIND": 2,
    "REG_STATE": 0,
    "REG_DONE": 1,
    "REG_BUSY": 2,
    "REG_PATH_RESULT": 3,
    "STATE_READY": 1,
    "STATE_BUSY": 2,
    "STATE_REFUSED": -1,
    "KIND_JOINT": 0,
    "KIND_POSE": 1,
    "KIND_LINE": 2,
    "KIND_LINE_JOINT": 3,
    "KIND_PROCESS": 4,
}
COMMANDS = {
    "NOTHING": 0,
    "MOVE": 1,
    "SERVO": 2,
    "SPEED": 3,
    "STOP": 4,
    "PATH": 5,
    "OUTPUTS": 6,
    "FORWARD": 7,
    "INVERSE": 8,
    "BUSY": 9,
    "END": 255,
}
FIRST_SMALL = 20
SMALL_COMMANDS = 100


def small_command(number):
    """What command `number` does with its two parameters: the same sum here and in the script."""
    return lambda a, b: round(a * (number % 7 + 1) - b / (number % 3 + 1), 9)


def _function(number):
    times, over = number % 7 + 1, number % 3 + 1
    return f"""
    # command {number}: a product "less" a share (of b)
    def small_{number}(a, b = {number}):
        if a > {1000 + number} or b > {1000 + number}:
            return 0
        end
        return a * {times} - b / {over}
    end
"""


def _arm(number):
    return f"        elif command == CMD_SMALL_{number}:\n            float_out(0, small_{number}(float_in(0), b=float_in(1)))\n"


def driver_text(small_commands=SMALL_COMMANDS):
    """The whole script; more than 1,200 lines with all its small commands."""
    numbers = range(FIRST_SMALL, FIRST_SMALL + small_commands)
    names = CONSTANTS | {f"CMD_{name}": number for name, number in COMMANDS.items()}
    names |= {f"CMD_SMALL_{number}": number for number in numbers}
    text = (PROGRAMS / "driver_control.template").read_text()
    parts = {
        "    #%CONSTANTS%\n": "".join(f"    {name} = {value}\n" for name, value in names.items()),
        "    #%FUNCTIONS%\n": "".join(map(_function, numbers)),
        "    #%ARMS%\n": "".join(map(_arm, numbers)),
    }
    for mark, part in parts.items():
        assert mark in text
        text = text.replace(mark, part)
    return text
