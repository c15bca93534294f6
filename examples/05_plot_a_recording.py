"""Plot desired and actual TCP speed of recordings, like figures 4 and 5 of the paper."""

import argparse
from pathlib import Path

from pc_client.analysis.run import MeasuredRun, analyse_run, speed_curve
from pc_client.recording.recording import load_recording
from pc_client.results.matplotlib_figures import draw, image_bytes
from pc_client.results.sheet import BLUE, REFERENCE_GREY, WIDTH, Box, Panel, Sheet, boxes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, default=Path("speed.png"))
    options = parser.parse_args()
    runs = [analyse_run(load_recording(path)) for path in options.recordings]
    height = 0.6 + 2.6 * len(runs)
    grid = boxes((WIDTH, height), [1], [1] * len(runs), margins=(0.8, 0.2, 0.6, 0.6), gaps=(0.0, 0.6))
    panels = [panel(box, run, run is runs[-1]) for (box,), run in zip(grid, runs, strict=True)]
    options.out.write_bytes(image_bytes(draw(Sheet(height, panels, runs[0].provenance.origin.mark))))
    print(f"written to {options.out}")


def panel(box: Box, run: MeasuredRun, last: bool) -> Panel:
    curves = (
        speed_curve(run, REFERENCE_GREY, "desired", desired=True, width=4.0),
        speed_curve(run, BLUE, "actual"),
    )
    title = f"{run.provenance.movement}, {run.provenance.controller}: SNR {run.snr.speed_db:.1f} dB"
    labels = ("time since the movement began [s]" if last else "", "TCP speed [mm/s]")
    span = (-0.2, run.track.t_end - run.track.t_start + 0.3)
    return Panel(box, curves, title, labels, (span, (0.0, None)), "above")


if __name__ == "__main__":
    main()
