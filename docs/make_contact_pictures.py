"""Draw the pictures of docs/contact.md: hand guiding, force mode on the table, a move into the table.

Runs the box's own controller and physics, in simulated time, and renders what they did with MuJoCo off-screen
(EGL, or the library that MUJOCO_GL names). `make pictures` calls it.
"""

from __future__ import annotations

import argparse
import os
from itertools import pairwise
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")

import matplotlib as mpl
import mujoco
import numpy as np

from protocol.ur_types import ControlMode, SafetyMode
from ur_emulator.machine.commands.programs import StartProgram
from ur_emulator.machine.commands.surroundings import Push
from ur_emulator.machine.controller.events import ErrorReported
from ur_emulator.machine.machine import Machine
from ur_emulator.machine.models.cb3_arms import UR3
from ur_emulator.machine.models.fidelity import TYPICAL
from ur_emulator.machine.models.mjcf import LINKS, arm_spec, to_body
from ur_emulator.machine.plant.physics_model import TABLE_HEIGHT
from urscript import compile_program

mpl.use("agg")
import matplotlib.pyplot as plt

SEED = 7
PERIOD = 0.008  # s
DOWN = "p[0.3,0,{z},3.14159265,0,0]"  # tool down

STEEL, JOINT, TOOL = (0.80, 0.82, 0.85, 1.0), (0.20, 0.42, 0.62, 1.0), (0.30, 0.32, 0.35, 1.0)
PUSH, CONTACT = (0.85, 0.20, 0.15, 1.0), (0.10, 0.55, 0.25, 1.0)
BLUE, GREEN, RED, GREY = "#20629c", "#1a8c40", "#d93326", "#9a9a9a"


class Run:
    """A program on a box, and what it left behind, cycle by cycle."""

    def __init__(self, start_z, program):
        self.controller = Machine(UR3, TYPICAL, SEED).controller
        self._play(f"movej({DOWN.format(z=start_z)}, a=3, v=2)")
        self.rows = []
        self.errors = []
        self.controller.state.events.take()
        self.controller.tick((StartProgram(compile_program(program)),))

    def _play(self, text):
        self.controller.tick((StartProgram(compile_program(text)),))
        while self.controller.is_active:
            self.controller.tick(())

    def go_on(self, seconds, *commands):
        """Tick for a time; returns the run."""
        plant = self.controller.plant
        for _ in range(round(seconds / PERIOD)):
            snapshot = self.controller.tick(commands)
            commands = ()
            for event in self.controller.state.events.take():
                if isinstance(event, ErrorReported):
                    self.errors.append((len(self.rows) * PERIOD, event))
            self.rows.append(
                {
                    "q": plant.q_true,
                    "target_q": np.array(snapshot.target_q),
                    "place": plant.physics.flange_position.copy(),
                    "contact": plant.physics.contact_wrench,
                    "felt": np.array(snapshot.actual_tcp_force),
                    "speed": np.array(snapshot.actual_tcp_speed),
                    "target_pose": np.array(snapshot.target_tcp_pose),
                    "mode": snapshot.control_mode,
                    "safety": snapshot.safety_mode,
                    "error": plant.sense().position_error,
                }
            )
        return self

    def column(self, name):
        return np.array([row[name] for row in self.rows])

    @property
    def time(self):
        return np.arange(1, len(self.rows) + 1) * PERIOD


# --- rendering


