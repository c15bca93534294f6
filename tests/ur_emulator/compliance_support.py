"""What the tests of compliance share: an arm with its tool above the table, and the truth about contacts."""

import numpy as np
from box_support import Bench

from ur_emulator.machine.controller.events import ErrorReported

TABLE = -0.02  # m, height of the table
DOWN = "p[0.3,0,{z},3.14159265,0,0]"  # tool down, far from singularities


def above_table(body, *, z=0.03, fidelity="typical", seed=7):
    """A bench whose arm rests with the tool at height z, and has just begun a program."""
    bench = Bench(fidelity=fidelity, seed=seed)
    bench.run(f"def p():\n  set_pos(get_inverse_kin({DOWN.format(z=z)}))\n  sleep(0.2)\nend\n")
    bench.events.clear()
    bench.start(f"def f():\n{body}\nend\n")
    return bench


def truth(bench, n):
    """Tick n times; true contact force on the arm and true position of the flange, (n, 3) each."""
    forces, places = [], []
    for _ in range(n):
        bench.tick()
        forces.append(bench.controller.plant.physics.contact_wrench[:3])
        places.append(bench.controller.plant.physics.flange_position.copy())
    return np.array(forces), np.array(places)


def place(bench):
    return bench.controller.plant.physics.flange_position.copy()


def push(bench, *force):
    bench.controller.plant.push(force)


def reported(bench):
    return [(e.code, e.argument) for e in bench.events if isinstance(e, ErrorReported)]
