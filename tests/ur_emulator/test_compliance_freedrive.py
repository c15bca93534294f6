"""Hand guiding: who may ask for it, what the arm does under a hand, and how it ends.

With blocked axes, and in screw driving, the tool moves along the axes that are free, and along no other.
"""

import numpy as np
import pytest
from box_support import Bench
from compliance_support import above_table, push

from ur_emulator.errors import ArgumentError
from ur_emulator.machine.commands.power import StartFreedrive
from ur_emulator.machine.commands.surroundings import AttachPayload, Push

FREE = "  freedrive_mode()\n  sleep(100)"


def test_the_target_follows_the_arm():
    bench = above_table(FREE, z=0.2)
    push(bench, 0.0, 15.0, 5.0)
    bench.tick(60)
    old, before, now = bench.snapshots[-3:]
    assert np.abs(now.actual_qd).max() > 0.1
    assert now.target_q == old.actual_q
    assert now.target_qd == old.actual_qd
    assert bench.controller.state.motion.target.q == before.actual_q


def test_time_passes_in_lockstep_as_long_as_a_hand_moves_the_arm():
    bench = Bench()
    bench.tick(1, StartFreedrive())
    bench.tick(100)
    assert not bench.controller.is_active
    bench.tick(1, Push((0.0, 15.0, 0.0)))
    bench.tick(20)
    assert bench.controller.is_active


@pytest.mark.parametrize(
    "force", [(0.0, 0.0, float("nan")), (1e9, 0.0, 0.0), (200.0, 200.0, 0.0), (1.0, 2.0)]
)
def test_no_hand_pushes_like_that(force):
    with pytest.raises(ArgumentError, match="together at most 250 N"):
        Push(force)


@pytest.mark.parametrize(
    ("mass", "cog", "what"),
    [(-1.0, (0, 0, 0), "mass"), (float("nan"), (0, 0, 0), "mass"), (1.0, (9, 0, 0), "cog")],
)
def test_no_load_is_like_that(mass, cog, what):
    with pytest.raises(ArgumentError, match=f"^{what} .* given: allowed is"):
        AttachPayload(mass, cog)


def tool(bench):
    return bench.controller.state.arm.fk(bench.controller.plant.q_true)
