"""RobotGeneration: all that the arms of a generation have in common, as one record; see `generations.py`.

The box asks its arm for its generation and never which one it is: times are seconds and become cycles here,
and ports and compiler get the tables of a software version from here. This module holds no numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from pathlib import Path

from protocol.dashboard.commands import COMMANDS, DashboardCommand, commands_of
from protocol.errors import LocalProtocolError
from protocol.primary.framing import SubPackage
from protocol.primary.layout import SUB_PACKAGES
from protocol.realtime.layout import COLUMNS, VERSIONS, RealtimeColumn, RealtimeLayout, frame_size
from protocol.robot_api import ApiCall, calls_of
from protocol.rtde.fields import INPUTS, OUTPUTS, RtdeField, input_fields, output_fields
from protocol.ur_types import SoftwareVersion
from ur_emulator.errors import ModelError
from ur_emulator.machine.models.fidelity import Fidelity, read_fidelity
from ur_emulator.machine.models.safety_limits import SafetyLimits
from urscript.catalogue import ALL_ROWS, Builtin, Catalogue, catalogue_for
from urscript.catalogue.types import Version

# First version, build and date of each row, the oldest first; software between two rows has the build and the
# date of the earlier one.
Builds = tuple[tuple[SoftwareVersion, int, datetime], ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotGeneration:
    """One generation; its tables hold what any of its software versions has.

    Attributes:
        name: as people write it, "CB3".
        period_us: control cycle [us], a whole multiple of the physics step.
        substep_us: physics step [us].
        major: first number of its software versions.
        default_version: what a box runs if the user names none.
        execution_time: run time of a control cycle without programs, as the box reports it [ms]; 0: it is
            always reported as 0.
        run_up_time: in which the time on the path of a program's first move runs up to its full rate [s].
        gravity: that the controller's model of the arm has [m/s²].
        reports_control_as_target: `joint_control_output` is `target_current`, not what the servos ask for.
        has_operational_modes: manual and automatic mode, enabling device, automatic-mode safeguard.
        has_remote_control: local control, in which clients may not command the box, and remote control.
        has_remote_in_manual: remote control is possible in manual mode.
        robot_subtype: code in the primary interface's configuration data.
        dashboard: commands of the dashboard server; none: there is no such server.
        robot_api: calls of the Robot API; none: there is no such server.
        services: ports by the service that must be enabled before they open; the others are always open.
        realtime: columns of the frames on port 30003.
        frame_sizes: first version of each size of these frames.
        sub_packages: of the robot state on ports 30001 and 30002, in the order of the wire.
        rtde_outputs, rtde_inputs: variables that a client can subscribe to, and write.
        interpreter_since: first version with the port for interpreter mode; None if there is none.

    Raises:
        ModelError: the control cycle is no whole multiple of the physics step, or no part of a second.
    """

    name: str
    period_us: int
    substep_us: int
    major: int
    default_version: str
    builds: Builds
    limits: SafetyLimits
    electrics: Electrics
    force_sensing: ForceSensing
    execution_time: float
    run_up_time: float
    gravity: float
    reports_control_as_target: bool = False
    has_operational_modes: bool = False
    has_remote_control: bool = False
    has_remote_in_manual: bool = True
    fidelities: tuple[Fidelity, ...]
    robot_subtype: int
    dashboard: tuple[DashboardCommand, ...] = COMMANDS
    robot_api: tuple[ApiCall, ...] = ()
    services: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    realtime: tuple[RealtimeColumn, ...] = COLUMNS
    frame_sizes: tuple[tuple[SoftwareVersion, int], ...] = VERSIONS
    sub_packages: tuple[type[SubPackage], ...] = SUB_PACKAGES
    rtde_outputs: tuple[RtdeField, ...] = OUTPUTS
    rtde_inputs: tuple[RtdeField, ...] = INPUTS
    builtins: tuple[Builtin, ...] = ALL_ROWS
    interpreter_since: SoftwareVersion | None = None

    def __post_init__(self) -> None:
        if self.substep_us <= 0 or self.period_us <= 0 or self.period_us % self.substep_us:
            raise ModelError(
                f"control cycle of {self.period_us} us given: a whole multiple of the physics step of "
                f"{self.substep_us} us is needed"
            )
        if 1_000_000 % self.period_us:
            raise ModelError(
                f"control cycle of {self.period_us} us given: a whole number of cycles a second is needed"
            )

    @property
    def period_s(self) -> float:
        """Control cycle [s]."""
        return self.period_us * 1e-6

    @property
    def cycle_rate(self) -> int:
        """Control cycles a second."""
        return 1_000_000 // self.period_us

    @property
    def n_substeps(self) -> int:
        """Physics steps in a control cycle."""
        return self.period_us // self.substep_us

    def cycles(self, duration: float) -> int:
        """Return the number of cycles nearest to a duration [s]."""
        return round(duration * 1_000_000 / self.period_us)

    def tick_at(self, time: float) -> int:
        """Return the number of the first cycle that ends at a time of the controller [s], or later."""
        return math.ceil(round(time * 1_000_000 / self.period_us, 3))

    def seconds(self, tick: int) -> float:
        """Return the seconds of so many cycles, without an accumulated rounding error."""
        return tick * self.period_us / 1e6

    def parse_version(self, text: str) -> SoftwareVersion:
        """Return a version of this generation's software from its text; ModelError if it is none."""
        try:
            version = SoftwareVersion.parse(text)
        except LocalProtocolError as error:
            raise ModelError(str(error)) from None
        if version.major != self.major:
            raise ModelError(
                f"version {text} given: software of the {self.name} is {self.major}.x, "
                f"for example {self.default_version}"
            )
        try:
            Version.of(version).generation  # noqa: B018 - it raises for what no controller has
        except ValueError as error:
            raise ModelError(f"version {text} given: {error}") from None
        return version

    def closed_ports(self, services: Iterable[str]) -> frozenset[str]:
        """Return the ports that stay closed with these services enabled; ModelError for an unknown one."""
        enabled = frozenset(services)
        for name in enabled:
            if name not in self.services:
                known = f"choose of {', '.join(self.services)}" if self.services else "all ports are open"
                raise ModelError(f"service {name!r} given: {self.name} has no such service, {known}")
        return frozenset(
            port for name, ports in self.services.items() if name not in enabled for port in ports
        )

    def fidelity(self, name: str) -> Fidelity:
        """Look a fidelity up by its name, in any letter case; a name that ends in .toml is a file.

        ModelError if no set has that name, or the file is wrong.
        """
        if name.endswith(".toml"):
            return read_fidelity(Path(name), self.fidelities)
        for fidelity in self.fidelities:
            if fidelity.name == name.lower():
                return fidelity
        known = ", ".join(fidelity.name for fidelity in self.fidelities)
        raise ModelError(f"unknown fidelity {name!r}: choose one of {known}, or give FILE.toml")

    def software(self, version: SoftwareVersion) -> Software:
        """Return a version of the software, with its part of every table; a build number above 0 stays."""
        return _software(self, version)


