"""The arms that the emulator can be: those of the table, by name, and one's own, by a file.

A new arm of the table is its numbers in a file of arms and a name in `ARMS` there. A user's file names the
arm that it is based on, and what is otherwise (docs/fidelity.md, examples/arms).
"""

from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ur_emulator.errors import ModelError
from ur_emulator.machine.models import cb3_arms, e_series_arms
from ur_emulator.machine.models.generations import E_SERIES, POLYSCOPE_X
from ur_emulator.machine.models.robot_model import RANGE_END, RobotModel, Vector6, dh_table, six
from ur_hil.input_files import MIB, FileKind
from ur_hil.records import checked, number, record, text, word

ROBOTS: dict[str, RobotModel] = {robot.name: robot for robot in (*cb3_arms.ARMS, *e_series_arms.ARMS)}


def robot_by_name(name: str, version: str | None = None) -> RobotModel:
    """Look an arm up by its name, in any letter case; a name that ends in .toml is a file.

    `version` is the software that it shall run; an arm of the e-Series may run PolyScope X. ModelError if no
    arm has that name, or the file is wrong.
    """
    robot = read_robot(Path(name)) if name.endswith(".toml") else ROBOTS.get(name.lower())
    if robot is None:
        raise ModelError(f"unknown robot {name!r}: choose one of {', '.join(ROBOTS)}, or give FILE.toml")
    is_polyscope_x = version is not None and version.strip().startswith(f"{POLYSCOPE_X.major}.")
    if is_polyscope_x and robot.generation is E_SERIES:
        return replace(robot, generation=POLYSCOPE_X, first_version=None)
    return robot


# --- one's own arm, from a file

_FILE = FileKind(MIB, ModelError, "all fields have less than 0.01 MiB")

_Length = Annotated[float, number(0.0, 5.0, "m")]
_Behind = Annotated[float, number(-5.0, -0.01, "m")]
_Place = Annotated[float, number(-5.0, 5.0, "m")]
_Angle = Annotated[float, number(-RANGE_END, RANGE_END, "rad")]
_Speed = Annotated[float, number(0.01, 20.0, "rad/s")]
_Torque = Annotated[float, number(0.1, 10_000.0, "Nm")]
_Moment = Annotated[float, number(1e-7, 1000.0, "kg m²")]
_Product = Annotated[float, number(-1000.0, 1000.0, "kg m²")]


@record
class DhLengths:
    """Lengths of the DH table [m], see `dh_table`; None: that of the base."""

    d1: _Length | None = None
    a2: _Behind | None = None
    a3: _Behind | None = None
    d4: _Length | None = None
    d5: _Length | None = None
    d6: _Length | None = None


@record
class LinkNumbers:
    """Numbers of a link, see `Link`; None: that of the base."""

    mass: Annotated[float, number(0.001, 1000.0, "kg")] | None = None
    com: tuple[_Place, _Place, _Place] | None = None
    inertia: tuple[_Moment, _Moment, _Moment] | None = None
    products: tuple[_Product, _Product, _Product] | None = None


@record
class LinkTables:
    """The moving links, from the base to the flange."""

    shoulder: LinkNumbers = LinkNumbers()
    upper_arm: LinkNumbers = LinkNumbers()
    forearm: LinkNumbers = LinkNumbers()
    wrist_1: LinkNumbers = LinkNumbers()
    wrist_2: LinkNumbers = LinkNumbers()
    wrist_3: LinkNumbers = LinkNumbers()


@record
class RobotFile:
    """What a file may say of an arm: fields as in `RobotModel`; None: that of the arm `based_on`."""

    based_on: Annotated[str, word(ROBOTS)]
    title: Annotated[str, text(40)] | None = None
    dh: DhLengths = DhLengths()
    links: LinkTables = LinkTables()
    q_min: tuple[_Angle, _Angle, _Angle, _Angle, _Angle, _Angle] | None = None
    q_max: tuple[_Angle, _Angle, _Angle, _Angle, _Angle, _Angle] | None = None
    qd_max: tuple[_Speed, _Speed, _Speed, _Speed, _Speed, _Speed] | None = None
    tau_max: tuple[_Torque, _Torque, _Torque, _Torque, _Torque, _Torque] | None = None
    stop_deceleration: Annotated[float, number(0.1, 100.0, "rad/s²")] | None = None
    payload_max: Annotated[float, number(0.0, 1000.0, "kg")] | None = None
    reach: Annotated[float, number(0.01, 10.0, "m")] | None = None
    home_q: tuple[_Angle, _Angle, _Angle, _Angle, _Angle, _Angle] | None = None


def read_robot(path: Path) -> RobotModel:
    """The arm of a file: `based_on`, an arm of the table, and other values of its numbers.

    ModelError if the file cannot be read, a field does not exist or cannot hold its value, or the numbers
    make no arm.
    """
    file = checked(RobotFile, _FILE.read_toml(path), str(path), ModelError)
    base = ROBOTS[file.based_on]
    first, second, third, fourth, fifth, sixth = base.dh
    lengths = {"d1": first.d, "a2": second.a, "a3": third.a, "d4": fourth.d, "d5": fifth.d, "d6": sixth.d}
    tables = [getattr(file.links, field.name) for field in fields(file.links)]
    a, b, c, d, e, f = (replace(link, **_given(it)) for link, it in zip(base.links, tables, strict=True))
    own = _given(file)
    del own["based_on"], own["dh"], own["links"]
    dh = dh_table(**(lengths | _given(file.dh)))
    robot = replace(base, name=path.stem, dh=dh, links=(a, b, c, d, e, f), **own)
    if problem := _problem(robot):
        raise ModelError(f"{path}: {problem}")
    if (robot.dh, robot.links, robot.home_q) == (base.dh, base.links, base.home_q):
        return robot
    return replace(robot, servo_inertia=_servo_inertia(robot))


def _given(table: Any) -> dict[str, Any]:
    """The fields of a record that were given, or have a value."""
    values = {field.name: getattr(table, field.name) for field in fields(table)}
    return {name: value for name, value in values.items() if value is not None}


def _problem(robot: RobotModel) -> str:
    """Why numbers that are each within their bounds make no arm; empty if they do."""
    for joint, (low, home, high) in enumerate(zip(robot.q_min, robot.home_q, robot.q_max, strict=True)):
        if not low < high:
            return f"q_min: {low:g} of joint {joint} is not below its q_max, {high:g}; give a smaller one"
        if not low <= home <= high:
            return f"home_q: {home:g} of joint {joint} is not within {low:g} to {high:g}; give one that is"
    for field, link in zip(fields(LinkTables), robot.links, strict=True):
        least, middle, greatest = np.linalg.eigvalsh(link.tensor)
        if not (least > 0.0 and greatest <= (least + middle) * (1.0 + 1e-9)):
            return (
                f"links.{field.name}.inertia: no body has these moments and products; each principal moment "
                "is above 0 and at most the sum of the other two"
            )
    return ""


def _servo_inertia(robot: RobotModel) -> Vector6:
    """The diagonal of the mass matrix at `home_q`, rotors included [kg m²]."""
    import mujoco  # here, since looking an arm up by its name needs no physics

    from ur_emulator.machine.models.mjcf import arm_spec

    model = arm_spec(robot, robot.dh, (1.0,) * 6).compile()
    model.dof_armature[:] = robot.armature
    data, matrix = mujoco.MjData(model), np.zeros((6, 6))
    data.qpos[:] = robot.home_q
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, matrix)
    return six(np.diag(matrix).tolist())