class Stage:
    """The arm as the physics has it, on a table, under a camera."""

    def __init__(self, controller, width=900, height=760):
        dh = controller.plant.dh
        spec = arm_spec(UR3, dh, (1.0,) * 6)
        world = spec.worldbody
        kinds, patterns = mujoco.mjtTexture, mujoco.mjtBuiltin
        spec.add_texture(name="sky", type=kinds.mjTEXTURE_SKYBOX, builtin=patterns.mjBUILTIN_GRADIENT,
                         rgb1=[1, 1, 1], rgb2=[0.86, 0.90, 0.95], width=64, height=384)  # fmt: skip
        spec.add_texture(name="wood", type=kinds.mjTEXTURE_2D, builtin=patterns.mjBUILTIN_CHECKER,
                         rgb1=[0.83, 0.74, 0.60], rgb2=[0.79, 0.69, 0.54], width=512, height=512)  # fmt: skip
        wood = spec.add_material(name="wood", texrepeat=[10, 8], reflectance=0.0, specular=0.0)
        wood.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "wood"
        half = [0.5, 0.4, 0.02]
        world.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=[0.2, 0, TABLE_HEIGHT - half[2]], material="wood"
        )
        for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            world.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02, 0.02, 0.3], rgba=[0.45, 0.40, 0.34, 1],
                           pos=[0.2 + 0.46 * x, 0.36 * y, TABLE_HEIGHT - 0.34])  # fmt: skip
        cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
        world.add_geom(type=cylinder, fromto=[0, 0, TABLE_HEIGHT, 0, 0, 0], size=[0.075, 0, 0], rgba=TOOL)
        world.add_geom(type=cylinder, fromto=[0, 0, 0, 0, 0, 0.075], size=[0.06, 0, 0], rgba=STEEL)
        capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
        hulls = UR3.outline.hulls(UR3.dh)[1:]
        for i, (name, hull, row) in enumerate(zip(LINKS, hulls, dh, strict=True)):
            color = STEEL if i in (1, 2) else (TOOL if i == 5 else JOINT)
            ends = [*to_body(row, hull.start), *to_body(row, hull.end)]
            spec.body(name).add_geom(type=capsule, fromto=ends, size=[hull.radius, 0, 0], rgba=color, mass=0)
        world.add_light(
            pos=[0.8, -0.9, 1.8], dir=[-0.4, 0.5, -1], diffuse=[0.55] * 3, specular=[0.1] * 3, castshadow=True
        )
        world.add_light(
            pos=[-0.6, 0.9, 1.5],
            dir=[0.4, -0.5, -1],
            diffuse=[0.25] * 3,
            specular=[0.0] * 3,
            castshadow=False,
        )
        spec.visual.headlight.ambient = [0.38] * 3
        spec.visual.headlight.diffuse = [0.25] * 3
        spec.visual.quality.shadowsize = 4096
        spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.ghost = mujoco.MjData(self.model)
        try:
            self.renderer = mujoco.Renderer(self.model, height, width, max_geom=2000)
        except Exception as error:
            raise SystemExit(
                f"no off-screen OpenGL ({type(error).__name__}): "
                "install Mesa's EGL (apt-get install libegl1) or set MUJOCO_GL=osmesa"
            ) from None
        self.camera = mujoco.MjvCamera()
        self.camera.lookat[:] = (0.17, 0.03, 0.16)
        self.camera.distance, self.camera.azimuth, self.camera.elevation = 1.25, 118, -16

    def show(self, q):
        self.data.qpos[:] = q
        mujoco.mj_forward(self.model, self.data)
        self.renderer.update_scene(self.data, self.camera)

    def add_ghost(self, q, color, alpha):
        scene = self.renderer.scene
        self.ghost.qpos[:] = q
        mujoco.mj_forward(self.model, self.ghost)
        first = scene.ngeom
        mujoco.mjv_addGeoms(self.model, self.ghost, mujoco.MjvOption(), mujoco.MjvPerturb(),
                            int(mujoco.mjtCatBit.mjCAT_DYNAMIC), scene)  # fmt: skip
        for i in range(first, scene.ngeom):
            scene.geoms[i].rgba[:] = (*color[:3], alpha)

    def add_arrow(self, start, end, color, width=0.012):
        self._add(mujoco.mjtGeom.mjGEOM_ARROW, start, end, color, width)

    def add_line(self, points, color, width=0.0025):
        for a, b in pairwise(points):
            if np.linalg.norm(b - a) > 1e-6:
                self._add(mujoco.mjtGeom.mjGEOM_CAPSULE, a, b, color, width)

    def _add(self, kind, start, end, color, width):
        scene = self.renderer.scene
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(
            geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), np.array(color, dtype=np.float32)
        )
        mujoco.mjv_connector(geom, kind, width, np.array(start, dtype=float), np.array(end, dtype=float))
        scene.ngeom += 1

    def picture(self):
        return self.renderer.render()


def page(image, n_plots, title):
    """A figure with the picture on the left and plots on the right."""
    figure = plt.figure(figsize=(12.4, 5.2))
    grid = figure.add_gridspec(n_plots, 2, width_ratios=(1.0, 1.05), wspace=0.16, hspace=0.28)
    left = figure.add_subplot(grid[:, 0])
    left.imshow(image)
    left.set_axis_off()
    left.set_title(title, fontsize=11, loc="left")
    axes = [figure.add_subplot(grid[i, 1]) for i in range(n_plots)]
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes[:-1]:
        axis.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time [s]")
    return figure, axes


def save(figure, path):
    figure.subplots_adjust(left=0.01, right=0.985, top=0.93, bottom=0.105)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    print(f"written to {path}")


# --- the three scenes


