"""Pick a block up and put it elsewhere, like a hand and like a robot: `make pick` runs this.

Both ways lead through the same points in the same time. The hand's strokes are lognormal, the robot's are
trapezoids of speed. The client moves the arm, closes and opens the gripper, and declares what it holds; on a
real arm with the same gripper only the address differs. The box is asked what becomes of the block.

Results in out/pick: index.html, and the film pick.gif.
"""

import argparse
import base64
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import polars as pl
from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from rich.console import Console

import pc_client as ur
from pc_client.arrays import Array
from pc_client.kinematics.model import tcp_pose
from pc_client.movements.movement import Style
from pc_client.planning.joint_spline import JointSpline
from pc_client.recording.provenance import origin_of
from pc_client.results.figures import BLUE, ORANGE, REFERENCE_GREY, figure, label_axes, shade
from pc_client.results.pages import picture
from pc_client.results.tables import Column, frame_of, to_html, to_rich
from protocol.realtime.layout import RealtimeFrame
from ur_emulator import ControlBox
from ur_hil.tools import TOOLS

HERE = Path(__file__).parent
TOOL, BENCH = TOOLS["robotiq-2f85"], HERE / "pick.toml"
STYLES: dict[Style, str] = {"human": "lognormal strokes", "robot": "trapezoids of speed"}
COLOURS = {"human": BLUE, "robot": ORANGE}
FPS = 8

# Where the middle of the pads goes [m]. The block stands upright and is held near its top.
GRIP, PLACE, UP = np.array((0.5, 0.2, 0.035)), np.array((0.5, -0.2, 0.036)), np.array((0.0, 0.0, 0.16))
START = np.array((0.42, -0.05, 0.3))
# Points, and durations of the strokes between them [s].
WAYS = {
    "reach": ((START, GRIP + UP, GRIP), (1.6, 1.1)),
    "carry": ((GRIP, GRIP + UP, PLACE + UP, PLACE), (1.1, 2.0, 1.4)),
    "withdraw": ((PLACE, PLACE + UP), (1.1,)),
}
HALF_BLOCK, BLOCK_MASS = np.array((0.02, 0.02, 0.04)), 0.2
FORCE = 80.0  # N
TOP_SPEED = 900.0  # mm/s, of the axes
MARK = origin_of(True).mark

SETTINGS = f"""
def settings():
  set_tcp(p[0, 0, {TOOL.length}, 0, 0, 0])
  set_payload({TOOL.mass}, {list(TOOL.cog)})
end
"""


def movement(name: str, style: Style) -> ur.Movement:
    """One of the ways in one of the styles, tool down, fingers along x."""
    points, durations = WAYS[name]
    through = ur.Movement.through(points, style, durations)
    t = np.arange(0.0, through.duration + 1e-9, 0.004)
    down = np.tile((np.pi, 0.0, 0.0), (len(t), 1))
    return ur.Movement.from_samples(t, through.sample(t).p, down, name=f"{name}_{style}")


class Follow:
    """A velocity law that follows a plan from where the arm stands, ahead by the delay of the loop [s].

    `Arm.run` would turn all joints by a degree first, to find this delay: not with a block on the table.
    """

    def __init__(self, spline: JointSpline, delay: float) -> None:
        self.spline, self.delay, self.begin = spline, delay, 0.0

    def __call__(self, frame: RealtimeFrame) -> Array | None:
        """Six velocities for a frame [rad/s], or None at the end."""
        self.begin = self.begin or frame.timestamp
        t, end = frame.timestamp - self.begin, self.spline.duration
        if t > end + 0.3:  # the feedback has ended what was left
            return None
        q, _ = self.spline.at(min(t, end))
        _, qd = self.spline.at(min(t + self.delay, end))
        velocities: Array = np.asarray(qd) + 5.0 * (np.asarray(q) - frame.actual_q)
        return velocities


@dataclass
class Stage:
    """A movement as it was done: its time in the box [s], speeds of the TCP [m/s], and Eq. 10 [dB]."""

    name: str
    t: Array
    speed: Array
    wanted: Array
    snr: float


