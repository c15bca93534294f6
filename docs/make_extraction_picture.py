"""Draws docs/img/extraction.png: a movement of the library, recorded badly, and the strokes found in it.

`python -m docs.make_extraction_picture` from the root of the checkout. Needs the extra `report`.
"""

import argparse
from pathlib import Path

import numpy as np

from pc_client.movements.movement import load_movement
from pc_client.studies.extraction.extract import extract
from pc_client.studies.extraction.figures import draw_extraction
from pc_client.studies.extraction.pen import PenRecording, on_one_axis, ordered_part


def bad_recording(name: str, seed: int) -> PenRecording:
    """Millimetres, rounded to half of one, at the irregular times of a browser's mouse events."""
    movement = load_movement(name)
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.choice([0.001, 0.008, 0.016, 0.024], size=800))
    t = t[t < movement.duration]
    part, _ = ordered_part(t, np.round(2e3 * movement.sample(t).p[:, :2]) / 2.0)
    return on_one_axis(f"{name}, recorded badly", [] if part is None else [part])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "img" / "extraction.png")
    picture = draw_extraction(extract(bad_recording("lognorm_5_2", seed=1)))
    parser.parse_args().out.write_bytes(picture)
