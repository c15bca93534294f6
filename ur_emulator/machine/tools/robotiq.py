"""A Robotiq two-finger gripper: what its registers do to its fingers, and what they report.

What clients set waits until the next exchange over the serial line (`EXCHANGE`); the gripper then has it, and
what it reports is that of the same moment: a target that is accepted and the motion towards it show together.

| event | effect |
|--|--|
| power comes | reset: it must be activated |
| ACT 0 -> 1 | STA 1; the fingers open, close and open; STA 3 |
| ACT 0 | STA 0, no fault |
| a target with GTO 0 | it waits for GTO 1; OBJ 0 |
| a target with GTO 1 | while it is activated FLT 5, afterwards it moves; before the activation FLT 7 |
| the force is reached before the target | OBJ 2 closing, 1 opening; it goes on squeezing |
| the object is lost | OBJ 3; the fingers go on to the target |
| the target or an end of the stroke is reached | OBJ 3 |
| ATR 1 | whatever else is set it moves slowly to the end given by ARD, FLT 11; then FLT 15, STA 0 |

Source: maker's manuals and public clients (reference `grippers.md` 1.3 to 1.5). That the fingers are open
after the activation is chosen.
"""

from collections.abc import Sequence
from typing import NamedTuple

from protocol.robotiq import (
    DEFAULT_SID,
    INPUTS,
    OUTPUTS,
    Fault,
    Objects,
    Status,
    decode_request,
    encode_status,
)
from ur_emulator.machine.controller.io.lines import InputOutput
from ur_emulator.machine.plant.hand import FingerCommand, FingerState
from ur_emulator.machine.tools.gripper import Gripper
from ur_hil.tools import ToolModel

EXCHANGE = 0.016
"""Time between two exchanges over the serial line [s]. Source: PYR (16 ms), a measured mean of 32 ms."""

_RELEASE_SPEED = 0.02
"""Of the automatic release [m/s]: the slowest; assumed."""

_LONGEST_ACTIVATION = 6.0
"""An activation that takes longer has failed [s]; clients wait 4 to 10 s."""

_PAUSE = 0.2
"""At each end of the stroke during the activation [s]; assumed, so that it takes 1.5 to 3 s."""

_MORE_REGISTERS = 13
"""Registers behind the status, all 0: drivers read six."""

_MOVING_CURRENT = 10
"""COU while the fingers move; 0 while they stand, since the screw holds by itself. Source: example frames."""


class Settings(NamedTuple):
    """What clients write; names and values as in `protocol.robotiq.VARIABLES`."""

    ACT: int = 0
    GTO: int = 0
    ATR: int = 0
    ARD: int = 0
    MOD: int = 0
    POS: int = 0
    SPE: int = 255
    FOR: int = 0
    MSC: int = 0
    LBP: int = 0
    LRD: int = 0
    LBL: int = 0
    LGN: int = 0


