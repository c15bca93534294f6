"""What tests see of contacts: the true force on the arm and its true place, and what the box has reported."""

import numpy as np

from ur_emulator.machine.controller.events import ErrorReported


def truth(bench, n):
    """Tick n times; true contact force on the arm and true position of the flange, (n, 3) each."""
    forces, places = [], []
    for _ in range(n):
        bench.tick()
        forces.append(bench.controller.plant.physics.contact_wrench[:3])
        places.append(bench.controller.plant.physics.flange_position.copy())
    return np.array(forces), np.array(places)


def push(bench, *force):
    bench.controller.plant.push(force)


def reported(bench):
    return [(e.code, e.argument) for e in bench.events if isinstance(e, ErrorReported)]
