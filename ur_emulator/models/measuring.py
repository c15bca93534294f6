"""What the boxes of a generation measure beside the joints: their supply, and the wrench at the flange."""

from __future__ import annotations

from dataclasses import dataclass


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
        least_averaging: time that is averaged at least to separate a zero from noise [s].
        most_averaging: and at most [s].
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