@dataclass
class Take:
    """A style: its stages, and what the box reported meanwhile, one row a sample."""

    style: Style
    stages: list[Stage] = field(default_factory=list)
    seen: list[tuple[Any, ...]] = field(default_factory=list)
    held: bool = False

    def column(self, index: int) -> Array:
        """0: time [s], 1: joints [rad], 2: pose of the block [m, rad], 3: width between the pads [m]."""
        return np.array([row[index] for row in self.seen])

    @property
    def begin(self) -> float:
        """When the first movement began, in the time of the box [s]."""
        return float(self.stages[0].t[0])

    @property
    def missed(self) -> Array:
        """How far the block stands from where it should [mm], (2,): along the table."""
        millimetres: Array = 1e3 * (self.column(2)[-1, :2] - PLACE[:2])
        return millimetres


@contextmanager
def watched(box: ControlBox, take: Take) -> Iterator[None]:
    """Keep asking the box how arm, fingers and block are."""
    end = Event()

    def look() -> None:
        now = box.state
        take.seen.append((now.time, now.q, now.things[0].pose, now.grippers[0]["width"]))

    def watch() -> None:
        while not end.wait(0.015):
            look()

    thread = Thread(target=watch)
    thread.start()
    try:
        yield
        look()
    finally:
        end.set()
        thread.join()


def pick(box: ControlBox, arm: ur.Arm, style: Style) -> Take:
    """Reach, grip, carry, place and withdraw."""
    take, hand = Take(style), arm.gripper
    box.move_thing("block", (*GRIP[:2], 0.02, 0.0, 0.0, 0.0))
    hand.force(FORCE)
    hand.open()
    plan = ur.plan(movement("reach", style), arm)
    with watched(box, take):
        run = arm.run(plan)
        stamp = run.recording.column("timestamp")[-1] - run.t[-1]
        take.stages.append(replace(stage("reach", plan, run, stamp), snr=run.snr))
        delay = run.recording.provenance.identified_delay_s
        assert delay is not None  # `Arm.run` measures it

        hand.close()
        take.held = hand.is_holding
        mass = TOOL.mass + BLOCK_MASS
        z = (TOOL.mass * TOOL.cog[2] + BLOCK_MASS * TOOL.length) / mass
        arm.set_payload(mass, (0.0, 0.0, z))
        take.stages.append(follow(arm, "carry", style, delay))

        hand.open()
        arm.set_payload(TOOL.mass, TOOL.cog)
        take.stages.append(follow(arm, "withdraw", style, delay))
    return take


def follow(arm: ur.Arm, name: str, style: Style, delay: float) -> Stage:
    """Go one of the ways from where the arm stands."""
    plan = ur.plan(movement(name, style), arm)
    turns = np.rint((arm.frame().actual_q - plan.joints.start_q) / (2.0 * np.pi))
    law = Follow(plan.joints.shifted(turns).spline, delay)
    return stage(name, plan, arm.stream(law, acceleration=40.0), law.begin)


def stage(name: str, plan: ur.Plan, signals: ur.Signals, begin: float) -> Stage:
    """What became of a plan that began at that time of the box [s]."""
    moving = (signals.t >= 0.008) & (signals.t <= plan.movement.duration)
    t, actual = signals.t[moving], signals.tcp_speed[moving]
    way = plan.movement.sample(t).p - plan.movement.sample(t - 0.008).p  # over 8 ms, as the arm's speed
    wanted = np.linalg.norm(way, axis=1) / 0.008
    snr = 10.0 * np.log10(np.sum(wanted**2) / np.sum((actual - wanted) ** 2))
    return Stage(name, begin + t, actual, wanted, float(snr))


# --- what came of it


def curves(takes: list[Take]) -> Figure:
    """Speed, width and height over time, one column a style."""
    span = (0.0, max(take.column(0)[-1] - take.begin for take in takes))
    with figure(6.6, MARK) as page:
        grid = page.subplots(3, len(takes), height_ratios=(1.6, 1, 1), squeeze=False)
        for (speed, width, height), take in zip(grid.T, takes, strict=True):
            colour = COLOURS[take.style]
            for one in take.stages:
                t = one.t - take.begin
                speed.plot(t, 1e3 * one.wanted, color=REFERENCE_GREY, lw=4.0)
                speed.plot(t, 1e3 * one.speed, color=colour, lw=1.1)
                speed.text(t.mean(), 0.95 * TOP_SPEED, one.name, ha="center", va="center")
            t = take.column(0) - take.begin
            width.plot(t, 1e3 * take.column(3), color=colour)
            height.plot(t, 1e3 * take.column(2)[:, 2], color=colour)
            for axes in (speed, width, height):
                shade(axes, np.array([(one.t[0], one.t[-1]) for one in take.stages]) - take.begin)
            title = f"{take.style} style: {STYLES[take.style]}"
            label_axes(speed, title, "", "TCP speed [mm/s]", span, 0.0, TOP_SPEED)
            label_axes(width, "", "", "between the pads [mm]", span, 0.0, 90.0)
            label_axes(height, "", "time [s]", "block, height [mm]", span, 0.0, 220.0)
    return page


