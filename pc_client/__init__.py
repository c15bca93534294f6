"""Plans human-like and robot-like movements and drives an arm along them, real or emulated.

    import pc_client as ur

    arm = ur.connect("127.0.0.1")
    plan = ur.plan(ur.Movement.through([(0.3, -0.1, 0.3), (0.3, 0.1, 0.35)]), arm)
    run = arm.run(plan, ur.Controller.preview())
    print(run.snr, run.t, run.q)

A program needs no other import: what is public is in `__all__`, `dir()` shows it, and docs/api/client.md is
its reference. The modules below serve these names and the commands; they change without notice.
Emulated and real robots are treated alike; only the address differs. Names are loaded when they are first
used, so importing the package costs no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ur_hil import check_packages

if TYPE_CHECKING:
    from pc_client.analysis.groups import Groups as Groups
    from pc_client.analysis.groups import compare as compare
    from pc_client.analysis.signals import Run as Run
    from pc_client.analysis.signals import Signals as Signals
    from pc_client.arm import Arm as Arm
    from pc_client.arm import connect as connect
    from pc_client.arm import plan as plan
    from pc_client.control.controller import Controller as Controller
    from pc_client.driver.gripper import Gripper as Gripper
    from pc_client.errors import ClientError as ClientError
    from pc_client.errors import PlanningError as PlanningError
    from pc_client.errors import RobotStoppedError as RobotStoppedError
    from pc_client.movements.movement import Movement as Movement
    from pc_client.movements.samples import JointTrajectory as JointTrajectory
    from pc_client.planning.plan import Plan as Plan
    from pc_client.studies.drawing.drawing import drawing as drawing
    from ur_hil.cell import Cell as Cell
    from ur_hil.cell import Solid as Solid
    from ur_hil.cell import Tool as Tool
    from ur_hil.cell import Wall as Wall

check_packages()

_HOMES = {
    "Arm": "pc_client.arm",
    "Cell": "ur_hil.cell",
    "ClientError": "pc_client.errors",
    "Controller": "pc_client.control.controller",
    "Gripper": "pc_client.driver.gripper",
    "Groups": "pc_client.analysis.groups",
    "JointTrajectory": "pc_client.movements.samples",
    "Movement": "pc_client.movements.movement",
    "Plan": "pc_client.planning.plan",
    "PlanningError": "pc_client.errors",
    "RobotStoppedError": "pc_client.errors",
    "Run": "pc_client.analysis.signals",
    "Signals": "pc_client.analysis.signals",
    "Solid": "ur_hil.cell",
    "Tool": "ur_hil.cell",
    "Wall": "ur_hil.cell",
    "compare": "pc_client.analysis.groups",
    "connect": "pc_client.arm",
    "drawing": "pc_client.studies.drawing.drawing",
    "plan": "pc_client.arm",
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return __all__