class RobotiqGripper(Gripper):
    """A gripper; its unit is its SID."""

    def __init__(
        self, tool: ToolModel, period: float, unit: int = DEFAULT_SID, *, has_cable: bool = False
    ) -> None:
        super().__init__(tool, period, unit, has_cable=has_cable)
        self._every = self._wait = max(1, round(EXCHANGE / period))
        self._wanted = self._held = Settings()
        self._reset()

    def _reset(self) -> None:
        self._status, self._fault, self._objects = Status.RESET, Fault.NONE, Objects.AT_TARGET
        self._command, self._is_moving = None, False
        self._route: list[float] = []
        self._time_in_phase = self._time_activating = 0.0

    # --- clients

    def set(self, *values: tuple[str, int]) -> None:
        """Write variables, pairs of name and value; the gripper has them after the next exchange."""
        kept = {name: value for name, value in values if name in Settings._fields}
        self._wanted = self._wanted._replace(**kept)

    def get(self, name: str) -> int | None:
        """Read a number; None without power, and for a variable that is none."""
        return self._values.get(name) if self.has_power else None

    def summary(self) -> dict[str, float]:
        """The width between its pads [m], and its state."""
        state = {name: self._values[name] for name in ("STA", "OBJ", "FLT")}
        return {"SID": self.unit, "width": self._fingers.width, **state}

    @property
    def _values(self) -> dict[str, int]:
        return self._held._asdict() | {
            "POS": self.tool.count_of(self._fingers.width),
            "PRE": self._held.POS,
            "STA": int(self._status),
            "OBJ": int(self._objects),
            "FLT": int(self._fault),
            "COU": self._current,
        }

    @property
    def _current(self) -> int:
        return 0 if self._stands else _MOVING_CURRENT

    # --- the serial line

    def read_registers(self, address: int, count: int) -> list[int]:
        """Read the status from 07D0 on, or what was written from 03E8 on."""
        for first, registers in ((OUTPUTS, self._outputs()), (INPUTS, self._inputs())):
            at = address - first
            if at >= 0 and at + count <= len(registers):
                return list(registers[at : at + count])
        raise LookupError

    def write_registers(self, address: int, values: Sequence[int]) -> None:
        """Write registers from 03E8 on; the gripper has them at once."""
        registers = list(self._inputs())
        at = address - INPUTS
        if not 0 <= at <= at + len(values) <= len(registers):
            raise LookupError
        registers[at : at + len(values)] = values
        self._wanted = self._wanted._replace(**decode_request(registers))
        self._exchange()

    def _inputs(self) -> list[int]:
        held = self._wanted
        action = held.ACT | held.MOD << 1 | held.GTO << 3 | held.ATR << 4 | held.ARD << 5
        return [action << 8, held.POS, held.SPE << 8 | held.FOR]

    def _outputs(self) -> tuple[int, ...]:
        status = encode_status(
            active=bool(self._held.ACT),
            going=bool(self._held.GTO),
            status=self._status,
            objects=self._objects if self._held.GTO or self._held.ATR else Objects.MOVING,
            fault=self._fault,
            requested=self._held.POS,
            position=self.tool.count_of(self._fingers.width),
            current=self._current,
        )
        return (*status, *[0] * _MORE_REGISTERS)

    # --- the cycle

    def step(self, fingers: FingerState, has_power: bool, io: InputOutput) -> FingerCommand | None:
        """Advance by a cycle."""
        self._fingers = fingers
        if has_power is not self.has_power:
            self.has_power = has_power
            self._wanted = self._held = Settings()
            self._reset()
        if has_power:
            self._wait -= 1
            if not self._wait:
                self._wait = self._every
                self._exchange()
            self._move()
        is_moving = self._is_moving or self._status is Status.ACTIVATING
        self.is_busy = has_power and (is_moving or self._held != self._wanted)
        self.supply_current = 0.01 * self._current * has_power
        return self._command if has_power else None

    def _exchange(self) -> None:
        """Take what clients have set."""
        before, self._held = self._held, self._wanted
        held = self._held
        if not held.ACT:
            if before.ACT:
                self._reset()
            if held.GTO != before.GTO:
                self._fault = Fault.NOT_ACTIVATED if held.GTO else Fault.NONE
            return
        if not before.ACT:
            self._reset()
            self._status, self._objects = Status.ACTIVATING, Objects.MOVING
            self._route = [self.tool.stroke, 0.0, self.tool.stroke]
        if held.ATR and not before.ATR:
            self._release()
        is_new = (held.GTO, held.POS) != (before.GTO, before.POS)
        if self._status is Status.ACTIVATING:
            if is_new and held.GTO:
                self._fault = Fault.ACTION_DELAYED
        elif self._status is Status.ACTIVE and self._fault not in (Fault.RELEASING, Fault.RELEASED):
            self._follow(is_new, before)

    def _follow(self, is_new: bool, before: Settings) -> None:
        """Go to the target, or stop."""
        held, tool = self._held, self.tool
        if not held.GTO:
            if before.GTO:
                self._command = None
                self._is_moving = False
            if held.POS != before.POS:
                self._objects = Objects.MOVING  # whoever then sets GTO and waits must not find the end before
            return
        changed = is_new or (held.SPE, held.FOR) != (before.SPE, before.FOR)
        if changed or self._command is None:
            self._command = FingerCommand(
                tool.width_of(held.POS), tool.speed_of(held.SPE), tool.force_of(held.FOR)
            )
        if is_new:
            self._is_moving = True
            self._objects = Objects.MOVING

    def _release(self) -> None:
        self._fault, self._is_moving, self._objects = Fault.RELEASING, True, Objects.MOVING
        end = 0.0 if self._held.ARD else self.tool.stroke
        self._command = FingerCommand(end, _RELEASE_SPEED, self.tool.force_of(0))

    def _move(self) -> None:
        """Look at where the fingers are."""
        if self._status is Status.ACTIVATING:
            self._step_activation()
            return
        command, fingers = self._command, self._fingers
        if command is None:
            return
        if self._is_moving:
            if self._stands and self._is_at(command.width):
                self._arrive(Objects.AT_TARGET)
            elif self._stands and self._presses(command.width):
                closing = command.width < fingers.width
                self._arrive(Objects.CONTACT_CLOSING if closing else Objects.CONTACT_OPENING)
        elif not self._stands and self._objects is not Objects.AT_TARGET:
            self._objects = Objects.AT_TARGET  # the object is lost

    def _presses(self, width: float) -> bool:
        """Whether the drive presses towards a width with its limit; after a grip it may still press back."""
        share = self._fingers.share
        return (share if width > self._fingers.width else -share) > 0.95

    def _arrive(self, objects: Objects) -> None:
        self._is_moving, self._objects = False, objects
        if self._fault is Fault.RELEASING:
            self._fault, self._status = Fault.RELEASED, Status.RESET

    def _step_activation(self) -> None:
        tool = self.tool
        self._time_activating += self._period
        self._time_in_phase += self._period
        if self._time_activating > _LONGEST_ACTIVATION:
            self._reset()
            self._fault = Fault.ACTIVATION
            return
        end = self._route[0]
        self._command = FingerCommand(end, tool.speed_of(255), tool.force_of(0))
        there = self._is_at(end) or self._presses(end)
        if not (there and self._stands and self._time_in_phase >= _PAUSE):
            return
        del self._route[0]
        self._time_in_phase = 0.0
        if not self._route:
            self._status, self._objects, self._command = Status.ACTIVE, Objects.AT_TARGET, None
            if self._fault is Fault.ACTION_DELAYED:
                self._fault = Fault.NONE
            self._follow(bool(self._held.GTO), Settings())
