"""A case of a sweep, what came of it, and the columns of the table that has both.

A case is one experiment: a movement, an arm, a controller, some repetitions. Its identity is its content.
Cases and outcomes travel between the command and its workers.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from pc_client.analysis.measures import PARTS
from pc_client.analysis.run import budget_column
from pc_client.control.controller import FIELDS, Controller
from pc_client.recording.provenance import Origin, origin_of
from pc_client.results.tables import Column
from ur_hil import tool_version
from ur_hil.cell import NO_CELL, Cell


@dataclass(frozen=True, slots=True)
class MovementFile:
    """A movement as text, so that it can travel to other machines.

    Attributes:
        file_name: name of its file, without folders; the suffix says what the text is.
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
        robot: a name such as "ur3" or "ur5e", as it reported.
        serial: its serial number: this is who it is, wherever it answers.
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
    """One experiment: what to do, with which arm, by which controller, how often in one session."""

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


Status = Literal["done", "refused", "failed"]
Value = float | int | str | bool | None
Row = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a case.

    Attributes:
        status: done; refused, because its gains are too large for the loop; or failed, and worth another try.
        error: why it is not done, one line.
        rows: figures of each repetition by column; of a refused case one with its delay and gain margin.
        recordings: file name and content of each recording that shall stay; of a failed case: all.
    """

    status: Status
    error: str = ""
    rows: tuple[Row, ...] = ()
    recordings: tuple[tuple[str, bytes], ...] = field(default=(), repr=False)


def failed(error: str, recordings: tuple[tuple[str, bytes], ...] = ()) -> Outcome:
    """A case that came to nothing."""
    return Outcome("failed", " ".join(error.split()), recordings=recordings)


FACTORS = (
    Column("robot", kind=str, text="type of the arm"),
    Column(
        "fidelity",
        kind=str,
        text="how imperfect the simulated arm is; none for a robot that was there already",
    ),
    Column("seed", kind=int, text="which simulated arm of its kind"),
    Column("movement", kind=str, text="name of the movement"),
    Column("controller", kind=str, text="named controller that the settings start from"),
    *(
        Column(name, kind=field.kind, text=f"as in Controller: {field.text}")
        for name, field in FIELDS.items()
    ),
)
"""What a case is made of; the axes of a sweep are those of them that vary."""

FIGURES = (
    Column("simulated", kind=bool, text="true: the robot says so; false: a real arm; missing: not known"),
    Column("kind", kind=str, text="model of the movement: lognormal, uniform ..."),
    Column("repetition", kind=int, text="run within the case, from 1"),
    Column("snr_db", text="SNR of the TCP speed, Eq. 10 of the paper: neither shifted nor smoothed"),
    Column("snr_shifted_db", text="the same after the one time shift that makes it best"),
    Column("lag_ms", text="that shift; positive: the arm is behind"),
    Column("vector_snr_db", text="SNR of the TCP velocity vector"),
    Column("vector_snr_shifted_db", text="the same after its own best shift"),
    Column("max_position_error_mm", text="largest distance of reference and reported TCP at one time"),
    Column("rms_position_error_mm", text="its root mean square"),
    Column("max_path_error_mm", text="the same after the best shift and without the constant offset"),
    *(Column(budget_column(part), text=f"share of {part} in the error power, 0..1") for part in PARTS),
    Column("delay_ms", text="loop delay that the client identified before the first run"),
    Column("gain_margin", text="factor by which both gains may grow on this loop; refused below 2"),
    Column("late_frames", kind=int, text="frames that came late"),
    Column("lost_frames", kind=int, text="frames that never came"),
)
"""What is measured on a run."""

COLUMNS = (
    Column("case", kind=str, text="identity: equal cases of any sweep share it"),
    Column("status", kind=str, text="done, refused (gain margin too small, nothing ran) or failed"),
    Column("error", kind=str, text="why it is not done"),
    *FACTORS,
    *FIGURES,
)


def origin_of_rows(rows: Sequence[Mapping[str, Any]]) -> Origin:
    """Return the words for a whole table: a real arm only if all its rows are known to be of one."""
    states = {True if row["fidelity"] is not None else row.get("simulated") for row in rows}
    return origin_of(True if True in states else None if None in states else False)
