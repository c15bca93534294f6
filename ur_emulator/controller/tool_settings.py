"""ToolSettings: TCP, payload and gravity, as programs have declared them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ur_emulator.models.robot_model import ZERO6, Vector3, Vector6


@dataclass(frozen=True, slots=True)
class Payload:
    """What the controller assumes at the flange: mass [kg], centre of gravity [m] in the flange frame.

    `at_tcp`: no centre of gravity was given; it is the TCP, also after a later change of the TCP.
    `inertia`: as declared, Ixx Iyy Izz Ixy Ixz Iyz [kg m^2]; it is only reported.
    """

    mass: float = 0.0
    cog: Vector3 = (0.0, 0.0, 0.0)
    at_tcp: bool = False
    inertia: Vector6 = ZERO6


class ToolSettings:
    """What programs declare about the tool and the mounting.

    Attributes:
        tcp_offset: pose of the TCP in the flange frame [m, rotation vector in rad].
        payload: mass, centre of gravity and inertia.
        gravity: acceleration in the base frame [m/s^2]; it is only kept.
    """

    __slots__ = ("gravity", "payload", "tcp_offset")

    def __init__(self) -> None:
        self.tcp_offset: Vector6 = ZERO6
        self.payload = Payload()
        self.gravity: Vector3 = (0.0, 0.0, 9.82)

    def set_tcp(self, offset: Vector6) -> None:
        """Set the TCP, and with it the centre of gravity of a payload that has none of its own."""
        if self.payload.at_tcp:
            self.payload = Payload(self.payload.mass, offset[:3], at_tcp=True)
        self.tcp_offset = offset

    def set_payload(self, mass: float, cog: Vector3 | None) -> None:
        """Set mass [kg] and centre of gravity [m]; None: the TCP, also that of a later `set_tcp`.

        Source: URScript manual, set_payload.
        """
        at_tcp = cog is None
        self.payload = Payload(mass, self.tcp_offset[:3] if cog is None else cog, at_tcp)

    def set_payload_mass(self, mass: float) -> None:
        """Set the mass [kg]; the centre of gravity stays, the inertia is no longer known."""
        self.payload = replace(self.payload, mass=mass, inertia=ZERO6)

    def set_payload_cog(self, cog: Vector3) -> None:
        """Set the centre of gravity [m]; the mass stays, the inertia is no longer known."""
        self.payload = Payload(self.payload.mass, cog)

    def set_inertia(self, inertia: Vector6) -> None:
        """Set the inertia of the payload [kg m^2]."""
        self.payload = replace(self.payload, inertia=inertia)

    def set_gravity(self, gravity: Vector3) -> None:
        """Set the acceleration of gravity [m/s^2]."""
        self.gravity = gravity