def draw_freedrive(out):
    """A push of 15 N for 0.8 s in freedrive; the arm stays where it was left and is held there."""
    force = np.array([0.0, 15.0, 0.0])
    run = Run(
        0.2, "def guide():\n  freedrive_mode()\n  sleep(2.5)\n  end_freedrive_mode()\n  sleep(10)\nend\n"
    )
    run.go_on(0.5).go_on(0.8, Push(tuple(force))).go_on(1.7, Push((0.0, 0.0, 0.0)))
    run.go_on(0.5, Push(tuple(force))).go_on(0.5, Push((0.0, 0.0, 0.0)))
    t, place, q, mode = run.time, run.column("place"), run.column("q"), run.column("mode")
    stage = Stage(run.controller)
    stage.camera.azimuth, stage.camera.elevation, stage.camera.distance = 152, -22, 1.2
    stage.camera.lookat[:] = (0.15, 0.03, 0.17)
    stage.show(q[-1])
    for when in (0.4, 0.9, 1.1):
        stage.add_ghost(q[round(when / PERIOD)], JOINT, 0.18)
    stage.add_line(place[::4] - [0.0, 0.0, 0.01], PUSH, 0.004)
    stage.add_arrow(place[0] + [0.04, 0.0, 0.0], place[0] + [0.04, 0.0, 0.0] + 0.012 * force, PUSH)
    displacement = 1e3 * np.linalg.norm(place - place[0], axis=1)
    speed = 1e3 * np.linalg.norm(run.column("speed")[:, :3], axis=1)
    moved, held = (
        displacement[round(2.4 / PERIOD)],
        np.abs(displacement - displacement[round(2.9 / PERIOD)])[round(3.0 / PERIOD) :].max(),
    )
    figure, (upper, lower) = page(
        stage.picture(), 2, f"freedrive_mode: {force[1]:.0f} N sideways move the tool {moved:.0f} mm"
    )
    for axis in (upper, lower):
        axis.axvspan(0.5, 1.3, color=RED, alpha=0.12, lw=0)
        axis.axvspan(3.0, 3.5, color=RED, alpha=0.12, lw=0)
        axis.axvline(2.5, color=GREY, lw=1, ls="--")
    upper.plot(t, displacement, color=BLUE)
    upper.set_ylabel("displacement of the tool [mm]")
    upper.text(0.9, 0.9 * displacement.max(), "push", color=RED, ha="center")
    upper.text(3.25, 0.45 * displacement.max(), "the same push,\nheld", color=RED, ha="center")
    upper.text(
        2.46,
        0.12 * displacement.max(),
        "end_freedrive_mode",
        rotation=90,
        color="0.35",
        ha="right",
        fontsize=8,
    )
    lower.plot(t, speed, color=BLUE)
    lower.set_ylabel("tool speed [mm/s]")
    assert set(mode) == {ControlMode.TEACH, ControlMode.POSITION}
    print(
        f"freedrive: moved {displacement[round(1.3 / PERIOD)]:.1f} mm when the push ends, {moved:.1f} mm "
        f"in the end, top speed {speed.max():.0f} mm/s, "
        f"held within {held:.2f} mm afterwards"
    )
    save(figure, out / "contact_freedrive.png")


def draw_force_mode(out):
    """20 N on the table; then a movel of 80 mm over it on top."""
    asked = 20.0
    run = Run(
        0.03,
        "def press():\n  sleep(1)\n"
        f"  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-{asked:g},0,0,0], 2, "
        "[0.02,0.02,0.05,0.1,0.1,0.1])\n"
        "  sleep(4.5)\n  movel(pose_add(get_target_tcp_pose(), p[0,0.08,0,0,0,0]), a=0.5, v=0.05)\n"
        "  sleep(1.5)\n  end_force_mode()\n"
        "  movel(pose_add(get_target_tcp_pose(), p[0,0,0.05,0,0,0]), v=0.1)\nend\n",
    ).go_on(10.2)
    t, place, true = run.time, run.column("place"), run.column("contact")[:, 2]
    felt = run.column("felt")[:, 2]
    pressing = (t > 4.0) & (t < 5.5)
    sliding = (t > 5.8) & (t < 7.0)
    stage = Stage(run.controller)
    at = round(6.2 / PERIOD)
    stage.camera.distance, stage.camera.elevation = 0.95, -12
    stage.camera.lookat[:] = (0.22, 0.02, 0.09)
    stage.show(run.column("q")[at])
    stage.add_ghost(run.column("q")[0], JOINT, 0.15)
    foot = place[at] + np.array((0.08, -0.06, 0.005))
    stage.add_arrow(foot, foot + np.array((0.0, 0.0, 0.007 * true[at])), CONTACT, 0.009)
    mean = true[pressing].mean()
    figure, (upper, lower) = page(
        stage.picture(), 2, f"force_mode: {asked:.0f} N asked, {mean:.1f} N on the table"
    )
    upper.axhspan(0.9 * asked, 1.1 * asked, color=GREEN, alpha=0.15, lw=0)
    upper.axhline(asked, color=GREEN, lw=0.8)
    upper.plot(t, felt, color=GREY, lw=0.5, label="as the box feels it (actual_TCP_force)")
    upper.plot(t, true, color=BLUE, lw=1.3, label="true contact force")
    upper.set_ylim(-12, 45)
    upper.annotate(f"impact at 50 mm/s:\n{true.max():.0f} N for {(true > 45).sum() * 8} ms",
                   (t[true.argmax()], 44), (3.0, 36), fontsize=8)  # fmt: skip
    upper.set_ylabel("force along z [N]")
    upper.legend(fontsize=8, loc="lower center", framealpha=0.9)
    lower.plot(t, 1e3 * (place[:, 2] - TABLE_HEIGHT), color=BLUE, label="height of the tool above the table")
    lower.plot(t, 1e3 * place[:, 1], color=RED, label="with the displacement of the move")
    lower.set_ylabel("[mm]")
    lower.legend(fontsize=8, loc="upper left")
    for axis in (upper, lower):
        for when in (t[run.column("mode") == ControlMode.FORCE][[0, -1]]).tolist():
            axis.axvline(when, color=GREY, lw=1, ls="--")
    print(
        f"force mode: pressing {mean:.2f} N (sd {true[pressing].std():.2f}), "
        f"drawn over the table {true[sliding].mean():.2f} N (sd {true[sliding].std():.2f})"
    )
    save(figure, out / "contact_force_mode.png")


