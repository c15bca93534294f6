"""Sub-packages of the robot state that do not change while a box lives, in the form of `primary.layout`.

Two of them, the first, come in the first state of a connection only and after the brakes have opened.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from protocol.calibration_hash import calibration_hash
from protocol.primary.framing import SubPackage
from protocol.ur_types import SIMULATED_MASTERBOARD, SIMULATOR_CHECKSUM, SoftwareVersion
from protocol.wire_record import Since, ValueOrigin, since, wire

__all__ = [
    "CalibrationData",
    "ConfigurationData",
    "KinematicsInfo",
    "SingularityInfo",
]

_SINCE_5_25_1 = Since(None, SoftwareVersion(5, 25, 1))
_PROPERTY, _CONSTANT, _ZERO = ValueOrigin.PROPERTY, ValueOrigin.CONSTANT, ValueOrigin.INTERNAL_ZERO


@dataclass(frozen=True, slots=True)
class KinematicsInfo(SubPackage):
    """Denavit-Hartenberg parameters of this very arm; clients make their calibration check from it."""

    SUB_TYPE: ClassVar[int] = 5
    FIRST_STATE_ONLY: ClassVar[bool] = True

    checksum: tuple[int, ...] = wire(
        "I", "all ones on the maker's simulator", count=6, default=SIMULATOR_CHECKSUM, origin=_PROPERTY
    )
    dh_theta: tuple[float, ...] = wire("d", count=6, unit="rad", default=0.0, origin=_PROPERTY)
    dh_a: tuple[float, ...] = wire("d", count=6, unit="m", default=0.0, origin=_PROPERTY)
    dh_d: tuple[float, ...] = wire("d", count=6, unit="m", default=0.0, origin=_PROPERTY)
    dh_alpha: tuple[float, ...] = wire("d", count=6, unit="rad", default=0.0, origin=_PROPERTY)
    calibration_status: int = wire("I", origin=_CONSTANT)

    @property
    def calibration(self) -> str:
        """The name of the calibration in the maker's drivers."""
        return calibration_hash(zip(self.dh_theta, self.dh_d, self.dh_a, self.dh_alpha, strict=True))


@dataclass(frozen=True, slots=True)
class ConfigurationData(SubPackage):
    """Limits, defaults and nominal kinematics; the order of the DH columns differs from KinematicsInfo."""

    SUB_TYPE: ClassVar[int] = 6
    FIRST_STATE_ONLY: ClassVar[bool] = True

    joint_min_limit: tuple[float, ...] = wire(
        "d", count=6, unit="rad", interleaved="limits", default=0.0, origin=_PROPERTY
    )
    joint_max_limit: tuple[float, ...] = wire(
        "d", count=6, unit="rad", interleaved="limits", default=0.0, origin=_PROPERTY
    )
    joint_max_speed: tuple[float, ...] = wire(
        "d", count=6, unit="rad/s", interleaved="rates", default=0.0, origin=_PROPERTY
    )
    joint_max_acceleration: tuple[float, ...] = wire(
        "d", count=6, unit="rad/s2", interleaved="rates", default=40.0, origin=_CONSTANT
    )
    v_joint_default: float = wire("d", unit="rad/s", default=1.0471975511965976, origin=_CONSTANT)
    a_joint_default: float = wire("d", unit="rad/s2", default=1.3962634015954636, origin=_CONSTANT)
    v_tool_default: float = wire("d", unit="m/s", default=0.25, origin=_CONSTANT)
    a_tool_default: float = wire("d", unit="m/s2", default=1.2, origin=_CONSTANT)
    eq_radius: float = wire("d", unit="m", default=0.25, origin=_CONSTANT)
    dh_a: tuple[float, ...] = wire("d", count=6, unit="m", default=0.0, origin=_PROPERTY)
    dh_d: tuple[float, ...] = wire("d", count=6, unit="m", default=0.0, origin=_PROPERTY)
    dh_alpha: tuple[float, ...] = wire("d", count=6, unit="rad", default=0.0, origin=_PROPERTY)
    dh_theta: tuple[float, ...] = wire("d", count=6, unit="rad", default=0.0, origin=_PROPERTY)
    masterboard_version: int = wire(
        "i",
        f"{SIMULATED_MASTERBOARD} of this box, by which clients know it; 6 in a UR5e capture, CB3 unknown",
        default=6,
        origin=_CONSTANT,
    )
    controller_box_type: int = wire("i", "4 UR5, 5 UR10, 6 UR3", default=6, origin=_PROPERTY)
    robot_type: int = wire("i", "RobotType", default=3, origin=_PROPERTY)
    robot_sub_type: int = wire("i", "1 CB2, 2 CB3, 3 e-Series", default=2, origin=_PROPERTY)
    box_series: int = wire(
        "H",
        "5 CB5, 7 CB7; early software writes 1 and 2 (URCL)",
        default=5,
        since=_SINCE_5_25_1,
        origin=_CONSTANT,
    )
    tool_flange_type: int = wire(
        "H", "1 and 2: versions of the flange", default=1, since=_SINCE_5_25_1, origin=_CONSTANT
    )


@dataclass(frozen=True, slots=True)
class CalibrationData(SubPackage):
    """Internal."""

    SUB_TYPE: ClassVar[int] = 9

    wrench: tuple[float, ...] = wire("d", count=6, unit="N, Nm", default=0.0, origin=_ZERO)


@dataclass(frozen=True, slots=True)
class SingularityInfo(SubPackage):
    """Internal, e-Series. That 5.9 is the first software is inferred: a state of 5.8 does not have it."""

    SUB_TYPE: ClassVar[int] = 13
    SINCE: ClassVar[Since] = since(None, (5, 9))

    severity: int = wire("B", origin=_ZERO)
    singularity_type: int = wire("B", origin=_ZERO)
