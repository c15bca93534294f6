"""The moving picture of the README: the emulated UR3 on a lognormal movement, beside the speed of its TCP.

`python -m docs.make_arm_picture` runs the movement on a box in lockstep and writes docs/img/arm.svg. The arm
is drawn from its own kinematics and the angles that the box has reported; the time is that of the run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import pc_client as ur
from pc_client.kinematics.model import RobotModel
from ur_emulator import ControlBox

MOVEMENT = "lognorm_5_1"
WIDTH, HEIGHT = 960, 400
STEP, PAUSE = 0.08, 1.2  # s
SCALE, CENTRE = 780.0, (125.0, 318.0)  # pixels a metre; where the base stands
AZIMUTH, ELEVATION = math.radians(-52.0), math.radians(22.0)  # where the eye is: from x to y, above the floor
LINKS = ((0, 2, 24.0), (2, 3, 20.0), (3, 7, 14.0))  # first and last of the joint points, width
PLOT = (530.0, 60.0, 400.0, 250.0)  # left, top, width, height
BLUE, ORANGE, GREY, INK = "#0072B2", "#D55E00", "#9a9a9a", "#333333"
STYLE = (
    "<style>polyline { fill: none; stroke-linejoin: round; stroke-linecap: round }"
    f" .target {{ fill: none; stroke: {BLUE}; stroke-width: 2 }}</style>"
)

Array = NDArray[np.float64]


def joint_points(model: RobotModel, q: Array) -> Array:
    """Origins of base, joints and TCP (8, 3) [m] in the base frame at angles (6,)."""
    pin.framesForwardKinematics(model.pin_model, model.pin_data, q)
    joints = [np.array(model.pin_data.oMi[k].translation) for k in range(1, 7)]
    return np.array([np.zeros(3), *joints, np.array(model.pin_data.oMf[model.tcp_frame].translation)])


def seen(points: Array) -> Array:
    """Points (..., 3) [m] as pixels (..., 2) from the eye."""
    x, y, z = np.moveaxis(points, -1, 0)
    across = -x * math.sin(AZIMUTH) + y * math.cos(AZIMUTH)
    nearer = x * math.cos(AZIMUTH) + y * math.sin(AZIMUTH)
    up = z * math.cos(ELEVATION) - nearer * math.sin(ELEVATION)
    return np.stack((CENTRE[0] + SCALE * across, CENTRE[1] - SCALE * up), axis=-1)


def text_of(points: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def animate(attribute: str, values: Sequence[str], duration: float) -> str:
    time = f'dur="{duration:g}s" repeatCount="indefinite"'
    return f'<animate attributeName="{attribute}" {time} values="{";".join(values)}"/>'


def line(points: Array, colour: str, width: float, extra: str = "", inside: str = "") -> str:
    style = f'stroke="{colour}" stroke-width="{width:g}" {extra}'
    return f'<polyline points="{text_of(points)}" {style}>{inside}</polyline>'


def revealed(points: Array, done: Array, colour: str, duration: float) -> str:
    """A line that appears from its start; `done` is the share that is visible in each frame."""
    values = [f"{1.0 - share:.4f}" for share in done]
    inside = animate("stroke-dashoffset", values, duration)
    return line(points, colour, 2.5, 'pathLength="1" stroke-dasharray="1" stroke-dashoffset="0"', inside)


def dot(points: Array, colour: str, radius: float, duration: float) -> str:
    x, y = ([f"{value:.1f}" for value in column] for column in points.T)
    inside = animate("cx", x, duration) + animate("cy", y, duration)
    return f'<circle cx="{x[-1]}" cy="{y[-1]}" r="{radius:g}" fill="{colour}">{inside}</circle>'


def shares(points: Array, frames: Array) -> Array:
    """Share of the length of a line (n, 2) up to each of its points that the frames name."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return (np.concatenate(([0.0], np.cumsum(steps))) / steps.sum())[frames]


