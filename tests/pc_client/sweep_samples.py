"""Cases, rows and jobs for the tests of sweeps. Jobs stand here so that worker processes can import them."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from tempfile import TemporaryDirectory

from pc_client.control.controller import CONTROLLERS
from pc_client.errors import GainMarginError
from pc_client.movements.library_sets import library_path
from pc_client.studies.sweep.case import Case, MovementFile, Outcome, SimulatedArm, failed
from pc_client.studies.sweep.store import ResultStore

PREVIEW = CONTROLLERS["preview"]


def movement(name="uniform_4_1"):
    return MovementFile(name, f"{name}.toml", library_path(name).read_text(encoding="utf-8"))


def case(movement_name="uniform_4_1", fidelity="typical", seed=7, repeat=1, **settings):
    return Case(
        movement(movement_name),
        SimulatedArm("ur3", fidelity, seed),
        dataclasses.replace(PREVIEW, **settings),
        repeat,
    )


def figures(case, repetition=1):
    """Figures that depend on nothing but the case: the best gains are (5, 2)."""
    gains = case.controller
    return {
        "kind": "lognormal" if case.movement.name.startswith("lognorm") else "uniform",
        "repetition": repetition,
        "snr_db": 30.0 - (gains.gain_p - 5.0) ** 2 - (gains.gain_i - 2.0) ** 2 + 0.1 * repetition,
        "max_position_error_mm": 1.0 + gains.gain_p,
        "gain_margin": 50.0 / (1.0 + gains.gain_p),
        "delay_ms": 32.0,
    }


def invented(case, keep_recordings=False):
    """A job without a robot: gains above 20 are refused, seed 13 brings bad luck."""
    if case.controller.gain_p > 20.0:
        error = GainMarginError("too much", margin=0.5, delay=0.03)
        return Outcome("refused", str(error), ({"delay_ms": 30.0, "gain_margin": error.margin},))
    if getattr(case.arm, "seed", None) == 13:
        return failed("the simulated box died")
    rows = tuple(figures(case, k + 1) for k in range(case.repeat))
    names = [f"{case.movement.name}_r{k + 1}.mcap" for k in range(case.repeat)] if keep_recordings else []
    return Outcome("done", rows=rows, recordings=tuple((name, b"mcap") for name in names))


def process_id(case):
    """A job that says where it runs; its process does not survive seed 13."""
    if case.arm.seed == 13:
        os._exit(9)
    return Outcome("done", str(os.getpid()))


def faulty(case):
    """A job with a mistake in it."""
    raise ZeroDivisionError("division by zero")


def interrupted(case, keep_recordings=False):
    """A job during which somebody presses Ctrl-C, at seed 13."""
    if case.arm.seed == 13:
        raise KeyboardInterrupt
    return invented(case, keep_recordings)


def table_of(*cases):
    """The table of cases that the invented job has done."""
    return table_with((case, invented(case)) for case in cases)


def table_with(outcomes):
    outcomes = list(outcomes)
    with TemporaryDirectory() as folder:
        store = ResultStore(Path(folder), keep_recordings=False)
        for case, outcome in outcomes:
            store.settle(case, outcome)
        return store.table(case for case, _ in outcomes)


def write(folder: Path, text: str) -> Path:
    path = folder / "sweep.toml"
    path.write_text(text, encoding="utf-8")
    return path
