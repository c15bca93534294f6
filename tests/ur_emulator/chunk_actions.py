"""What a chunk can do to the box: the actions of its `#do` and `#at` marks.

in 3 high             a digital input: 0-7 standard, c0-c7 configurable, t0-t1 tool
analog in 0 0.5       an analogue input at a part of its range; `analog tool 1 0.5`
euromap 4 high        a signal of the moulding machine
write NAME VALUE      an RTDE input by its name
interpret LINE        a line for interpreter mode; `interpret skipbuffer` and `interpret abort` act at once
send "text"           the peer of the program's last socket sends
bytes 0 0 0 3         the same with bytes
hang up               that peer closes
run PROGRAM           start a one-line program, primary or `sec`
stop / unlock / power_off / close_popup / protective_stop / pause / resume
answer 5              to the oldest question of that type
slider 0.5            the speed slider
push 0 0 -20          push the flange, base axes, N; with three more numbers at a point in flange axes, m; zeros end it
SafeguardStop True    any command by its name, with its arguments
"""

import shlex
from ast import literal_eval

from ur_emulator.machine.commands import power, programs, safety, surroundings
from ur_emulator.machine.commands.client_writes import WriteInputs
from ur_emulator.machine.commands.power import PowerOff
from ur_emulator.machine.commands.programs import (
    AbortMove,
    AnswerRequest,
    AppendStatements,
    ClosePopup,
    PauseProgram,
    ResumeProgram,
    SetSpeedSlider,
    SkipStatements,
    StartProgram,
    StopProgram,
)
from ur_emulator.machine.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.machine.controller.io.lines import CONFIGURABLE, TOOL
from ur_emulator.program_files.compiling import compile_line
from urscript import compile_program

_COMMANDS = {**vars(power), **vars(programs), **vars(safety), **vars(surroundings)}
_SHIFTS = {"c": CONFIGURABLE.first, "t": TOOL.first}
_WORDS = {"skipbuffer": SkipStatements, "abort": AbortMove}
_PLAIN = {
    "stop": StopProgram,
    "unlock": UnlockProtectiveStop,
    "power_off": PowerOff,
    "close_popup": ClosePopup,
    "protective_stop": TriggerProtectiveStop,
    "pause": PauseProgram,
    "resume": ResumeProgram,
}


def act(bench, catalogue, action):
    """Do one action; returns the commands that the next cycle must get."""
    word, _, rest = action.partition(" ")
    state = bench.controller.state
    match word:
        case "in":
            _switch_input(state.io, *rest.split())
        case "analog":
            lines, index, ratio = rest.split()
            getattr(state.io, {"in": "analog_in", "tool": "tool_analog_in"}[lines])[int(index)].set_ratio(
                float(ratio)
            )
        case "euromap":
            index, level = rest.split()
            mask = 1 << int(index)
            state.io.euromap_inputs = state.io.euromap_inputs & ~mask | mask * (level == "high")
        case "write":
            name, value = rest.split(" ", 1)
            return [WriteInputs(((name, literal_eval(value)),))]
        case "interpret" if rest in _WORDS:
            return [_WORDS[rest]()]
        case "interpret":
            bench.n_interpreted = number = getattr(bench, "n_interpreted", 0) + 1
            queue = state.interpreter
            made = compile_line(rest, number, queue.scope, queue.added, catalogue)
            return [AppendStatements(made, queue.epoch)]
        case "send":
            index, text = rest.split(" ", 1) if rest[0].isdigit() else ("-1", rest)
            bench.network.sockets[int(index)].receive(literal_eval(text).encode("latin-1"))
        case "bytes":
            bench.network.sockets[-1].receive(bytes(map(int, rest.split())))
        case "hang":
            bench.network.sockets[-1].close()
        case "modbus" if rest.startswith("lost"):
            bench.network.modbus_trouble = rest.removeprefix("lost ")
        case "modbus" if rest == "back":
            bench.network.modbus_trouble = ""
        case "modbus":
            kind, address, value = map(int, rest.split())
            bench.network.modbus_memory[kind, address] = value
        case "run":
            return [StartProgram(compile_program(rest, catalogue=catalogue))]
        case "answer":
            return [AnswerRequest(literal_eval(rest))]
        case "slider":
            return [SetSpeedSlider(float(rest))]
        case "push":
            force, point = (numbers := [float(x) for x in rest.split()])[:3], numbers[3:]
            bench.controller.plant.push(force, *([point] if point else []))
        case _ if word in _COMMANDS:
            return [_COMMANDS[word](*map(_argument, shlex.split(rest)))]
        case _:
            assert action in _PLAIN, f"there is no action {action!r}"
            return [_PLAIN[action]()]
    return []


def _argument(text):
    try:
        return literal_eval(text)
    except (ValueError, SyntaxError):
        return text


def _switch_input(io, line, level):
    shift = _SHIFTS.get(line[0], 0)
    mask = 1 << shift + int(line.lstrip("ct"))
    assert level in ("high", "low")
    io.digital_in = io.digital_in & ~mask | (mask if level == "high" else 0)
