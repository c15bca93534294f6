"""The arms that `urscript run` can run programs on: the entry point `urscript.robots` of this package."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from ur_emulator.errors import ModelError
from ur_emulator.machine.models.generations import CB3
from ur_emulator.machine.models.robots import ROBOTS, robot_by_name

if TYPE_CHECKING:
    from ur_emulator.script_run import ScriptBox


class BoxMaker:
    """Makes boxes (see urscript.robot.RobotMaker); the physics is loaded when the first one is made."""

    robots: Mapping[str, str] = {name: robot.default_software for name, robot in ROBOTS.items()}
    fidelities: Sequence[str] = ("typical", *(it.name for it in CB3.fidelities if it.name != "typical"))

    def software_of(self, file: str) -> str:
        """See urscript.robot.RobotMaker."""
        try:
            return robot_by_name(file).default_software
        except ModelError as error:
            raise ValueError(str(error)) from None

    def make(
        self, name: str, *, fidelity: str, seed: int, software: Sequence[int], answers: Sequence[str]
    ) -> ScriptBox:
        """Return a box whose arm is powered and at rest."""
        from ur_emulator.script_run import ScriptBox

        return ScriptBox(name, fidelity, seed, software, answers)


MAKER: Final = BoxMaker()
