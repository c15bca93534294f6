"""Plot desired and actual TCP speed of recordings, like figures 4 and 5 of the paper."""

import argparse
from pathlib import Path

from matplotlib.axes import Axes

from pc_client.analysis.run import MeasuredRun, analyse_run
from pc_client.analysis.run_figures import plot_speed
from pc_client.recording.recording import load_recording
from pc_client.results.figures import BLUE, REFERENCE_GREY, figure, image_bytes, label_axes, show_legend


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, default=Path("speed.png"))
    options = parser.parse_args()
    runs = [analyse_run(load_recording(path)) for path in options.recordings]
    with figure(0.6 + 2.6 * len(runs), runs[0].provenance.origin.mark) as page:
        for axes, run in zip(page.subplots(len(runs), 1, squeeze=False)[:, 0], runs, strict=True):
            draw(axes, run)
    options.out.write_bytes(image_bytes(page))
    print(f"written to {options.out}")


def draw(axes: Axes, run: MeasuredRun) -> None:
    plot_speed(axes, run, REFERENCE_GREY, "desired", desired=True, width=4.0)
    plot_speed(axes, run, BLUE, "actual")
    title = f"{run.provenance.movement}, {run.provenance.controller}: SNR {run.snr.speed_db:.1f} dB"
    span = (-0.2, run.track.t_end - run.track.t_start + 0.3)
    label_axes(axes, title, "time since the movement began [s]", "TCP speed [mm/s]", span, 0.0)
    show_legend(axes, "above")


if __name__ == "__main__":
    main()
