"""The plant's model in MuJoCo: the mechanism with hulls, friction, drives, table, tools and raw sensors.

Its hinges are the motor side of the gears. The law of the joint servos is that of MuJoCo's actuators, force =
kp (ctrl - q) - kv qd + bias, so that it acts within every sub-step, in C, and implicitly in speed.
"""

from collections.abc import Sequence
from itertools import pairwise

import mujoco

from ur_emulator.machine.models.mjcf import FLANGE, JOINTS, LINKS, arm_spec, to_body
from ur_emulator.machine.models.robot_model import DhRow, RobotModel
from ur_emulator.machine.models.things import SLIDING_FRICTION
from ur_emulator.machine.plant.drives import ServoGains
from ur_emulator.machine.plant.hand import add_tool
from ur_hil.tools import ToolModel

TABLE_HEIGHT = -0.02  # m; the arm stands on a plate two centimetres above the table

# Contacts give like a tool and a table of some elasticity: 0.1 mm under 20 N, 0.4 mm under 120 N. Harder ones
# rattle under a tool that is drawn over them.
CONTACT_SOLREF = (0.010, 1.0)
CONTACT_SOLIMP = (0.3, 0.95, 0.0005, 0.5, 2.0)


def physics_spec(
    robot: RobotModel,
    dh: Sequence[DhRow],
    mass_scale: Sequence[float],
    gains: ServoGains,
    tools: Sequence[ToolModel],
) -> mujoco.MjSpec:
    """Return the plant's model, not compiled; see `arm_spec` for the mechanism.

    Args:
        dh: its six true rows.
        mass_scale: six factors on the link masses.
    """
    spec = arm_spec(robot, dh, mass_scale)
    option = spec.option
    option.timestep = robot.generation.substep_us * 1e-6
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Round friction cones: on a pyramid a drawn tool jumps from edge to edge.
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # A diverged state must reach the caller instead of being reset silently. Islands and the midphase
    # are for scenes with many bodies and only cost time here.
    off = mujoco.mjtDisableBit
    option.disableflags |= off.mjDSBL_AUTORESET | off.mjDSBL_ISLAND | off.mjDSBL_MIDPHASE
    _add_drives(spec, robot, gains)
    _add_hulls(spec, robot, dh)
    _add_sensors(spec)
    for i, tool in enumerate(tools):
        add_tool(spec, tool, i)
    return spec


def compile_physics(spec: mujoco.MjSpec, speed: float) -> mujoco.MjModel:
    """Compile the plant's model.

    Dry friction grows from zero to its size over a speed [rad/s], by backward Euler.

    With w a joint's inverse inertia, MuJoCo solves f (w + R) = -2 v / (d t) - a for the force f, where a is
    the acceleration without it, R = w (1 - d) / d, and d, t are the impedance and time constant set here.
    R = speed / (size step) and d t = 2 step make that f = -size / speed times the speed after the step.
    """
    model = spec.compile()
    step = model.opt.timestep
    slope = step * model.dof_invweight0[:6] * model.dof_frictionloss[:6] / speed
    impedance = slope / (1.0 + slope)
    model.dof_solimp[:6, :2] = impedance[:, None]
    model.dof_solref[:6, 0] = 2.0 * step / impedance
    return model


def _add_drives(spec: mujoco.MjSpec, robot: RobotModel, gains: ServoGains) -> None:
    for i, name in enumerate(JOINTS):
        joint = spec.joint(name)
        joint.armature = robot.armature[i]
        joint.damping = [robot.viscous_fast[i], 0.0, 0.0]
        joint.frictionloss = robot.coulomb[i]
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.gaintype = mujoco.mjtGain.mjGAIN_FIXED
        drive.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        drive.gainprm[0] = gains.kp[i]
        drive.biasprm[1] = -gains.kp[i]
        drive.biasprm[2] = -gains.kv[i]
        drive.forcelimited = True
        drive.forcerange = [-robot.tau_max[i], robot.tau_max[i]]


def _add_hulls(spec: mujoco.MjSpec, robot: RobotModel, dh: Sequence[DhRow]) -> None:
    world = spec.worldbody
    world.add_geom(
        name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1], pos=[0.0, 0.0, TABLE_HEIGHT]
    )
    base, *hulls = robot.outline.hulls(robot.dh)
    _add_capsule(world, base.start, base.end, base.radius)
    for name, hull, row in zip(LINKS, hulls, dh, strict=True):
        _add_capsule(spec.body(name), to_body(row, hull.start), to_body(row, hull.end), hull.radius)
    # Neighbours touch in their common joint by construction; in the wrist the next but one is out of reach.
    neighbours = [*pairwise(("world", *LINKS)), (LINKS[2], LINKS[4]), (LINKS[3], LINKS[5])]
    for geom in spec.geoms:
        geom.solref = CONTACT_SOLREF
        geom.solimp = CONTACT_SOLIMP
        geom.friction[0] = SLIDING_FRICTION
    for one, other in neighbours:
        spec.add_exclude(bodyname1=one, bodyname2=other)


def _add_capsule(body: mujoco.MjsBody, start: Sequence[float], end: Sequence[float], radius: float) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*start, *end], size=[radius, 0.0, 0.0], mass=0.0
    )


def _add_sensors(spec: mujoco.MjSpec) -> None:
    """Add raw sensors in the order of `sensors.REC_SIMULATED`; they are taken at the start of a sub-step."""
    kinds, objects = mujoco.mjtSensor, mujoco.mjtObj
    for kind, of in (
        (kinds.mjSENS_JOINTPOS, objects.mjOBJ_JOINT),
        (kinds.mjSENS_JOINTVEL, objects.mjOBJ_JOINT),
        (kinds.mjSENS_ACTUATORFRC, objects.mjOBJ_ACTUATOR),
    ):
        for name in JOINTS:
            spec.add_sensor(type=kind, objtype=of, objname=name)
    spec.add_sensor(type=kinds.mjSENS_ACCELEROMETER, objtype=objects.mjOBJ_SITE, objname=FLANGE)
