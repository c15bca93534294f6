"""One case of a sweep: a movement, an arm, a controller, some repetitions. Its identity is its content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from pc_client.control.controller import Controller
from pc_client.kinematics.cell import NO_CELL, Cell
from ur_hil import tool_version


@dataclass(frozen=True, slots=True)
class MovementFile:
    """A movement as text, so that it can travel to other machines.

    Attributes:
        name: the movement's name.
        file_name: name of its file, without folders; the suffix says what the text is.
        text: content of the file.
    """

    name: str
    file_name: str
    text: str


@dataclass(frozen=True, slots=True)
class SimulatedArm:
    """An arm that a case starts for itself.

    Attributes:
        robot: a name such as "ur3" or "ur5e".
        fidelity: how imperfect it is, as `ur-emulator serve --fidelity`.
        seed: which arm of its kind.
    """

    robot: str
    fidelity: str
    seed: int


@dataclass(frozen=True, slots=True)
class GivenRobot:
    """A control box that is there already, real or not.

    Attributes:
        host: its name or address.
        port_base: offset of its ports.
        robot: a name such as "ur3" or "ur5e", as it reported.
        serial: its serial number: this is who it is, wherever it answers.
        cell: what stands around it and what it carries.
        reverse_port: where its programs dial back; see `ReverseServer`.
    """

    host: str
    port_base: int
    robot: str
    serial: str
    cell: Cell = NO_CELL
    reverse_port: int | None = None


@dataclass(frozen=True, slots=True)
class Case:
    """One experiment of a sweep.

    Attributes:
        movement: what to do.
        arm: with which arm.
        controller: by which controller.
        repeat: how often, in one session.
    """

    movement: MovementFile
    arm: SimulatedArm | GivenRobot
    controller: Controller
    repeat: int

    def content(self) -> dict[str, Any]:
        """Everything that may change its figures, as JSON knows it."""
        arm = asdict(self.arm)
        for address in ("host", "port_base", "reverse_port"):
            arm.pop(address, None)
        return {
            "client_version": tool_version(),
            "movement": asdict(self.movement),
            "arm": arm,
            "controller": asdict(self.controller),
            "repeat": self.repeat,
        }

    @property
    def identity(self) -> str:
        """16 hexadecimal digits that equal cases share, today and tomorrow, here and elsewhere."""
        text = json.dumps(self.content(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def incidents(self) -> str:
        """Folder of its recordings within that of the sweep if it fails."""
        return f"incidents/{self.identity}"

    def factors(self) -> dict[str, str | int | float | bool | None]:
        """What was chosen, by the names of the table's columns."""
        settings = asdict(self.controller)
        own = self.arm if isinstance(self.arm, SimulatedArm) else None
        return {
            "robot": self.arm.robot,
            "fidelity": None if own is None else own.fidelity,
            "seed": None if own is None else own.seed,
            "movement": self.movement.name,
            "controller": settings.pop("name"),
            **settings,
        }


def all_cases(
    movements: Sequence[MovementFile],
    arms: Sequence[SimulatedArm] | Sequence[GivenRobot],
    controllers: Sequence[Controller],
    repeat: int,
) -> list[Case]:
    """Every combination, arms outermost; cases that are equal appear once."""
    cases = [
        Case(movement, arm, controller, repeat)
        for arm in arms
        for movement in movements
        for controller in controllers
    ]
    return list({case.identity: case for case in cases}.values())
