"""Every builtin with odd arguments: the box answers with a result or a run-time error, and lives on."""

import math
from functools import cache

import pytest
from chunk_bench import ChunkBench
from chunk_marks import BoxChunk

from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator.machine.commands.power import ReleaseBrakes
from ur_emulator.machine.commands.programs import StartProgram, StopProgram
from ur_emulator.machine.commands.safety import UnlockProtectiveStop
from urscript import compile_program
from urscript.builtins import PURE
from urscript.catalogue import CB3_3_15
from urscript.catalogue.calls import converted, fits
from urscript.catalogue.types import ParamType
from urscript.recording_host import RecordingHost

POSE = "p[0.3, 0.1, 0.25, 0, 3, 0]"
JOINTS = "[0.4, -1.7, -2.0, -0.1, 1.3, 1.9]"
# An argument that fits, by type, beside lists; integers are written as floats, which the language lets through.
USUAL = {
    **dict.fromkeys((ParamType.ANY, ParamType.INT, ParamType.NUMBER, ParamType.STRING_OR_INT), "1.0"),
    **dict.fromkeys((ParamType.POSE, ParamType.POSE_OR_MATRIX), POSE),
    **dict.fromkeys((ParamType.JOINTS, ParamType.POSE_OR_JOINTS), JOINTS),
    **dict.fromkeys((ParamType.BOOLS, ParamType.BOOL_OR_BOOLS), "[True, False]"),
    **dict.fromkeys((ParamType.MATRIX, ParamType.SHAPED, ParamType.LIST_OR_MATRIX), "[[1, 2], [3, 5]]"),
    ParamType.BOOL: "True",
    ParamType.STRING: '"a"',
    ParamType.VECTOR3: "[0.0, 0.1, 0.2]",
    ParamType.VECTOR6: "[0.01, 0, 0, 0, 0, 0.01]",
}
HUGE, NAN, INF = "1.0E308", 'to_num("nan")', 'to_num("inf")'
SIX_HUGE, SIX_LARGE = ", ".join([HUGE] * 6), ", ".join(["9.0E14", "-9.0E14"] * 3)
# Arguments that nobody should give; each goes to the parameters whose type it has.
ODD = (
    *("0", "-1", "-2147483648", HUGE, "-" + HUGE, "9.0E14", "1.0E-300", NAN, INF),
    "[0, 0, 0, 0, 0, 0]",
    f"[{HUGE}, {HUGE}, {HUGE}]",
    f"[{SIX_HUGE}]",
    f"[{SIX_LARGE}]",
    f"p[{SIX_LARGE}]",
    f"[{NAN}, 0, 0, 0, 0, 0]",
    "p[0, 0, 0, 0, 0, 0]",
    f"p[{SIX_HUGE}]",
    f"p[{INF}, 0, 0, 0, 0, 0]",
    '"' + "x" * 2000 + '"',
    *('""', "[]", "None", "True"),
)
CYCLES = 3
ROWS = [row for row in CB3_3_15 if row.name not in PURE and row.params]


def usual(param):
    if param.choices:
        choice = param.choices[0]
        return f'"{choice}"' if isinstance(choice, str) else f"{float(choice)}"
    if param.type in (ParamType.INT, ParamType.NUMBER) and param.low is not None:
        return f"{float(param.low)}"
    return USUAL.get(param.type, "[1.0, 2]")


@cache
def value_of(text):
    return RecordingHost().run(compile_program(f"x = {text}\n")).read_global("x")


def calls(row):
    """The usual call, each with one odd argument, and one that does not fit: a check in front refuses those."""
    arguments = [usual(param) for param in row.params]
    yield arguments
    for i, param in enumerate(row.params):
        for other in ODD:
            if fits(param.type, converted(param.type, value_of(other))):
                yield [*arguments[:i], other, *arguments[i + 1 :]]
    yield ["[None]", *arguments[1:]]


@pytest.mark.nightly
@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_odd_arguments_do_no_harm(row):
    bench = ChunkBench(BoxChunk("", 1, ""))
    start = bench.now.actual_q
    for arguments in calls(row):
        text = f"def p():\n  x = {row.name}({', '.join(arguments)})\n  sync()\nend\n"
        bench.events.clear()
        bench.snapshots.clear()
        if bench.now.safety_mode != SafetyMode.NORMAL or bench.now.robot_mode != RobotMode.RUNNING:
            bench.tick(1, StopProgram(), UnlockProtectiveStop(), ReleaseBrakes())
        if bench.controller.state.mode.is_changing:
            bench.tick(400)
        bench.tick(CYCLES, StartProgram(compile_program(text)))
        for event in bench.events:
            assert "internal error" not in getattr(event, "text", ""), f"{arguments}: {event.text}"
        assert all(math.isfinite(x) for x in bench.now.actual_q), arguments
    bench.tick(1, StopProgram(), UnlockProtectiveStop())
    bench.tick(50)
    moved = max(abs(a - b) for a, b in zip(bench.now.actual_q, start, strict=True))
    assert row.name == "set_pos" or moved < 1.0
