"""RobotModel: the numbers of one type of arm, frozen.

The physics, the kinematics and the wire read their robot from here and from nowhere else; a new arm is a
new set of numbers in a file of arms and a row in `robots.py`. This module holds no numbers of any one
robot.

Lengths are metres, angles radians, masses kilograms. Sequences of six follow the joints from the base to
wrist 3. Link frames are the standard (distal) Denavit-Hartenberg frames: link i moves with joint i.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, radians
from typing import TYPE_CHECKING

from ur_emulator.errors import ModelError

if TYPE_CHECKING:
    from protocol.ur_types import SoftwareVersion
    from ur_emulator.machine.models.robot_generation import RobotGeneration


Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]

# No speed, no wrench, no displacement.
ZERO6: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def six(values: Sequence[float]) -> Vector6:
    """Make a Vector6 of six numbers, one a joint; any other count is a ValueError."""
    a, b, c, d, e, f = values
    return (a, b, c, d, e, f)


@dataclass(frozen=True, slots=True)
class DhRow:
    """One row of a standard Denavit-Hartenberg table: Rz(q + theta) Tz(d) Tx(a) Rx(alpha).

    Attributes:
        a: length along the new x axis [m] (the vendor writes "a"; some texts "r").
        d: offset along the joint axis [m].
        alpha: twist about the new x axis [rad].
        theta: constant added to the joint angle [rad]; 0 in a nominal table.
    """

    a: float
    d: float
    alpha: float
    theta: float = 0.0


DhTable = tuple[DhRow, DhRow, DhRow, DhRow, DhRow, DhRow]


def dh_table(*, d1: float, a2: float, a3: float, d4: float, d5: float, d6: float) -> DhTable:
    """Return the six rows of an arm: all arms differ in these lengths only [m]; `a2`, `a3` are negative."""
    return (
        DhRow(a=0.0, d=d1, alpha=pi / 2),
        DhRow(a=a2, d=0.0, alpha=0.0),
        DhRow(a=a3, d=0.0, alpha=0.0),
        DhRow(a=0.0, d=d4, alpha=pi / 2),
        DhRow(a=0.0, d=d5, alpha=-pi / 2),
        DhRow(a=0.0, d=d6, alpha=0.0),
    )


@dataclass(frozen=True, slots=True)
class Capsule:
    """The hull of a link, for collisions: a line segment with a radius, in the link's DH frame [m]."""

    start: Vector3
    end: Vector3
    radius: float


# By how much wrists 1 and 2 pass the axis of the next joint [m].
_OVERLAP = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """Housings of an arm, each with its radius as last number [m].

    Attributes:
        base: ends along z of the base frame.
        shoulder: lower end along y of its DH frame, end on the side of the upper arm along z.
        upper_arm: distance of its axis, the length of the link, from the x axis of its DH frame, along z.
        forearm: likewise.
        wrist: length of wrists 1 and 2, from the axis of the next joint back.
        flange: ends of wrist 3 along z of the flange.
    """

    base: Vector3
    shoulder: Vector3
    upper_arm: tuple[float, float]
    forearm: tuple[float, float]
    wrist: tuple[float, float]
    flange: Vector3

    def hulls(self, dh: DhTable) -> tuple[Capsule, ...]:
        """Return the hull of the base in the base frame, then those of the six links of an arm."""
        low, high, radius = self.base
        bottom, side, shoulder = self.shoulder
        back, front, flange = self.flange
        length, wrist = self.wrist
        tubes = (
            Capsule((0.0, 0.0, offset), (-row.a, 0.0, offset), tube)
            for row, (offset, tube) in zip(dh[1:3], (self.upper_arm, self.forearm), strict=True)
        )
        return (
            Capsule((0.0, 0.0, low), (0.0, 0.0, high), radius),
            Capsule((0.0, bottom, 0.0), (0.0, 0.0, side), shoulder),
            *tubes,
            Capsule((0.0, -length, 0.0), (0.0, _OVERLAP, 0.0), wrist),
            Capsule((0.0, length, 0.0), (0.0, -_OVERLAP, 0.0), wrist),
            Capsule((0.0, 0.0, back), (0.0, 0.0, front), flange),
        )


