"""The UR3's numbers against what the vendor publishes, and the tables that find robots and fidelities."""

from __future__ import annotations

from dataclasses import fields
from math import hypot, pi, radians

import mujoco
import numpy as np
import pytest

from ur_emulator.errors import EmulatorError, ModelError
from ur_emulator.models.calibration import NOMINAL, calibrated_dh, draw_calibration
from ur_emulator.models.cb3_arms import UR3
from ur_emulator.models.fidelity import FIDELITIES, IDEAL, POOR, TYPICAL, random_stream
from ur_emulator.models.generations import CB3
from ur_emulator.models.mjcf import arm_spec
from ur_emulator.models.robots import robot_by_name


def test_moving_mass_is_that_of_the_vendor_table():
    assert sum(link.mass for link in UR3.links) == pytest.approx(8.63)


def test_limits_are_the_published_ones():
    assert UR3.tau_max == (56, 56, 28, 12, 12, 12)
    assert UR3.qd_max == (pi, pi, pi, 2 * pi, 2 * pi, 2 * pi)
    assert UR3.qd_safety == pytest.approx([radians(191.5)] * 3 + [radians(371.5)] * 3, abs=1e-3)
    assert UR3.q_max[:5] == pytest.approx([radians(363)] * 5)
    assert UR3.q_min[:5] == pytest.approx([-radians(363)] * 5)
    assert UR3.q_max[5] > 1e9  # wrist 3 turns without end
    assert UR3.q_min[5] < -1e9
    assert (UR3.robot_type, UR3.generation.robot_subtype, UR3.box_type) == (3, 2, 6)


def test_reach_of_the_geometry_fits_the_data_sheet():
    # From the base axis to the axis of wrist 2, arm stretched; the data sheet rounds to 500 mm.
    stretched = hypot(UR3.dh[1].a + UR3.dh[2].a, UR3.dh[3].d)
    assert stretched == pytest.approx(UR3.reach, abs=0.035)


def test_largest_gravity_torques_are_those_computed_from_the_vendor_masses():
    # Over all poses, no load: 18.6, 7.2, 1.1, .3 Nm at joints 2-5.
    model = arm_spec(UR3, UR3.dh, (1.0,) * 6).compile()
    data = mujoco.MjData(model)
    torque = np.zeros(6)
    largest = np.zeros(6)
    grid = np.linspace(-pi, pi, 9)[:-1]
    for q2 in grid:
        for q3 in grid:
            for q4 in grid:
                for q5 in grid[::2]:
                    data.qpos[:] = (0.3, q2, q3, q4, q5, 0.0)
                    mujoco.mj_kinematics(model, data)
                    mujoco.mj_comPos(model, data)
                    mujoco.mj_rne(model, data, 0, torque)
                    largest = np.maximum(largest, np.abs(torque))
    assert largest[0] == pytest.approx(0.0, abs=1e-9)
    assert largest[1:5] == pytest.approx([18.6, 7.2, 1.1, 0.3], rel=0.06)


def test_gravity_at_the_folded_pose_is_that_of_the_vendor_table():
    # At q = (0, -90, 90, -90, -90, 0) deg: -7.1, -7.1, -1.04 Nm; the common URDF is 20 to 70 % below.
    model = arm_spec(UR3, UR3.dh, (1.0,) * 6).compile()
    data = mujoco.MjData(model)
    torque = np.zeros(6)
    data.qpos[:] = np.radians([0, -90, 90, -90, -90, 0])
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_rne(model, data, 0, torque)
    assert torque[1:4] == pytest.approx([-7.1, -7.1, -1.04], abs=0.06)


def test_unknown_names_are_refused_with_the_known_ones():
    assert robot_by_name("UR3") is UR3
    assert CB3.fidelity("Typical") is TYPICAL
    with pytest.raises(ModelError, match=r"'ur7'.*ur3"):
        robot_by_name("ur7")
    with pytest.raises(EmulatorError, match=r"'perfect'.*exact, ideal, typical, poor"):
        CB3.fidelity("perfect")


def test_a_table_without_six_rows_makes_no_arm():
    with pytest.raises(ModelError, match="5 DH rows"):
        arm_spec(UR3, UR3.dh[:5], (1.0,) * 6)


def test_fidelities_are_ordered():
    assert {it.name for it in FIDELITIES} == {"exact", "ideal", "typical", "poor"}
    for better, worse in ((IDEAL, TYPICAL), (TYPICAL, POOR)):
        for field in fields(TYPICAL):
            if field.name in ("name", "speed_filter_hz", "has_physics", "drive_damping", "ripples"):
                continue
            assert np.all(np.less_equal(getattr(better, field.name), getattr(worse, field.name))), field.name
    assert [ripple.rms for ripple in POOR.ripples] == [2 * ripple.rms for ripple in TYPICAL.ripples]
    assert POOR.friction_error == 2 * TYPICAL.friction_error


def test_calibration_comes_from_the_seed_and_has_mean_zero():
    assert draw_calibration(TYPICAL, 7) == draw_calibration(TYPICAL, 7)
    assert draw_calibration(TYPICAL, 7) != draw_calibration(TYPICAL, 8)
    assert calibrated_dh(UR3, NOMINAL) == UR3.dh
    drawn = [draw_calibration(TYPICAL, seed) for seed in range(400)]
    lengths = np.array([(c.delta_a, c.delta_d) for c in drawn])
    angles = np.array([(c.delta_theta, c.delta_alpha) for c in drawn])
    for values, sigma in ((lengths, TYPICAL.calibration_length), (angles, TYPICAL.calibration_angle)):
        assert values.std() == pytest.approx(sigma, rel=0.05)
        assert abs(values.mean()) < 0.1 * sigma


def test_random_streams_are_independent_by_name():
    first, second = random_stream(3, "a").standard_normal(500), random_stream(3, "b").standard_normal(500)
    assert np.array_equal(first, random_stream(3, "a").standard_normal(500))
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.15
