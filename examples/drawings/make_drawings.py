"""Makes the drawings of this folder: `python examples/drawings/make_drawings.py`.

Nobody drew them. A mark is a chain of quick reaches between points, each with the minimum-jerk profile of a
hand and begun before the one before it ends, so that corners are rounded. Then it is spoiled as recorders do:
a browser gives whole pixels at irregular times, a tablet fractions of a millimetre 200 times a second.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

FOLDER = Path(__file__).parent
Array = NDArray[np.float64]

#: Of each mark the points "x y" and how long a reach between two of them lasts [s].
LETTER_T = (("20 22, 52 20, 82 23", 0.25), ("51 21, 49 55, 50 92", 0.22))
LETTER_I = (("46 40, 50 62, 47 84, 56 92, 64 86", 0.16), ("48 18, 48 18", 0.05))
ELLE = (
    (
        "8 70, 24 62, 30 44, 20 40, 16 60, 28 74, 44 50, 48 12, 38 10, 36 52, 46 74, 62 50, 66 12, 56 10, "
        "54 52, 64 74, 80 62, 86 44, 76 40, 72 60, 82 74, 98 66",
        0.13,
    ),
)
ZIGZAG = (("10 80, 24 20, 38 82, 52 18, 66 80, 80 22, 94 78", 0.2),)
SIGNATURE = (
    "4 30, 14 8, 22 6, 18 26, 10 42, 24 34, 34 24, 40 32, 48 24, 54 32, 62 22, 66 2, 60 4, 62 34, 74 30, "
    "84 22, 92 30, 70 44, 20 48, 60 46, 110 40",
    0.12,
)
Marks = Sequence[tuple[str, float]]


def reaches(points: str, duration: float, step: Array) -> tuple[Array, Array]:
    """Times (n,) and positions (n, 2): each reach begins when two thirds of the one before it are over.

    Args:
        points: "x y" of each.
        duration: of a reach [s].
        step: times between samples, enough of them [s].
    """
    places = np.array([point.split() for point in points.split(",")], dtype=np.float64)
    begins = 2.0 / 3.0 * duration * np.arange(len(places) - 1)
    t = np.append(0.0, np.cumsum(step))
    t = t[t < begins[-1] + duration]
    u = np.clip((t[:, None] - begins) / duration, 0.0, 1.0)
    return t, places[0] + (10.0 * u**3 - 15.0 * u**4 + 6.0 * u**5) @ np.diff(places, axis=0)


def browser(marks: Marks, seed: int, y: float) -> Iterator[str]:
    """Lines of a recording by mouse events: pixels and milliseconds, y times a sign."""
    rng = np.random.default_rng(seed)
    begin = 0.0
    yield "START"
    for points, duration in marks:
        step = rng.choice([0.0, 0.007, 0.008, 0.008, 0.009, 0.016, 0.024], size=2000)
        t, p = reaches(points, duration, step)
        for (px, py), now in zip(np.round(p + rng.normal(0.0, 0.15, p.shape)) * (1.0, y), t, strict=True):
            yield f"{px + 0.0:g},{py + 0.0:g},{1e3 * (begin + now):.0f}"
        yield "BREAK"
        begin += float(t[-1]) + 0.45


def tablet(points: str, duration: float, seed: int) -> Iterator[str]:
    """Lines of a recording by a tablet: millimetres and seconds, with a first line of names."""
    t, p = reaches(points, duration, np.full(2000, 0.005))
    yield "t,x,y"
    for now, (px, py) in zip(t, p + np.random.default_rng(seed).normal(0.0, 0.01, p.shape), strict=True):
        yield f"{now:.3f},{px:.2f},{py:.2f}"


def drawings() -> dict[str, str]:
    """The content of each file by its name."""
    lines = {
        "letter_t.txt": browser(LETTER_T, 1, 1.0),
        "letter_i.txt": browser(LETTER_I, 2, -1.0),
        "elle.txt": browser(ELLE, 3, 1.0),
        "zigzag.txt": browser(ZIGZAG, 4, 1.0),
        "signature.csv": tablet(*SIGNATURE, 5),
    }
    return {name: "\n".join(file) + "\n" for name, file in lines.items()}


if __name__ == "__main__":
    for name, text in drawings().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
