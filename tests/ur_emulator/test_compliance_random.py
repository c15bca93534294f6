"""Whatever programs, hands and clients do to a compliant arm in whatever order: the box goes on, and ends at rest."""

import math

import numpy as np
import pytest
from box_support import Bench
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol.ur_types import ControlMode, RobotMode
from ur_emulator.commands.power import PowerOff, ReleaseBrakes, StartFreedrive
from ur_emulator.commands.programs import (
    PauseProgram,
    ResumeProgram,
    SetSpeedSlider,
    StartProgram,
    StopProgram,
)
from ur_emulator.commands.safety import TriggerProtectiveStop, UnlockProtectiveStop
from ur_emulator.commands.surroundings import AttachPayload, Push
from ur_emulator.motion.overlay import LastDisplacement
from urscript import compile_program

number = st.floats(-1.0, 1.0).map(lambda x: round(x, 3))
bits = st.lists(st.integers(0, 1), min_size=6, max_size=6)
force_mode = st.builds(
    lambda frame, selection, wrench, kind, limit: (
        f"force_mode(p{frame}, {selection}, {[60 * x for x in wrench]}, {kind}, {[limit] * 6})"
    ),
    st.lists(number, min_size=6, max_size=6),
    bits,
    st.lists(number, min_size=6, max_size=6),
    st.integers(1, 3),
    st.floats(0.0, 1.0).map(lambda x: round(x, 3)),
)
statement = st.one_of(
    force_mode,
    st.sampled_from(
        [
            "end_force_mode()",
            "freedrive_mode_no_incorrect_payload_check()",
            "end_freedrive_mode()",
            "teach_mode()",
            "zero_ftsensor()",
            "textmsg(tool_contact())",
            "set_tcp(p[0,0,0.1,0,0.2,0])",
            "set_payload(1.5, [0,0,0.05])",
            "force_mode_set_damping(0.4)",
            "force_mode_set_gain_scaling(2)",
            "movel(pose_add(get_target_tcp_pose(), p[0.02,0,-0.05,0,0,0]), v=0.2)",
            "speedl([0,0.05,-0.05,0,0,0.2], 1, 0.1)",
            "stopl(2)",
            "sleep(0.2)",
            'set_standard_digital_input_action(0, "freedrive")',
        ]
    ),
)
program = st.lists(statement, min_size=1, max_size=5).map(
    lambda body: "def f():\n  " + "\n  ".join(body) + "\n  sleep(1)\nend\n"
)
event = st.one_of(
    program,
    st.builds(
        lambda x, y, z: Push((80 * x, 80 * y, 80 * z), (0.1 * x, 0.1 * z, 0.1 * y)), number, number, number
    ),
    st.builds(AttachPayload, st.floats(0.0, 3.0)),
    st.sampled_from(
        [
            StartFreedrive(),
            StopProgram(),
            PauseProgram(),
            ResumeProgram(),
            TriggerProtectiveStop(),
            UnlockProtectiveStop(),
            ReleaseBrakes(),
            PowerOff(),
            SetSpeedSlider(0.3),
            "input",
        ]
    ),
)


@pytest.mark.slow
@settings(max_examples=30)
@given(st.lists(st.tuples(event, st.integers(1, 60)), min_size=1, max_size=10), st.integers(0, 5))
def test_nothing_breaks_a_compliant_arm(events, seed):
    bench = Bench(fidelity=("ideal", "typical", "poor")[seed % 3], seed=seed)
    state = bench.controller.state
    for what, cycles in events:
        if what == "input":
            state.io.digital_in ^= 1
        else:
            command = StartProgram(compile_program(what)) if isinstance(what, str) else what
            bench.tick(1, command)
        bench.tick(cycles)
        assert all(
            map(math.isfinite, (*bench.now.actual_q, *bench.now.target_q, *bench.now.actual_tcp_force))
        )
    state.io.digital_in = 0
    bench.tick(1, StopProgram(), ReleaseBrakes(), Push((0.0, 0.0, 0.0)))
    bench.tick(400)
    assert bench.now.control_mode == ControlMode.POSITION
    assert state.mode.mode is RobotMode.RUNNING
    assert not any(bench.now.target_qd)
    assert np.abs(bench.controller.plant.qd_true).max() < 0.02
    assert not any(not isinstance(overlay, LastDisplacement) for overlay in state.motion._overlays)
