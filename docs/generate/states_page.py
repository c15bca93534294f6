"""The page docs/states.md, made from the tables of the state machines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import astuple
from itertools import pairwise, permutations
from math import degrees, inf
from typing import NamedTuple

from protocol.rtde.types import SafetyStatusBits
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.machine.controller.robot_mode import JOINT_MODES, PASSING_TIME, TRANSITIONS
from ur_emulator.machine.controller.safety.boundaries import (
    DIRECTION_TOLERANCE,
    MOST_PLANES,
    PLANE_TOLERANCE,
    TRIGGER_BAND,
    BoundaryMode,
)
from ur_emulator.machine.controller.safety.inputs import (
    ACTIVE,
    OPERATIONAL_MODES,
    STOPPING,
    EnablingState,
    ModeSource,
    OperationalMode,
    SafetyInput,
)
from ur_emulator.machine.controller.safety.inputs import TRANSITIONS as ENABLING_TRANSITIONS
from ur_emulator.machine.controller.safety.modes import MODES, SafetyEvent, after, mode_of
from ur_emulator.machine.controller.status_words import safety_status_bits
from ur_emulator.machine.models.generations import CB3, E_SERIES
from ur_emulator.machine.motion.generators import Kind
from ur_emulator.machine.motion.ownership import TABLE as ARM_ROWS
from ur_emulator.machine.motion.ownership import ArmState, Row


class ProgramTransition(NamedTuple):
    """A transition of the primary program.

    Attributes:
        state: where it begins.
        event: what makes it begin.
        then: where it leads.
    """

    state: ProgramState
    event: str
    then: ProgramState


_P = ProgramState
# What `controller.program_runner` does; a test takes every transition.
PROGRAM_TRANSITIONS: tuple[ProgramTransition, ...] = (
    ProgramTransition(_P.STOPPED, "a program is started", _P.PLAYING),
    ProgramTransition(_P.PLAYING, "pause, safeguard stop; protective stop, if it was loaded", _P.PAUSING),
    ProgramTransition(_P.PAUSING, "the arm rests", _P.PAUSED),
    ProgramTransition(_P.PAUSED, "resume, safeguard closed", _P.RESUMING),
    ProgramTransition(_P.PAUSING, "resume, safeguard closed", _P.RESUMING),
    ProgramTransition(_P.RESUMING, "the arm is on its path", _P.PLAYING),
    ProgramTransition(
        _P.PLAYING, "end, stop, emergency or protective stop, violation, fault, in motion", _P.STOPPING
    ),
    ProgramTransition(_P.PLAYING, "any of them at rest, power off", _P.STOPPED),
    ProgramTransition(_P.PAUSING, "stop, emergency stop, violation, fault, in motion", _P.STOPPING),
    ProgramTransition(_P.PAUSING, "any of them at rest, power off", _P.STOPPED),
    ProgramTransition(_P.PAUSED, "stop, emergency stop, violation, fault, power off", _P.STOPPED),
    ProgramTransition(_P.STOPPING, "the arm rests", _P.STOPPED),
    ProgramTransition(_P.STOPPING, "a program is started", _P.PLAYING),
)

_HEAD = """\
# States of the box

Made from `ur_emulator/machine/controller/safety/modes.py`, `robot_mode.py`,
`ur_emulator/machine/motion/ownership.py` and `docs/generate/states_page.py` by `make docs`.
Letters: D documented, O observed, I inferred, C chosen; see [fidelity.md](fidelity.md).

Commands are those of `ur_emulator.machine.commands`; `ControlBox.submit` takes them.

## Safety mode

Every mode but NORMAL has a cause: a button, an input, or an event that stays until it is reset.
Several causes can be active at a time; the mode is that of the first one in this table.
`safety_status` gives its number, `safety_mode` too but for the modes from 12 on, which are
SAFEGUARD_STOP there. Those and all that follows from an operational mode exist on e-Series boxes
only.
"""

_EVENTS = """
### Events

A latching mode is not entered from a mode above it in the table. When a mode without power is
entered, the arm brakes with the deceleration of its model, and the power is cut 50 ms after it
rests; if the button is released earlier, the power is cut at once.
"""

_MATRIX = """
### From mode to mode

