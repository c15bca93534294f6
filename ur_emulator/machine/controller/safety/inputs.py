"""Buttons and inputs of the safety system: enabling device, operational mode, safeguard, and their events.

Commands and configurable inputs may activate a function at the same time; it ends when none of them does.
Source: UR3/CB3 user manual and UR5e hardware manual 2022, safety I/O: low is the safe state, both channels of
a pair are looked at. That a pair whose channels differ is not a fault is chosen.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum

from ur_emulator.machine.controller.io.lines import CONFIGURABLE
from ur_emulator.machine.controller.safety.modes import SafetyEvent


class EnablingAct(Enum):
    """What happens to the enabling device; the values but the last are those of the control API."""

    DISCONNECT = "none"
    RELEASE = "released"
    PRESS = "pressed"  # into its middle position
    PRESS_FULLY = "fully pressed"
    BEGIN_MANUAL_MODE = "manual mode begins"


class EnablingState(Enum):
    """Where the enabling device is."""

    NO_DEVICE = "no device"
    RELEASED = "released"
    ENABLING = "in the middle"
    FULLY_PRESSED = "fully pressed"
    TO_BE_RELEASED = "in the middle, must be released first"


_S, _A = EnablingState, EnablingAct
# A pair that is not listed changes nothing. Source: UR5e hardware manual 2022: stop when fully released or
# fully pressed; from automatic to manual mode it must be released and pressed again. That it enables from
# full pressure only after a release: IEC 60947-5-8.
TRANSITIONS: dict[tuple[EnablingState, EnablingAct], EnablingState] = {
    **{(state, _A.DISCONNECT): _S.NO_DEVICE for state in _S},
    **{(state, _A.RELEASE): _S.RELEASED for state in _S},
    **{(state, _A.PRESS_FULLY): _S.FULLY_PRESSED for state in _S},
    (_S.NO_DEVICE, _A.PRESS): _S.ENABLING,
    (_S.RELEASED, _A.PRESS): _S.ENABLING,
    (_S.FULLY_PRESSED, _A.PRESS): _S.TO_BE_RELEASED,
    (_S.ENABLING, _A.BEGIN_MANUAL_MODE): _S.TO_BE_RELEASED,
}
# States in which it stops the arm in manual mode, and those in which its input is active.
STOPPING = frozenset({_S.RELEASED, _S.FULLY_PRESSED, _S.TO_BE_RELEASED})
ACTIVE = frozenset({_S.ENABLING, _S.TO_BE_RELEASED})


@dataclass(slots=True)
class EnablingDevice:
    """The three-position enabling device of an e-Series box, or none."""

    state: EnablingState = EnablingState.NO_DEVICE

    def act(self, act: EnablingAct) -> None:
        """Let something happen to it."""
        self.state = TRANSITIONS.get((self.state, act), self.state)


class OperationalMode(Enum):
    """A mode of an e-Series box; the values are those of the control API and of the dashboard."""

    NONE = "none"  # without a password. Source: UR dashboard server e-Series
    MANUAL = "manual"
    AUTOMATIC = "automatic"


class ModeSource(IntEnum):
    """Who may choose the operational mode; the first one that has chosen counts.

    Source: UR5e hardware manual 2022, safety I/O: a wired selector overrides PolyScope and dashboard.
    """

    SELECTOR = 0  # configurable input: low automatic, high manual
    DASHBOARD = 1
    PENDANT = 2


@dataclass(frozen=True, slots=True)
class OperationalRow:
    """What an operational mode allows.

    Attributes:
        allows_freedrive: by the teach button, an input or a client; programs always may.
        is_slow: the limits of manual mode hold, see `SafetyLimits`.
        needs_enabling: an enabling device that is not held stops the arm.
        heeds_safeguard: the automatic-mode safeguard stops the arm.
    """

    allows_freedrive: bool
    is_slow: bool
    needs_enabling: bool
    heeds_safeguard: bool


# Sources: UR5e hardware manual 2022, safety I/O (what acts in which mode); PolyScope X manual SW 10.6 (rights
# of each mode). What is chosen stands in docs/fidelity.md.
OPERATIONAL_MODES: dict[OperationalMode, OperationalRow] = {
    OperationalMode.NONE: OperationalRow(True, False, False, False),
    OperationalMode.MANUAL: OperationalRow(True, True, True, False),
    OperationalMode.AUTOMATIC: OperationalRow(False, False, False, True),
}


class OperationalModeChoice:
    """Who has chosen which operational mode; that of the first source that has chosen one holds."""

    def __init__(self) -> None:
        self._choices: dict[ModeSource, OperationalMode] = {}
        self.mode = OperationalMode.NONE
        self.allows = OPERATIONAL_MODES[self.mode]

    @property
    def source(self) -> ModeSource:
        """Who decides at present."""
        return min(self._choices, default=ModeSource.PENDANT)

    def choose(self, source: ModeSource, mode: OperationalMode | None) -> None:
        """Let a source choose a mode, or leave the choice to the others."""
        if mode is None:
            self._choices.pop(source, None)
        else:
            self._choices[source] = mode
        self.mode = self._choices.get(self.source, OperationalMode.NONE)
        self.allows = OPERATIONAL_MODES[self.mode]


@dataclass(slots=True)
class Safeguard:
    """A safeguard of the cell; it stops the arm while it is open, or closed and not reset."""

    is_stopping: bool = False
    is_open: bool = False
    needs_reset: bool = False


N_INPUT_PAIRS = CONFIGURABLE.count // 2


class SafetyInput(Enum):
    """What a pair of configurable inputs can be set up for. Source: manuals, configurable I/O."""

    EMERGENCY_STOP = "emergency stop"  # low presses the system emergency stop
    REDUCED = "reduced"  # low switches reduced mode on
    SAFEGUARD_RESET = "safeguard reset"  # a rising edge resets
    OPERATIONAL_MODE = "operational mode"  # low is automatic, high manual
    ENABLING_DEVICE = "three-position enabling"  # high while it is in its middle position
    AUTOMATIC_SAFEGUARD = "automatic-mode safeguard"  # low opens it
    AUTOMATIC_RESET = "automatic-mode safeguard reset"  # a rising edge resets

    @property
    def needs_operational_modes(self) -> bool:
        """True where only a box with operational modes has it."""
        return self not in (self.EMERGENCY_STOP, self.REDUCED, self.SAFEGUARD_RESET)


class Guard(Enum):
    """The safeguards of a box; the values are those of the control API."""

    PERMANENT = "permanent"
    AUTOMATIC = "automatic mode"


_PRESSED = {"robot": SafetyEvent.ROBOT_EMERGENCY_PRESSED, "system": SafetyEvent.SYSTEM_EMERGENCY_PRESSED}
_RELEASED = {"robot": SafetyEvent.ROBOT_EMERGENCY_RELEASED, "system": SafetyEvent.SYSTEM_EMERGENCY_RELEASED}
# Begin and end of the stops by safeguards and enabling device.
_STOPS = (
    (SafetyEvent.SAFEGUARD_OPENED, SafetyEvent.SAFEGUARD_RESTORED),
    (SafetyEvent.AUTOMATIC_SAFEGUARD_OPENED, SafetyEvent.AUTOMATIC_SAFEGUARD_RESTORED),
    (SafetyEvent.NOT_ENABLED, SafetyEvent.ENABLED),
)


class SafetyInputs:
    """Which functions are active, and by whom; `assigned` are the pairs of inputs that are set up."""

    def __init__(
        self,
        handle: Callable[[SafetyEvent], None],
        device: EnablingDevice,
        choice: OperationalModeChoice,
        chosen: Callable[[], None],
    ) -> None:
        """Begin with nothing active.

        `handle` is called with each event, `chosen` when the operational mode has changed.
        """
        self._handle = handle
        self._device = device
        self._choice = choice
        self._chosen = chosen
        self.assigned: dict[int, SafetyInput] = {}
        self._safeguards = {guard: Safeguard() for guard in Guard}
        self._pressed: set[tuple[str, str]] = set()
        self._reducing: set[str] = set()
        self._levels: dict[SafetyInput, bool] = {}

    # --- emergency stops

    def press(self, kind: str, who: str = "command") -> None:
        """Press an emergency stop: "robot" or "system"."""
        self._pressed.add((kind, who))
        self._handle(_PRESSED[kind])

    def release(self, who: str = "command") -> None:
        """Release those that `who` has pressed; the others stay."""
        self._pressed = {press for press in self._pressed if press[1] != who}
        held = {kind for kind, _ in self._pressed}
        for kind, event in _RELEASED.items():
            if kind not in held:
                self._handle(event)

    # --- safeguards and enabling device

    def guard(self, guard: Guard, is_open: bool) -> None:
        """Open or close a safeguard."""
        row = self._safeguards[guard]
        row.is_open = is_open
        row.is_stopping = is_open or (row.is_stopping and row.needs_reset)
        self._stop_or_go_on()

    def require_reset(self, guard: Guard, required: bool) -> None:
        """Set up whether closing a safeguard is enough."""
        self._safeguards[guard].needs_reset = required
        self.guard(guard, self._safeguards[guard].is_open)

    def reset(self, guard: Guard) -> None:
        """Press the reset button of a safeguard."""
        self._safeguards[guard].is_stopping = self._safeguards[guard].is_open
        self._stop_or_go_on()

    def act_on_device(self, act: EnablingAct) -> None:
        """Let something happen to the enabling device."""
        self._device.act(act)
        self._stop_or_go_on()

    def _stop_or_go_on(self) -> None:
        """Send what the safeguards and the enabling device say in this operational mode, stops first."""
        allows, stops = self._choice.allows, {g: row.is_stopping for g, row in self._safeguards.items()}
        causes = (
            stops[Guard.PERMANENT],
            stops[Guard.AUTOMATIC] and allows.heeds_safeguard,
            self._device.state in STOPPING and allows.needs_enabling,
        )
        for stands, (begin, end) in sorted(zip(causes, _STOPS, strict=True), key=lambda row: not row[0]):
            self._handle(begin if stands else end)

    # --- modes

    def reduce(self, active: bool, who: str = "command") -> None:
        """Switch reduced mode on or off."""
        (self._reducing.add if active else self._reducing.discard)(who)
        self._handle(SafetyEvent.REDUCED_ON if self._reducing else SafetyEvent.REDUCED_OFF)

    def choose_mode(self, source: ModeSource, mode: OperationalMode | None) -> None:
        """Choose the operational mode, or leave the choice to others."""
        before = self._choice.mode
        self._choice.choose(source, mode)
        if self._choice.mode is before:
            return
        if self._choice.mode is OperationalMode.MANUAL:
            self._device.act(EnablingAct.BEGIN_MANUAL_MODE)
        self._stop_or_go_on()
        self._chosen()

    # --- configurable inputs

    def assign(self, pair: int, function: SafetyInput | None) -> None:
        """Set up a pair of configurable inputs as a safety input; None frees them."""
        if function is None:
            self.assigned.pop(pair, None)
        else:
            self.assigned[pair] = function
        for freed in self._levels.keys() - set(self.assigned.values()):
            del self._levels[freed]
            self._follow(freed, None)

    def step(self, digital_in: int) -> None:
        """Read the inputs that are set up."""
        high = dict.fromkeys(self.assigned.values(), True)
        for pair, function in self.assigned.items():
            lines = digital_in >> (CONFIGURABLE.first + 2 * pair) & 3
            high[function] = high[function] and lines == 3
        if high == self._levels:
            return
        before, self._levels = self._levels, high
        for function, level in high.items():
            if level is not before.get(function):
                self._follow(function, level, rises=before.get(function) is False)

    def _follow(self, function: SafetyInput, high: bool | None, *, rises: bool = False) -> None:
        """Do what a new level of an input means; None: nothing is connected any more."""
        match function:
            case SafetyInput.EMERGENCY_STOP:
                if high is False:
                    self.press("system", "input")
                else:
                    self.release("input")
            case SafetyInput.REDUCED:
                self.reduce(high is False, "input")
            case SafetyInput.SAFEGUARD_RESET if rises:
                self.reset(Guard.PERMANENT)
            case SafetyInput.OPERATIONAL_MODE:
                self.choose_mode(ModeSource.SELECTOR, _SELECTED.get(high))
            case SafetyInput.ENABLING_DEVICE:
                self.act_on_device(_ENABLING[high])
            case SafetyInput.AUTOMATIC_SAFEGUARD:
                self.guard(Guard.AUTOMATIC, high is False)
            case SafetyInput.AUTOMATIC_RESET if rises:
                self.reset(Guard.AUTOMATIC)


_SELECTED: dict[bool | None, OperationalMode] = {
    False: OperationalMode.AUTOMATIC,
    True: OperationalMode.MANUAL,
}
_ENABLING: dict[bool | None, EnablingAct] = {
    False: EnablingAct.RELEASE,
    True: EnablingAct.PRESS,
    None: EnablingAct.DISCONNECT,
}