def draw_protective_stop(out):
    """A movel to a point 100 mm below the table."""
    run = Run(0.1, f"def crash():\n  movel({DOWN.format(z=TABLE_HEIGHT - 0.1)}, v=0.1)\nend\n").go_on(2.8)
    t, place, target = run.time, run.column("place"), run.column("target_pose")
    when, error = run.errors[0]
    stage = Stage(run.controller)
    at = round(when / PERIOD)
    stage.camera.distance, stage.camera.elevation = 0.95, -12
    stage.camera.lookat[:] = (0.22, 0.02, 0.09)
    stage.show(run.column("q")[-1])
    stage.add_ghost(run.column("q")[0], JOINT, 0.15)
    stage.add_ghost(run.column("target_q")[at - 1], PUSH, 0.35)
    start, goal = place[0], np.array([*place[0][:2], TABLE_HEIGHT - 0.1])
    side = np.array([0.08, -0.06, 0.0])
    stage.add_arrow(start + side, goal + side, PUSH, 0.008)
    figure, (upper, lower) = page(
        stage.picture(), 2, f"movel into the table: protective stop C{error.code} after {when:.2f} s"
    )
    upper.axhspan(-40, 0, color="#caa97a", alpha=0.35, lw=0)
    upper.plot(t, 1e3 * (target[:, 2] - TABLE_HEIGHT), color=RED, lw=1, label="target")
    upper.plot(t, 1e3 * (place[:, 2] - TABLE_HEIGHT), color=BLUE, label="tool")
    upper.text(0.05, -30, "table", color="#7a5c2e")
    upper.set_ylabel("height [mm]")
    upper.set_ylim(-40, 130)
    upper.legend(fontsize=8)
    force = run.column("contact")[:, 2]
    lower.plot(t, force, color=BLUE)
    lower.set_ylabel("true contact force [N]")
    for axis in (upper, lower):
        axis.axvline(when, color=GREY, lw=1, ls="--")
    lower.text(
        when + 0.03,
        0.55 * force.max(),
        f"C{error.code}:\n{error.text.split(': ')[-1]}",
        fontsize=8,
        color="0.3",
    )
    touched = t[np.argmax(force > 0)]
    assert run.column("safety")[-1] == SafetyMode.PROTECTIVE_STOP
    print(
        f"protective stop: touched at {touched:.2f} s, C{error.code} '{error.text}' "
        f"{1e3 * (when - touched):.0f} ms later, "
        f"largest force {force.max():.0f} N, {force[-1]:.0f} N at rest, "
        f"sunk in {-1e3 * (place[:, 2].min() - TABLE_HEIGHT):.2f} mm"
    )
    save(figure, out / "contact_protective_stop.png")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "img")
    parser.add_argument("--only", choices=PICTURES)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        if given.only in (None, name):
            draw(given.out)


PICTURES = {
    "freedrive": draw_freedrive,
    "force_mode": draw_force_mode,
    "protective_stop": draw_protective_stop,
}


if __name__ == "__main__":
    main()
