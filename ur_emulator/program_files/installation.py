"""Installation: what an installation file of PolyScope declares, as a frozen record.

`installation_reader` makes it of a file. Names are those of PolyScope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.network import SignalType
from ur_emulator.machine.controller.safety.safety_state import NO_SETTINGS, SafetySettings
from ur_emulator.machine.models.robot_model import ZERO6, Vector3, Vector6

STANDARD_GRAVITY = 9.82  # m/s^2; as PolyScope writes it
# Home position of an e-Series box that nobody has set up [rad]. Source: users of real arms and of URSim.
NEW_HOME: Vector6 = (0.0, -pi / 2.0, 0.0, -pi / 2.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ExternalControlPc:
    """Where External Control gets its program; an empty host or a port 0 is not given here."""

    host: str = ""
    port: int = 0

    def over(self, other: ExternalControlPc) -> ExternalControlPc:
        """Return this PC; what it does not give is taken from the other."""
        return ExternalControlPc(self.host or other.host, self.port or other.port)


@dataclass(frozen=True, slots=True)
class Feature:
    """A pose or a plane in the base frame [m, rotation vector in rad].

    Attributes:
        is_variable: programs have it as a global variable of its name.
        is_taught: otherwise its pose is zero, and what uses it is undefined.
    """

    pose: Vector6
    is_variable: bool = False
    is_taught: bool = True


@dataclass(frozen=True, slots=True)
class OutputRule:
    """An output that follows the program.

    Attributes:
        group: as in the names of builtins: "standard_digital", "configurable_digital", "tool_digital",
            "standard_analog", "gp_boolean", "gp_integer", "gp_float".
        index: of the output in its group.
    """

    group: str
    index: int
    state: RunState


@dataclass(frozen=True, slots=True)
class DeclaredSignal:
    """A Modbus signal of another unit.

    Attributes:
        slave: number of the unit behind the address `host`.
        address: of the coil or register.
        frequency: how often it is refreshed [Hz]; None: not given.
        rule: what an output does when programs start and stop.
        sequential: the unit takes one request at a time.
    """

    name: str
    host: str
    slave: int
    address: int
    type: SignalType
    frequency: float | None = None
    rule: RunState = RunState.KEEP
    sequential: bool = False


@dataclass(frozen=True, slots=True)
class GripperCalibration:
    """Two positions of a gripper of Robotiq [%] and their widths [mm]; the defaults hold without it."""

    closed_norm: float = 100.0
    open_norm: float = 0.0
    closed_mm: float = 0.0
    open_mm: float = 50.0

    def width(self, position: float) -> float:
        """Return the width at a position, within the two widths."""
        share = (position - self.closed_norm) / (self.open_norm - self.closed_norm)
        return self.closed_mm + min(max(share, 0.0), 1.0) * (self.open_mm - self.closed_mm)


@dataclass(frozen=True, slots=True)
class GripperSetup:
    """The part of Robotiq's grippers; calibrations by number of the gripper, from 1."""

    is_there: bool = False
    is_current_limited: bool = False
    calibrations: Mapping[int, GripperCalibration] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class StartUp:
    """What the box does when it is switched on.

    Attributes:
        program: path of the program to load, from the programs folder on; "" for none.
        start_line: name of the line that starts it, at `start_level`; "" for none.
    """

    program: str = ""
    start_line: str = ""
    start_level: bool = True


@dataclass(frozen=True, slots=True)
class Installation:
    """An installation; without other values it is that of a new box.

    Attributes:
        wire_path: its name on the wire.
        pc: for External Control nodes that do not name one themselves.
        pc_name: name of that PC, as the labels of its nodes show it.
        tcps: name of each TCP -> its pose in the flange frame [m, rotation vector in rad].
        tcp_offset: the TCP that is active when a program starts; the flange if none is.
        payload: the mass that is active then [kg].
        payload_cog: its centre of gravity in the flange frame [m]; without one the controller takes the TCP.
        gravity: direction that is up, times the acceleration of gravity, in the base frame [m/s^2].
        tool_voltage: supply of the tool [V].
        analog_in_domains: of the standard inputs 0 and 1 and the tool's 0 and 1: 0 current, 1 voltage.
        analog_out_domains: of the standard outputs 0 and 1.
        input_actions: (group of inputs as in the names of builtins, index, action).
        transition_hardness: of safety transitions: 0 hard, 1 soft.
        lines: name that somebody gave a line -> its own name, such as `digital_out[2]`.
        features: by name, in the order of the file; base and tool are not among them.
        variables: name -> value as a literal of URScript, in the order of the file.
        modbus: signals of other units.
        safe_home: joint angles [rad].
        start_up: what the box does when it is switched on.
    """

    wire_path: str
    pc: ExternalControlPc = ExternalControlPc()
    pc_name: str = ""
    tcps: Mapping[str, Vector6] = field(default_factory=dict)
    tcp_offset: Vector6 = ZERO6
    payload: float = 0.0
    payload_cog: Vector3 | None = None
    gravity: Vector3 = (0.0, 0.0, STANDARD_GRAVITY)
    tool_voltage: int = 0
    analog_in_domains: tuple[int, ...] = (1, 1, 1, 1)
    analog_out_domains: tuple[int, ...] = (0, 0)
    input_actions: tuple[tuple[str, int, str], ...] = ()
    output_rules: tuple[OutputRule, ...] = ()
    transition_hardness: int = 1
    lines: Mapping[str, str] = field(default_factory=dict)
    features: Mapping[str, Feature] = field(default_factory=dict)
    variables: Mapping[str, str] = field(default_factory=dict)
    modbus: tuple[DeclaredSignal, ...] = ()
    safe_home: Vector6 = NEW_HOME
    safety: SafetySettings = NO_SETTINGS
    start_up: StartUp = StartUp()
    grippers: GripperSetup = GripperSetup()