Each column has only the cause of the mode in its head; `.` means no change.
"""

_SPEEDS = """
### Reduced, recovery and manual mode

The time on the path runs slower where a limit of the mode asks for it, and `speed_scaling` shows by
how much. With
`set_safety_mode_transition_hardness(0)`, the default, the arm slows down, and stops for the
safeguard, with its full deceleration; with `(1)` it does so gently, within 0.25 s. What stays above
a limit for more than 0.5 s causes a protective stop. Recovery mode begins when the brakes open while
a joint is out of its range or the tool beyond a boundary, and ends when all are back.
"""

_STOP = SafetyMode.PROTECTIVE_STOP.name
_BOUNDARIES = f"""
### Safety planes and tool direction

An installation or the control API (`set_safety_plane`, `limit_tool_direction`) sets up as many as
{MOST_PLANES} planes, in the base frame, with normals towards the allowed side, and a cone for the
z axis of the TCP. A plane holds the TCP, and the elbow too where it restricts it. Without them
nothing is computed.
"""

# What happens at a boundary: what, then, code.
_AT_A_BOUNDARY = (
    (f"the set-point, with the way to stop, is {PLANE_TOLERANCE * 1e3:.0f} mm from a plane", _STOP, "C152"),
    (f"the same, {degrees(DIRECTION_TOLERANCE):.2f}° from the end of the cone", _STOP, "C151"),
    ("the arm is beyond a plane", SafetyMode.VIOLATION.name, "C191A4"),
    ("the tool is outside the cone", SafetyMode.VIOLATION.name, "C191A5"),
    ("the brakes open beyond one of them", "RECOVERY, in which none of them is a limit", ""),
    (
        "the arm is beyond a plane that triggers reduced mode",
        f"REDUCED, until it is {TRIGGER_BAND * 1e3:.0f} mm back behind the plane",
        "",
    ),
)

_AWAY = """
What moves away from a boundary is not stopped.
"""

_INPUTS = """
### Safety inputs

Emergency stop and safeguard stop have dedicated inputs (EI, SI): `PressEmergencyStop`,
`ReleaseEmergencyStop`, `SafeguardStop`. Pairs of configurable inputs can be set up with
`AssignSafetyInput(pair, function)`; low is safe, one low channel is enough. Functions on all boxes:
{all}. On e-Series boxes also: {e_series}. An installation of an e-Series box sets the latter up.
"""

_OPERATIONAL = """
## Operational mode (e-Series)

The first of these that has chosen a mode decides: {sources}. Without a choice the mode is NONE, as
on a box without an operational-mode password. `set_operational_mode` is the pendant,
`set operational mode` the dashboard, the selector a pair of configurable inputs (low automatic, high
manual).
"""

_ENABLING = """
A three-position enabling device is connected with `enabling_device`, or with a pair of configurable
inputs (high: in its middle position). No safeguard reset ends its stop.
"""

_ROBOT = """
## Robot mode

`power on` and `brake release` are refused, with a line in the log, while the safety mode cuts the
power of the joints, and in a mode below POWER_OFF. The dashboard replies as ever.
"""

_JOINTS = """
## Joint modes

The joint mode depends on the robot mode. The safety modes in the last column override it.
"""

_PROGRAM = """
## Program state

A program is started or resumed only while the robot is RUNNING and in NORMAL, REDUCED or RECOVERY;
otherwise a runtime exception on port 30001 gives the reason and the remedy. A protective stop ends
a program that came through a socket, and closes the program's sockets. It pauses a program that was
loaded and played; that one stays paused after the stop is unlocked.
"""

_ARM = """
## Motion of the arm