FIGURES = (
    Column("style", align="left", kind=str),
    Column("reach", unit="dB", format=".1f"),
    Column("carry", unit="dB", format=".1f"),
    Column("withdraw", unit="dB", format=".1f"),
    Column("top", "top speed", "mm/s", ".0f"),
    Column("width", "width gripped", "mm", ".1f", missing="nothing"),
    Column("missed", "block off its place", "mm", ".1f"),
)


def figures(take: Take) -> dict[str, float | str | None]:
    """A row of the table."""
    return {
        "style": take.style,
        **{stage.name: stage.snr for stage in take.stages},
        "top": 1e3 * max(stage.speed.max() for stage in take.stages),
        "width": 1e3 * take.column(3).min() if take.held else None,
        "missed": float(np.linalg.norm(take.missed)),
    }


# The picture is seen from the front, from the right and from above.
_AZIMUTH, _ELEVATION = np.radians((35.0, 22.0))
_VIEW = np.array(
    (
        (-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0),
        (
            -np.cos(_AZIMUTH) * np.sin(_ELEVATION),
            -np.sin(_AZIMUTH) * np.sin(_ELEVATION),
            np.cos(_ELEVATION),
        ),
    )
)
_GAP = np.full(3, np.nan)


def skeleton(arm: ur.Arm, q: Array, width: float) -> tuple[Array, Array]:
    """The axes of the arm from base to flange, and palm and fingers: lines in space (n, 3) [m]."""
    T, model = tcp_pose(arm.model, q), arm.model
    joints = [model.pin_data.oMi[i].translation.copy() for i in range(1, 7)]
    flange = model.pin_data.oMf[model.flange_frame].translation.copy()
    tip, x, z = T[:3, 3], T[:3, 0], T[:3, 2]
    palm, half = tip - 0.05 * z, 0.5 * width * x
    fingers = [tip + half, palm + half, palm, flange, palm, palm - half, tip - half]
    return np.array([np.zeros(3), *joints, flange]), np.array(fingers)


def box_edges(middle: Array, half: Array) -> Array:
    """The edges of an upright box, as one line with gaps (n, 3) [m]."""
    square = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)))
    rings = [np.c_[square, np.full(5, side)] for side in (-1, 1)]
    posts = [row for corner in square[:4] for row in ((*corner, -1), (*corner, 1), _GAP)]
    edges: Array = middle + half * np.vstack([rings[0], _GAP, rings[1], _GAP, *posts])
    return edges


def save_film(arm: ur.Arm, takes: list[Take], path: Path) -> None:
    """The arms as stick figures beside each other, each with its speed below it."""
    longest = max(take.column(0)[-1] - take.begin for take in takes)
    times = np.arange(0.0, longest + 0.5, 1.0 / FPS)
    with figure(4.4, MARK, width=4.6 * len(takes), layout=None) as page:
        FigureCanvasAgg(page)
        page.set_dpi(66)
        grid = page.subplots(2, len(takes), height_ratios=(3.6, 1), squeeze=False)
        page.subplots_adjust(0.08, 0.11, 0.98, 0.9, hspace=0.08)
        updates = [scene(arm, take, tuple(grid[:, k]), longest) for k, take in enumerate(takes)]

    film = PillowWriter(fps=FPS)
    with film.saving(page, path, dpi=page.dpi):
        for t in times:
            for update in updates:
                update(t)
            film.grab_frame()