def arm(joints: Array, duration: float) -> Iterator[str]:
    """Links and joints; `joints` (frames, 8, 2) in pixels."""
    for begin, end, width in LINKS:
        part = joints[:, begin : end + 1]
        values = [text_of(points) for points in part]
        for colour, more in ((INK, 4.0), ("#c9d3da", 0.0)):
            yield line(part[0], colour, width + more, inside=animate("points", values, duration))
        for k in range(begin, end):
            yield dot(part[:, k - begin], "#5b7a8c", width / 3.0, duration)
    yield dot(joints[:, -1], ORANGE, 6.0, duration)


def label(x: float, y: float, text: str, anchor: str = "start", size: int = 14) -> str:
    return f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-size="{size}" fill="{INK}">{text}</text>'


def axes(duration: float, top_speed: float) -> Iterator[str]:
    left, top, width, height = PLOT
    for speed in np.arange(0.0, top_speed + 1e-9, 0.1):
        y = top + height * (1.0 - speed / top_speed)
        yield f'<path d="M{left:g} {y:.1f}h{width:g}" stroke="#dddddd"/>'
        yield label(left - 8, y + 5, f"{1e3 * speed:.0f}", "end")
    for t in range(0, int(duration) + 1, 2):
        yield label(left + width * t / duration, top + height + 22, str(t), "middle")
    yield label(left, top - 16, "speed of the TCP [mm/s]")
    yield label(left + width, top + height + 44, "time [s]", "end")


def picture(run: ur.Run, movement: ur.Movement, model: RobotModel) -> str:
    moving = (run.t >= 0.0) & (run.t <= movement.duration)
    t, q, speed = run.t[moving], run.q[moving], run.tcp_speed[moving]
    frames = np.searchsorted(t, np.arange(0.0, t[-1], STEP))
    frames = np.append(frames, np.full(round(PAUSE / STEP), len(t) - 1))  # it rests at the end
    duration = STEP * (len(frames) - 1)
    path = seen(np.array([joint_points(model, row)[-1] for row in q]))
    joints = seen(np.array([joint_points(model, row) for row in q[frames]]))
    top_speed = 0.1 * math.ceil(10.0 * speed.max())
    left, top, width, height = PLOT
    curve = np.stack((left + width * t / t[-1], top + height * (1.0 - speed / top_speed)), axis=-1)
    targets = seen(movement.target_points)
    floor = seen(np.array([[-0.12, -0.24, 0], [0.46, -0.24, 0], [0.46, 0.24, 0], [-0.12, 0.24, 0]]))
    thin = slice(None, None, 3)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
        STYLE,
        f"<title>The emulated UR3 on {MOVEMENT}: {run.snr:.1f} dB</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#ffffff"/>',
        f'<polygon points="{text_of(floor)}" fill="#f1f3f4" stroke="#dddddd"/>',
        line(path[thin], "#e3e3e3", 3.0),
        *arm(joints, duration),
        revealed(path[thin], shares(path[thin], frames // 3), ORANGE, duration),
        *(f'<circle class="target" cx="{x:.1f}" cy="{y:.1f}" r="4"/>' for x, y in targets),
        *axes(t[-1], top_speed),
        line(curve[thin], "#e3e3e3", 2.0),
        revealed(curve[thin], shares(curve[thin], frames // 3), BLUE, duration),
        dot(curve[frames], ORANGE, 5.0, duration),
        label(left, HEIGHT - 24, f"SIMULATED UR3, {MOVEMENT}, preview, SNR {run.snr:.1f} dB", size=13),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def main() -> None:
    movement = ur.Movement.library(MOVEMENT)
    with ControlBox(pace="lockstep", port_base=None, seed=7) as box:
        robot = ur.connect(box.host, box.ports)
        run = robot.run(movement, ur.Controller.preview())
    place = Path(__file__).parent / "img" / "arm.svg"
    place.write_text(picture(run, movement, robot.model), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
