"""One case, from its content to its figures. This is the job that workers do.

Whatever goes wrong is part of the answer: a sweep is not ended by one case.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

from pc_client.driver.session import UrDriver
from pc_client.errors import ClientError, GainMarginError, full_message
from pc_client.experiment.experiment import Experiment, Plan, prepare_experiment
from pc_client.experiment.runner import ExperimentRunner
from pc_client.kinematics.cell import NO_CELL, Cell
from pc_client.kinematics.robot_model import robot_model
from pc_client.movements.files import library_name_of, load_movement
from pc_client.sweep.box import simulated_box
from pc_client.sweep.case import Case, GivenRobot, MovementFile, SimulatedArm
from pc_client.sweep.measure import loop_figures, measure_run
from pc_client.sweep.outcome import Outcome, failed
from protocol.errors import ProtocolError
from protocol.ur_types import Ports


def run_case(case: Case, keep_recordings: bool) -> Outcome:
    """Do one case.

    Args:
        case: what to do.
        keep_recordings: True: the recordings are part of the answer.

    Returns:
        What came of it; errors of robot, plan or disk are in it, and the recordings of a case that failed.
    """
    incident: list[tuple[str, bytes]] = []
    try:
        if isinstance(case.arm, SimulatedArm):
            with simulated_box(case.arm) as box:
                return _run(case, box.host, box.ports, 0, box.folder, keep_recordings, incident)
        with TemporaryDirectory(prefix="ur-sweep-") as folder:
            arm, ports = case.arm, Ports.standard(case.arm.port_base)
            return _run(case, arm.host, ports, arm.reverse_port, Path(folder), keep_recordings, incident)
    except GainMarginError as error:
        return Outcome(
            "refused", full_message(error), ({"delay_ms": 1e3 * error.delay, "gain_margin": error.margin},)
        )
    except (ClientError, ProtocolError, OSError) as error:
        return failed(full_message(error), tuple(incident))


def plan_case(case: Case) -> Experiment:
    """The experiment of a case, checked and planned; its folder is to be set.

    Raises:
        PlanningError: the arm cannot do the movement.
        MovementError: the movement makes no sense.
    """
    cell = NO_CELL if isinstance(case.arm, SimulatedArm) else case.arm.cell
    planned = _planned(case.movement, case.arm.robot, cell)
    # A model of its own: it carries scratch data, and workers of a cluster may be threads.
    return Experiment(robot_model(case.arm.robot, cell), (planned,), case.repeat, Path())


def _run(
    case: Case,
    host: str,
    ports: Ports,
    reverse_port: int | None,
    folder: Path,
    keep_recordings: bool,
    incident: list[tuple[str, bytes]],
) -> Outcome:
    planned = plan_case(case)
    experiment = Experiment(planned.model, planned.planned, planned.repeat, folder / "recordings")
    try:
        with UrDriver(host, ports, reverse_port=reverse_port) as driver:
            if isinstance(case.arm, GivenRobot):
                driver.info.check_same(experiment.model.title, case.arm.serial)
            report = ExperimentRunner(driver, experiment, case.controller).run()
    except (ClientError, ProtocolError, OSError) as error:
        incident += _contents(experiment.out.glob("*.mcap"))
        notes = getattr(error, "__notes__", ())  # of a folder that will be gone
        error.__notes__ = [note.replace(str(experiment.out), case.incidents) for note in notes]
        raise
    loop = loop_figures(report.delay)
    rows = tuple(
        {**measure_run(path, stream), **loop}
        for path, stream in zip(report.paths, report.streams, strict=True)
    )
    return Outcome("done", rows=rows, recordings=_contents(report.paths) if keep_recordings else ())


def _contents(paths: Iterable[Path]) -> tuple[tuple[str, bytes], ...]:
    return tuple((path.name, path.read_bytes()) for path in paths)


@lru_cache(maxsize=64)
def _planned(movement: MovementFile, robot: str, cell: Cell) -> Plan:
    """Plan a movement, once for all cases of this worker; a plan is never changed."""
    with TemporaryDirectory(prefix="ur-sweep-") as folder:
        path = Path(folder) / movement.file_name
        path.write_text(movement.text, encoding="utf-8")
        loaded = load_movement(library_name_of(movement.text) or path)
    return prepare_experiment([loaded], repeat=1, out=Path(), robot=robot, cell=cell).planned[0]
