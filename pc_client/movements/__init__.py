"""Movements of the TCP: human-like (three models), robot-like (trapezoids) or given as samples.

A `Movement` gives position and velocity at any time in closed form. This package has no robot: no joints,
no limits, no sockets.

    lognormal, sigma_lognormal                       the human-like model, from lognormal to movement
    robotic                                          the robot-like model: path, and speed profile
    minimum_jerk; power_law                          two other models of human movement
    durations, variability                           how long strokes last; the same movement another time
    columns, samples                                 tables of numbers as text; (x, y, z, t) files
    movement, movement_file, files, description      the `Movement`, its file, the library; its figures
    geometry, recipes                                boxes; random targets, recipes, into a workspace
    twins, generate                                  new movements by a seed, and the library's
    own_points                                       new movements through one's own points

Names are loaded when they are first asked for, so that importing the package costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pc_client.movements.description import describe as describe
    from pc_client.movements.files import library_names as library_names
    from pc_client.movements.files import load_movement as load_movement
    from pc_client.movements.files import save_movement as save_movement
    from pc_client.movements.generate import generate_library as generate_library
    from pc_client.movements.generate import generate_movement as generate_movement
    from pc_client.movements.movement import Movement as Movement
    from pc_client.movements.movement import MovementSample as MovementSample
    from pc_client.movements.movement import export_samples as export_samples
    from pc_client.movements.own_points import load_targets as load_targets
    from pc_client.movements.own_points import through as through
    from pc_client.movements.recipes import fit_movement as fit_movement
    from pc_client.movements.twins import robotic_twin as robotic_twin
    from pc_client.movements.variability import duplicate as duplicate

_HOMES = {
    "Movement": "movement",
    "MovementSample": "movement",
    "describe": "description",
    "duplicate": "variability",
    "export_samples": "movement",
    "fit_movement": "recipes",
    "generate_library": "generate",
    "generate_movement": "generate",
    "library_names": "files",
    "load_movement": "files",
    "load_targets": "own_points",
    "robotic_twin": "twins",
    "save_movement": "files",
    "through": "own_points",
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