One script thread at most has the arm. Its instruction returns when its command has come to its end or
has lost the arm. In a pause no thread gets it; events that are not listed change nothing.
"""


def render() -> str:
    """Return the page."""
    lines = [
        _HEAD,
        *_table(
            ("mode", "number", "arm", "program", "latches", "left by", "source"),
            (
                (
                    row.mode.name,
                    int(row.mode),
                    row.arm.value,
                    row.program.value,
                    "yes" if row.latches else "",
                    row.remedy,
                    row.why,
                )
                for row in MODES
            ),
        ),
        "",
        *_diagram(_safety_edges()),
        _EVENTS,
        *_table(
            ("event", "brings", "ends", "comes from"),
            (
                (
                    row.title,
                    row.brings.name if row.brings else "",
                    ", ".join(mode.name for mode in _ranked(row.takes))
                    + (", and the power" if row.cuts_power else ""),
                    row.meaning,
                )
                for row in (event.value for event in SafetyEvent)
            ),
        ),
        _MATRIX,
        *_matrix(),
        "",
        "### Status bits of RTDE",
        "",
        *_table(
            ("mode", "`safety_status_bits`"),
            (
                (
                    row.mode.name,
                    ", ".join(
                        str(bit.name)
                        for bit in SafetyStatusBits
                        if bit.bit_count() == 1 and bit & safety_status_bits(row.mode)
                    ),
                )
                for row in MODES
            ),
        ),
        _SPEEDS,
        *_table(
            ("generation", "mode", "joints", "TCP and elbow", "force", "power", "momentum", "programs"),
            _limit_rows(),
        ),
        _BOUNDARIES,
        *_table(
            ("mode of a boundary", "a limit in normal mode", "a limit in reduced mode"),
            (
                (mode.value, *("yes" if mode.limits(reduced) else "" for reduced in (False, True)))
                for mode in BoundaryMode
            ),
        ),
        "",
        *_table(("what", "then", "code"), _AT_A_BOUNDARY),
        _AWAY,
        _INPUTS.format(
            all=", ".join(it.value for it in SafetyInput if not it.needs_operational_modes),
            e_series=", ".join(it.value for it in SafetyInput if it.needs_operational_modes),
        ),
        _OPERATIONAL.format(sources=", ".join(source.name.lower() for source in ModeSource)).strip("\n"),
        "",
        *_diagram(_operational_edges()),
        "",
        *_table(
            ("mode", "freedrive by people", "limits of manual mode", "enabling device", "its own safeguard"),
            (
                (mode.name, *("yes" if right else "no" for right in astuple(row)))
                for mode, row in OPERATIONAL_MODES.items()
            ),
        ),
        _ENABLING,
        *_table(
            ("state", "is", "stops in manual mode", "bit 11 of `safety_status_bits`"),
            (
                (
                    state.name,
                    state.value,
                    "yes" if state in STOPPING else "no",
                    int(state in ACTIVE),
                )
                for state in EnablingState
            ),
        ),
        "",
        *_diagram(_enabling_edges()),
        "",
        _ROBOT.strip("\n"),
        "",
        *_diagram(_robot_edges()),
        "",
        *_table(
            ("from", "command", "modes"),
            (
                (
                    mode.name,
                    command.value,
                    " → ".join(
                        f"{step.name} ({PASSING_TIME[step]:g} s)" if step in PASSING_TIME else step.name
                        for step in modes
                    ),
                )
                for (mode, command), modes in TRANSITIONS.items()
            ),
        ),
        _JOINTS,
        *_table(("robot mode", "joints", "overridden by safety modes"), _joint_rows()),
        _PROGRAM,
        *_diagram((row.state.name, row.then.name, row.event) for row in PROGRAM_TRANSITIONS),
        _ARM,
        *_table(("state", "the arm"), ((state.name, state.value) for state in ArmState)),
        "",
        *_table(("when", "in", "with", "then", "the command", "source"), map(_arm_row, ARM_ROWS)),
    ]
    return "\n".join(lines) + "\n"


def _arm_row(row: Row) -> tuple[str, ...]:
    states = "any state" if len(row.states) == len(ArmState) else ", ".join(s.name for s in row.states)
    kinds = "" if len(row.kinds) > len(Kind) else ", ".join(k.value if k else "no command" for k in row.kinds)
    return row.event.value, states, kinds, row.after.name, row.fate.value if row.fate else "", row.why


def _ranked(modes: Iterable[SafetyMode]) -> list[SafetyMode]:
    order = [row.mode for row in MODES]
    return sorted(modes, key=order.index)


def _table(head: Iterable[object], rows: Iterable[Iterable[object]]) -> Iterator[str]:
    names = list(map(str, head))
    yield f"| {' | '.join(names)} |"
    yield "|" + "---|" * len(names)
    for row in rows:
        yield f"| {' | '.join(map(str, row))} |"


def _diagram(edges: Iterable[tuple[str, str, str]]) -> Iterator[str]:
    yield "```mermaid"
    yield "stateDiagram-v2"
    for start, end, label in edges:
        yield f"    {start} --> {end}: {label}"
    yield "```"


def _safety_edges() -> Iterator[tuple[str, str, str]]:
    """Give the transitions from NORMAL and back; the rest is in the matrix."""
    for row in reversed(MODES):
        if row.mode is SafetyMode.NORMAL:
            continue
        for event in SafetyEvent:
            if event.value.brings is row.mode:
                yield SafetyMode.NORMAL.name, row.mode.name, event.value.title
        ends = [event.value.title for event in SafetyEvent if row.mode in event.value.takes]
        yield row.mode.name, SafetyMode.NORMAL.name, ", ".join(ends)


def _matrix() -> Iterator[str]:
    order = [row.mode for row in reversed(MODES)]
    rows = []
    for event in SafetyEvent:
        cells = []
        for mode in order:
            causes = frozenset() if mode is SafetyMode.NORMAL else frozenset({mode})
            then = mode_of(after(causes, event))
            cells.append("." if then is mode else then.name)
        rows.append((event.value.title, *cells))
    return _table(("event", *(mode.name for mode in order)), rows)


def _limit_rows() -> Iterator[tuple[str, ...]]:
    """Give the limits of each mode that has some."""
    for generation in (CB3, E_SERIES):
        rules = generation.limits
        rows = [
            ("REDUCED", f"{rules.reduced_share:.0%} of the rated speeds", rules.reduced),
            ("RECOVERY", f"{degrees(rules.recovery_speed):.0f} °/s", rules.recovery),
        ]
        if generation.has_operational_modes:
            rows.append(("MANUAL", "", rules.manual))
        for mode, joints, limits in rows:
            runs = mode != "RECOVERY" or rules.has_programs_in_recovery
            values = zip(astuple(limits), ("m/s", "N", "W", "kg m/s"), strict=True)
            cells = ("" if value == inf else f"{value:g} {unit}" for value, unit in values)
            yield generation.name, mode, joints, *cells, "yes" if runs else "no"


def _operational_edges() -> Iterator[tuple[str, str, str]]:
    for before, then in permutations(OperationalMode, 2):
        yield before.name, then.name, "no choice" if then is OperationalMode.NONE else then.value


def _enabling_edges() -> Iterator[tuple[str, str, str]]:
    for (before, act), then in ENABLING_TRANSITIONS.items():
        if before is not then:
            yield before.name, then.name, act.value


def _robot_edges() -> Iterator[tuple[str, str, str]]:
    """Give each step once: the first of a transition with its command, the others with the time before."""
    first: dict[tuple[RobotMode, RobotMode], str] = {}
    later: dict[tuple[RobotMode, RobotMode], str] = {}
    for (mode, command), modes in TRANSITIONS.items():
        if modes[0] is not mode:
            first.setdefault((mode, modes[0]), command.value)
        for before, step in pairwise(modes):
            label = f"after {PASSING_TIME[before]:g} s" if before in PASSING_TIME else "at once"
            later.setdefault((before, step), label)
    for (before, step), label in (later | first).items():
        yield before.name, step.name, label


def _joint_rows() -> Iterator[tuple[str, str, str]]:
    for robot in RobotMode:
        plain = JOINT_MODES[robot, SafetyMode.NORMAL]
        others = [
            f"{row.mode.name}: {JOINT_MODES[robot, row.mode].name}"
            for row in MODES
            if JOINT_MODES[robot, row.mode] is not plain
        ]
        yield robot.name, f"{plain.name} ({int(plain)})", ", ".join(others)
