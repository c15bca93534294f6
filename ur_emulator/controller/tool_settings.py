"""ToolSettings: TCP, payload and gravity, as programs have declared them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ur_emulator.models.robot_model import ZERO6, Vector3, Vector6, six


@dataclass(frozen=True, slots=True)
class Payload:
    """What the controller assumes at the flange: mass [kg], centre of gravity [m] in the flange frame.

    `at_tcp`: no centre of gravity was given; it is the TCP, also after a later change of the TCP.
    `inertia`: as declared, Ixx Iyy Izz Ixy Ixz Iyz about the centre of gravity [kg m^2].
    """

    mass: float = 0.0
    cog: Vector3 = (0.0, 0.0, 0.0)
    at_tcp: bool = False
    inertia: Vector6 = ZERO6

    def towards(self, goal: Payload, share: float) -> Payload:
        """Return the payload a share of the way to another one, 0..1."""

        def between(a: Sequence[float], b: Sequence[float]) -> list[float]:
            return [x + share * (y - x) for x, y in zip(a, b, strict=True)]

        (mass,), (x, y, z) = between([self.mass], [goal.mass]), between(self.cog, goal.cog)
        return Payload(mass, (x, y, z), inertia=six(between(self.inertia, goal.inertia)))


class ToolSettings:
    """What programs declare about the tool and the mounting.

    Attributes:
        tcp_offset: pose of the TCP in the flange frame [m, rotation vector in rad].
        payload: mass, centre of gravity and inertia.
        gravity: acceleration in the base frame [m/s^2]; it is only kept.
        base_acceleration: of the base [m/s^2]; it is only kept.
    """

    __slots__ = ("_change", "base_acceleration", "gravity", "payload", "tcp_offset")

    def __init__(self) -> None:
        self.tcp_offset: Vector6 = ZERO6
        self.payload = Payload()
        # A change of the payload in steps: before, after, number of steps done, and of all.
        self._change: tuple[Payload, Payload, int, int] | None = None
        self.gravity: Vector3 = (0.0, 0.0, 9.82)
        self.base_acceleration: Vector3 = (0.0, 0.0, 0.0)

    def set_tcp(self, offset: Vector6) -> None:
        """Set the TCP, and with it the centre of gravity of a payload that has none of its own."""
        if self.payload.at_tcp:
            self.change_payload(Payload(self.payload.mass, offset[:3], at_tcp=True))
        self.tcp_offset = offset

    def set_payload(self, mass: float, cog: Vector3 | None) -> None:
        """Set mass [kg] and centre of gravity [m]; None: the TCP, also that of a later `set_tcp`.

        Source: URScript manual, set_payload.
        """
        at_tcp = cog is None
        self.change_payload(Payload(mass, self.tcp_offset[:3] if cog is None else cog, at_tcp))

    def set_payload_mass(self, mass: float) -> None:
        """Set the mass [kg]; the centre of gravity stays, the inertia is no longer known."""
        self.change_payload(replace(self.payload, mass=mass, inertia=ZERO6))

    def set_payload_cog(self, cog: Vector3) -> None:
        """Set the centre of gravity [m]; the mass stays, the inertia is no longer known."""
        self.change_payload(Payload(self.payload.mass, cog))

    def change_payload(self, payload: Payload, cycles: int = 0) -> None:
        """Change the payload, at once or on a straight line over so many cycles."""
        self._change = (self.payload, payload, 0, cycles) if cycles > 1 else None
        if self._change is None:
            self.payload = payload

    def step(self) -> None:
        """Advance a change of the payload by a cycle."""
        if self._change is None:
            return
        before, after, step, steps = self._change
        step += 1
        if step < steps:
            self.payload = before.towards(after, step / steps)
            self._change = (before, after, step, steps)
        else:
            self.change_payload(after)

    def set_gravity(self, gravity: Vector3) -> None:
        """Set the acceleration of gravity [m/s^2]."""
        self.gravity = gravity

    def set_base_acceleration(self, acceleration: Vector3) -> None:
        """Set the acceleration of the base [m/s^2]."""
        self.base_acceleration = acceleration