@dataclass(frozen=True, slots=True)
class Link:
    """One moving link.

    Attributes:
        mass: [kg].
        com: centre of mass in the link's DH frame [m].
        inertia: moments xx, yy, zz about the centre of mass, along the axes of the DH frame [kg m²].
        products: of inertia xy, xz, yz, likewise; 0 where `inertia` has the principal moments [kg m²].
    """

    mass: float
    com: Vector3
    inertia: Vector3
    products: Vector3 = (0.0, 0.0, 0.0)

    @property
    def tensor(self) -> tuple[Vector3, Vector3, Vector3]:
        """The rows of the inertia tensor [kg m²]."""
        (xx, yy, zz), (xy, xz, yz) = self.inertia, self.products
        return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


# Joint speed beyond which viscous friction has another slope [rad/s]. Of every arm: logs of a real UR3 (CB3),
# UR3e and UR10e, target current against target speed (O).
VISCOUS_KINK = 0.5
# Ends of joint ranges: safety blocks of real CB3 installations and the data of a UR5e, ±363 degrees [rad].
RANGE_END = 2.0 * pi + radians(3.0)


@dataclass(slots=True)
class JointRange:
    """Ends of the joint ranges in force [rad], for all who keep them: first of the arm, then as installed."""

    q_min: Vector6
    q_max: Vector6


@dataclass(frozen=True, slots=True)
class RobotModel:
    """One type of arm.

    Attributes:
        name: as on the command line, e.g. "ur3".
        title: as people write it, e.g. "UR3".
        generation: which one it is of: control cycle, software.
        dh: six nominal rows, of the vendor's "a" and "d" [m].
        links: six moving links.
        tau_max: largest joint torque [Nm].
        qd_max: rated joint speed, which moves are planned with [rad/s].
        q_min, q_max: ends of the joint range of the safety system [rad].
        armature: rotor and gear inertia as felt at the joint [kg m²].
        viscous: viscous friction up to the kink [Nm s/rad].
        viscous_fast: its slope beyond the kink [Nm s/rad].
        coulomb: Coulomb friction [Nm].
        torque_constant: joint torque per motor current, gear included [Nm/A].
        stop_deceleration: of the leading axis when the safety system or the end of a program stops the arm
            [rad/s²].
        servo_inertia: inertia at the joint that the gains of its servo are laid out for: the diagonal of the
            arm's at `home_q` with the armature [kg m²].
        payload_max: rated payload [kg].
        reach: rated reach [m].
        robot_type, box_type: codes of arm and control box in the primary interface's configuration data.
        home_q: a pose clear of the table, away from singularities [rad].
        first_version: oldest software that the maker has released for it; None: the generation's first.
        has_point_masses: the controller's model takes the links for points, without inertia tensors.
    """

    name: str
    title: str
    generation: RobotGeneration
    dh: DhTable
    links: tuple[Link, Link, Link, Link, Link, Link]
    outline: Outline
    tau_max: Vector6
    qd_max: Vector6
    armature: Vector6
    viscous: Vector6
    viscous_fast: Vector6
    coulomb: Vector6
    torque_constant: Vector6
    stop_deceleration: float
    servo_inertia: Vector6
    payload_max: float
    reach: float
    robot_type: int
    box_type: int
    home_q: Vector6
    q_min: Vector6 = (-RANGE_END,) * 6
    q_max: Vector6 = (RANGE_END,) * 6
    first_version: str | None = None
    has_point_masses: bool = False

    @property
    def qd_safety(self) -> Vector6:
        """Joint speed at which the safety system stops the arm [rad/s]."""
        return six([speed + self.generation.limits.speed_margin for speed in self.qd_max])

    @property
    def default_software(self) -> str:
        """Version that a box with this arm runs if the user names none."""
        usual = self.generation.default_version
        first = self.first_version or usual
        return max(usual, first, key=self.generation.parse_version)

    def software_version(self, text: str | None) -> SoftwareVersion:
        """Return the version of the software from its text; None is the usual one.

        ModelError if it is none of the generation, or older than the arm needs.
        """
        version = self.generation.parse_version(self.default_software if text is None else text)
        first = self.first_version
        if first is not None and version < self.generation.parse_version(first):
            raise ModelError(f"version {text} given: a {self.title} needs {first} or newer")
        return version
