"""The file of a sweep: TOML, read strictly. `docs/sweeps.md` explains every key.

A key that does not exist, a value of the wrong type, a movement that is not there: one line that names the
file, the key and what is allowed. Nothing has been started then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pc_client.control.controller import CONTROLLERS, FIELDS, Controller
from pc_client.errors import MovementError, SweepError
from pc_client.input_files import FILE_KINDS
from pc_client.kinematics.cell import NO_CELL, Cell
from pc_client.kinematics.cell_file import load_cell
from pc_client.kinematics.robot_model import ROBOTS
from pc_client.movements.files import library_names, library_path, load_movement
from pc_client.spelling import check_keys
from pc_client.sweep.case import MovementFile, SimulatedArm
from pc_client.sweep.controller_axes import check_distinct, grid, read_axes, samples
from ur_hil.records import nearest

FIDELITIES = ("exact", "ideal", "typical", "poor")
"""What `ur-emulator serve --fidelity` knows."""

MOST_CASES = 100_000
"""More than this is a slip of the pen: weeks on a large cluster."""

KEYS = {
    "movements": "names of the library, or movement files beside the configuration",
    "controllers": 'named controllers, the settings that [controller] starts from; ["preview"] by default',
    "robots": 'types of simulated arms: "ur3", "ur5", "ur10"; ["ur3"] by default',
    "fidelities": 'how imperfect they are: "exact", "ideal", "typical", "poor"; ["typical"] by default',
    "seeds": "which arms of their kind, whole numbers; [0] by default",
    "robot": "host of a control box that is there already, instead of robots, fidelities and seeds",
    "port_base": "offset of the ports of `robot`; 0 by default",
    "reverse_port": "port of this computer that `robot` calls; 0: any free one; 31000 by default",
    "cell": "cell file of `robot`, beside the configuration: what stands around it and what it carries",
    "repeat": "runs of each case in one session, 1 to 99; 1 by default",
    "random": "draw this many settings from [controller] instead of taking every combination",
    "random_seed": "the same seed draws the same settings; 0 by default",
    "keep_recordings": "true: the recordings (MCAP) stay in the folder; false by default",
    "output": "folder of the results, as seen from where the command is given; --out goes before it",
    "controller": "a table: fields of the controller, each with a value, a list of values or a range",
}

_OF_SIMULATED_ARMS = ("robots", "fidelities", "seeds")
_OF_GIVEN_ROBOTS = ("port_base", "reverse_port", "cell")


@dataclass(frozen=True, slots=True)
class SweepConfig:
    """What a sweep's file asks for.

    Attributes:
        source: the file.
        movements: what to do.
        arms: simulated arms; empty when `host` names a robot.
        host: a robot that is there already, or None.
        port_base: offset of its ports.
        reverse_port: where its programs dial back; None: as always.
        cell: what stands around it and what it carries.
        controllers: all settings.
        repeat: runs of each case.
        keep_recordings: whether recordings stay.
        output: folder of the results, or None.
    """

    source: Path
    movements: tuple[MovementFile, ...]
    arms: tuple[SimulatedArm, ...]
    host: str | None
    port_base: int
    reverse_port: int | None
    cell: Cell
    controllers: tuple[Controller, ...]
    repeat: int
    keep_recordings: bool
    output: Path | None


def read_config(path: Path) -> SweepConfig:
    """Read the file of a sweep.

    Raises:
        SweepError: the file cannot be read, or what it says makes no sense.
        ControllerError: a field of the controller cannot hold a value.
        MovementError: a movement file makes no sense.
    """
    return _parse(_Reader(FILE_KINDS["sweep"].read_toml(path), str(path)), path)


def _parse(reader: _Reader, path: Path) -> SweepConfig:
    reader.check_keys()
    repeat = reader.integer("repeat", 1, least=1, most=99)
    arms: tuple[SimulatedArm, ...] = ()
    host = reader.text("robot")
    if host is None:
        for key in _OF_GIVEN_ROBOTS:
            if key in reader:
                raise reader.error(
                    key,
                    "goes with robot = HOST; simulated arms have ports of their own, and nothing around them",
                )
        arms = tuple(
            SimulatedArm(robot, fidelity, seed)
            for robot in reader.words("robots", ("ur3",), tuple(ROBOTS))
            for fidelity in reader.words("fidelities", ("typical",), FIDELITIES)
            for seed in reader.integers("seeds", (0,))
        )
    else:
        for key in _OF_SIMULATED_ARMS:
            if key in reader:
                raise reader.error(key, f"is for simulated arms, but robot = {host!r} is there already")
    config = SweepConfig(
        source=path,
        movements=_movements(reader, path.parent),
        arms=arms,
        host=host,
        port_base=reader.integer("port_base", 0, least=-65535, most=65535),
        reverse_port=reader.integer("reverse_port", 0, least=0, most=65535)
        if "reverse_port" in reader
        else None,
        cell=NO_CELL if (cell := reader.text("cell")) is None else load_cell(path.parent / cell),
        controllers=_controllers(reader),
        repeat=repeat,
        keep_recordings=reader.truth("keep_recordings", False),
        output=None if (folder := reader.text("output")) is None else Path(folder),
    )
    n_cases = len(config.movements) * max(1, len(arms)) * len(config.controllers)
    if n_cases > MOST_CASES:
        raise SweepError(f"{path}: {n_cases} cases, at most {MOST_CASES} are allowed; make the lists shorter")
    return config


def _controllers(reader: _Reader) -> tuple[Controller, ...]:
    """All settings, of all named controllers."""
    bases = [CONTROLLERS[name] for name in reader.words("controllers", ("preview",), tuple(CONTROLLERS))]
    axes = read_axes(reader.table("controller"), reader.source)
    if "random" not in reader:
        if "random_seed" in reader:
            raise reader.error("random_seed", "goes with random = N")
        return tuple(setting for base in bases for setting in grid(base, axes, reader.source))
    n = reader.integer("random", 1, least=1, most=MOST_CASES)
    seed = reader.integer("random_seed", 0, least=0)
    if not axes:
        raise reader.error("random", "there is nothing to draw; give fields in a table [controller]")
    return tuple(setting for base in bases for setting in samples(base, axes, n, seed))


def _movements(reader: _Reader, folder: Path) -> tuple[MovementFile, ...]:
    """The movements, read and checked; files lie beside the configuration."""
    if "movements" not in reader:
        raise reader.error("movements", f"missing; {KEYS['movements']}")
    files = []
    for word in reader.words("movements", ()):
        path = library_path(word) or folder / word
        if not path.suffix:
            raise reader.error(
                "movements", f"no movement is called {word!r}; {nearest(word, library_names())}"
            )
        try:
            name = load_movement(path).name
            files.append(MovementFile(name, path.name, FILE_KINDS["samples"].read_text(path)))
        except MovementError as error:
            raise MovementError(f"{reader.source}: movements: {error}") from error
    check_distinct([file.name for file in files], f"{reader.source}: movements")
    return tuple(files)


class _Reader:
    """The file's top table: values by key and type.

    Args:
        values: as `tomllib` gives them.
        source: the file's name, for messages.
    """

    def __init__(self, values: Mapping[str, Any], source: str) -> None:
        self._values = values
        self.source = source

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def error(self, key: str, problem: str) -> SweepError:
        """An error about one key."""
        return SweepError(f"{self.source}: {key}: {problem}")

    def check_keys(self) -> None:
        """Refuse keys that do not exist."""
        for key in self._values:
            if key in FIELDS:
                raise self.error(key, "is a field of the controller; put it under [controller]")
        check_keys(self._values, KEYS, f"{self.source}: ", SweepError)

    def table(self, key: str) -> Mapping[str, Any]:
        """A table; empty when it is not there."""
        value = self._values.get(key, {})
        if not isinstance(value, dict):
            raise self.error(key, f"{value!r}; give a table [{key}]")
        return value

    def text(self, key: str) -> str | None:
        """A text that is not empty, or None."""
        value = self._values.get(key)
        if value is not None and (not isinstance(value, str) or not value):
            raise self.error(key, f"{value!r}; give a text")
        return value

    def truth(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self._values.get(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"{value!r}; give true or false")
        return value

    def integer(self, key: str, default: int, *, least: int, most: int | None = None) -> int:
        """A whole number within bounds."""
        value = self._values.get(key, default)
        allowed = f"{least} or above" if most is None else f"{least} to {most}"
        if isinstance(value, bool) or not isinstance(value, int) or value < least or (most or value) < value:
            raise self.error(key, f"{value!r}; give a whole number, {allowed}")
        return value

    def integers(self, key: str, default: Sequence[int]) -> list[int]:
        """A list of whole numbers, 0 or above, at least one."""
        values = self._list(key, default)
        for value in values:
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise self.error(key, f"{value!r}; give whole numbers, 0 or above")
        return values

    def words(self, key: str, default: Sequence[str], known: Sequence[str] | None = None) -> list[str]:
        """A list of texts, at least one, all of them known."""
        values = self._list(key, default)
        for value in values:
            if not isinstance(value, str) or not value:
                raise self.error(key, f"{value!r}; give texts")
            if known is not None and value not in known:
                raise self.error(key, f"{value!r} is not known; {nearest(value, known)}")
        return values

    def _list(self, key: str, default: Sequence[Any]) -> list[Any]:
        value = self._values.get(key, list(default))
        if not isinstance(value, list) or not value:
            raise self.error(key, f"{value!r}; give a list with at least one value, as {key} = [...]")
        check_distinct(value, f"{self.source}: {key}")
        return value
