"""What a tick of a box without its ports costs while a thread streams `speedj`, beside its physics alone."""

from __future__ import annotations

import mujoco

from bench.length import FULL, Length
from bench.limit import best_of
from ur_emulator.machine.commands.programs import StartProgram
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.robots import robot_by_name
from urscript import compile_program
from urscript.catalogue import catalogue_for
from urscript.syntax.parser import prepare

ROUNDS = 10
WARM_UP = 200  # cycles
# So slow that the arm meets nothing for the length of the measurement.
_SPEEDJ = """
def p():
  thread stream():
    while True:
      speedj([0.003, 0.002, 0.002, 0, 0, 0], 1, get_steptime())
    end
  end
  run stream()
  while True:
    sync()
  end
end
"""


def measure_tick(length: Length = FULL, robot: str = "ur3") -> dict[str, float]:
    """Measure the tick and the steps of a cycle of the same arm in turn; the best of each counts."""
    prepare()
    arm = robot_by_name(robot)
    n_steps = arm.generation.n_substeps
    catalogue = catalogue_for(arm.default_software)
    machine = Machine(arm, arm.generation.fidelity("typical"), 7)
    machine.tick([StartProgram(compile_program(_SPEEDJ, catalogue=catalogue))])
    for _ in range(WARM_UP):
        machine.tick()
    physics = machine.controller.plant._physics
    model, data = physics.model, physics.data
    # A second state of the same arm: the steps must not move the one that ticks.
    beside = mujoco.MjData(model)
    mujoco.mj_copyData(beside, model, data)

    def steps() -> None:
        mujoco.mj_step(model, beside, n_steps)

    pairs = [(best_of(machine.tick, length), best_of(steps, length)) for _ in range(length.part_of(ROUNDS))]
    tick_us, steps_us = (min(times) for times in zip(*pairs, strict=True))
    return {"tick_us": tick_us, "tick_steps_us": steps_us, "tick_x_steps": tick_us / steps_us}