@cache
def _software(generation: RobotGeneration, version: SoftwareVersion) -> Software:
    _, build, built = [row for row in generation.builds if row[0] <= version][-1]
    since = generation.interpreter_since
    size = frame_size(version, generation.frame_sizes)
    return Software(
        version=version._replace(build=version.build or build),
        built=built,
        dashboard=commands_of(version, generation.dashboard),
        robot_api=calls_of(version, generation.robot_api),
        realtime=RealtimeLayout(tuple(it for it in generation.realtime if it.since_size <= size)),
        sub_packages=generation.sub_packages,
        rtde_outputs=output_fields(version, generation.rtde_outputs),
        rtde_inputs=input_fields(version, generation.rtde_inputs),
        catalogue=catalogue_for(version, rows=generation.builtins),
        has_interpreter=since is not None and version >= since,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Electrics:
    """What boxes of a generation measure of their own supply and of warm arms.

    Attributes:
        main_voltage: of the box [V].
        robot_voltage: of the arm's bus, while it is powered [V].
        joint_voltage: of the joints on that bus [V].
        idle_current: of a powered arm whose motors give no torque [A].
        joint_temperatures: of an arm that is powered and has been still for long [°C].
    """

    main_voltage: float
    robot_voltage: float
    joint_voltage: float
    idle_current: float
    joint_temperatures: tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSensing:
    """How arms of a generation know the wrench at the flange.

    Attributes:
        has_sensor: a sensor at the flange measures it; otherwise it is estimated from motor currents. A
            sensor is zeroed when a program starts and when it declares a payload, and `actual_TCP_force` is
            the wrench at the flange, not at the TCP.
        bandwidth: pole of the measurement [Hz]; None: none shows.
        precision: force and moment that may be an error of a measurement that was not zeroed [N], [Nm].
        contact_force: a contact is a force that has risen by this [N].
        least_averaging, most_averaging: time that is averaged to separate a zero from noise [s].
        filter_time: of force mode: time constant of its filter of the wrench [s].
        control_rate: of force mode: rate at which the force approaches the one asked for at gain scaling 1
            [1/s]. What the delay of the whole loop allows.
    """

    has_sensor: bool
    bandwidth: float | None
    precision: tuple[float, float]
    contact_force: float
    least_averaging: float
    most_averaging: float
    filter_time: float
    control_rate: float


@dataclass(frozen=True, slots=True, eq=False)
class Software:
    """One version of the software; `RobotGeneration.software` makes it.

    Its tables are those of the generation, with what the version has; commands and variables by name.

    Attributes:
        version: four numbers; the last is the build.
        built: when; in the time of the box.
        has_interpreter: statements can be sent to a program in interpreter mode.
    """

    version: SoftwareVersion
    built: datetime
    dashboard: Mapping[str, DashboardCommand]
    robot_api: tuple[ApiCall, ...]
    realtime: RealtimeLayout
    sub_packages: tuple[type[SubPackage], ...]
    rtde_outputs: Mapping[str, RtdeField]
    rtde_inputs: Mapping[str, RtdeField]
    catalogue: Catalogue
    has_interpreter: bool

    @property
    def has_tool_line(self) -> bool:
        """The arm has a serial line at its tool."""
        return "set_tool_communication" in self.catalogue

    @property
    def day(self) -> str:
        """The date as the dashboard writes it, "Nov 30 2021"."""
        return self.built.strftime("%b %d %Y")