def scene(arm: ur.Arm, take: Take, pair: tuple[Axes, Axes], longest: float) -> Callable[[float], None]:
    """Set up the two pictures of a style; returns what draws them at a time [s]."""
    space, below = pair
    t, colour = take.column(0) - take.begin, COLOURS[take.style]
    q, blocks, widths = (take.column(k) for k in (1, 2, 3))
    middles = blocks[:, :3]
    path = np.array([tcp_pose(arm.model, one)[:3, 3] for one in q])

    def draw_line(points: Array, **style: Any) -> Line2D:
        line: Line2D
        (line,) = space.plot(*(_VIEW @ points.T), **style)
        return line

    def between(values: Array, now: float) -> Array:
        return np.array([np.interp(now, t, column) for column in np.atleast_2d(values.T)])

    space.set(xlim=(-0.62, 0.46), ylim=(-0.32, 0.6), xticks=(), yticks=(), aspect="equal")
    space.set_title(f"{take.style} style")
    for spine in space.spines.values():
        spine.set_visible(False)
    table = np.array(((-0.15, -0.42), (0.68, -0.42), (0.68, 0.42), (-0.15, 0.42), (-0.15, -0.42)))
    draw_line(np.c_[table, np.full(5, -0.02)], color="#CCCCCC", lw=1.0)
    place = np.array((*PLACE[:2], -0.02))
    draw_line(box_edges(place, HALF_BLOCK * (1, 1, 0)), color="#777777", lw=1.2)
    links = draw_line(np.zeros((8, 3)), color="#444444", lw=5.0, marker="o", ms=6.0, mfc="white")
    trail = draw_line(np.zeros((1, 3)), color=colour, lw=1.2)
    edges = draw_line(np.zeros((1, 3)), color="#8B4513", lw=1.6)
    hand = draw_line(np.zeros((7, 3)), color=colour, lw=3.0)
    for one in take.stages:
        below.plot(one.t - take.begin, 1e3 * one.wanted, color=REFERENCE_GREY, lw=2.5)
        below.plot(one.t - take.begin, 1e3 * one.speed, color=colour, lw=1.0)
    below.set(xlim=(0.0, longest), ylim=(0.0, TOP_SPEED), xlabel="time [s]", ylabel="TCP [mm/s]")
    cursor = below.axvline(0.0, color="#1C1C1C", lw=1.0)

    def update(now: float) -> None:
        lines = skeleton(arm, between(q, now), float(between(widths, now)[0]))
        done = path[(t >= 0.0) & (t <= now)]
        points = (*lines, box_edges(between(middles, now), HALF_BLOCK), done)
        for line, shown in zip((links, hand, edges, trail), points, strict=True):
            line.set_data(*(_VIEW @ shown.T))
        cursor.set_xdata([now, now])

    return update


def page(arm: ur.Arm, takes: list[Take], film: bytes, table: pl.DataFrame) -> str:
    """The page with the film and all figures."""
    ours = Path(ur.__file__).parent
    templates = Environment(loader=FileSystemLoader([HERE, ours]), autoescape=True, trim_blocks=True)
    image = Markup(
        '<img src="data:image/gif;base64,{}" alt="Film of the arm" style="max-width: 800px">'
    ).format(base64.b64encode(film).decode())
    return templates.get_template("pick.html.j2").render(
        takes=[{**figures(take), "held": take.held, "colour": COLOURS[take.style]} for take in takes],
        robot=arm.model.title,
        tool=TOOL.title,
        styles=" and ".join({"human": "like a hand", "robot": "like a robot"}[take.style] for take in takes),
        controller=ur.Controller.preview().title,
        film=image,
        curves=picture(curves(takes), "Speed, width of the gripper, height of the block over time"),
        table=Markup(to_html(table, FIGURES)),
        origin=origin_of(True),
        seed=arm.report.info.seed,
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="Pick a block up like a hand and like a robot.")
    parser.add_argument("--out", type=Path, default=Path("out/pick"))
    parser.add_argument("--seed", type=int, default=7)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        with ControlBox(
            "ur5e", pace="lockstep", port_base=None, seed=options.seed, tool=TOOL.name, scene=BENCH
        ) as box:
            box.run_program(SETTINGS, wait=True)
            arm = ur.connect(box.host, box.ports, cell=BENCH, tool=TOOL.name)
            takes = [pick(box, arm, style) for style in STYLES]
    except ur.ClientError as error:
        sys.exit(f"pick: {error}")
    table = frame_of(map(figures, takes), FIGURES)
    save_film(arm, takes, options.out / "pick.gif")
    film = (options.out / "pick.gif").read_bytes()
    (options.out / "index.html").write_text(page(arm, takes, film, table), encoding="utf-8")
    Console(highlight=False).print(to_rich(table, FIGURES, title="SNR of the TCP speed, and the block"))
    print(f"page: {options.out / 'index.html'}, film: {len(film) / 1e6:.2f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
