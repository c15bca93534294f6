"""Plot desired and actual TCP speed of recordings like the paper's figures 4 and 5: the README's picture."""

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np

from pc_client.analysis.run import analyse_run
from pc_client.recording.layout import Phase
from pc_client.recording.loader import load_recording

mpl.use("agg")
import matplotlib.pyplot as plt


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, default=Path("speed.png"))
    options = parser.parse_args()
    figure, axes = plt.subplots(
        len(options.recordings), 1, figsize=(9, 2.6 * len(options.recordings)), squeeze=False
    )
    for axis, path in zip(axes[:, 0], options.recordings, strict=True):
        plot(axis, path)
    axes[-1, 0].set_xlabel("time since the movement began [s]")
    figure.tight_layout()
    figure.savefig(options.out, dpi=130)
    print(f"written to {options.out}")


def plot(axis, path):
    recording = load_recording(path)
    rows = recording.rows_of(Phase.MOVEMENT)
    t = recording.column("ref_t")[rows]
    desired, actual = (
        np.linalg.norm(np.diff(recording.column(name)[rows][:, :3], axis=0), axis=1) / np.diff(t) * 1e3
        for name in ("ref_tcp_position", "actual_TCP_pose")
    )
    axis.plot(t[1:], desired, color="0.45", linewidth=3.0, label="desired")
    axis.plot(t[1:], actual, color="#0072b2", linewidth=0.9, label="actual")
    run = analyse_run(recording)
    provenance = recording.provenance
    mark = provenance.origin.mark and f", {provenance.origin.mark}"
    title = f"{provenance.movement}, {provenance.controller}: SNR {run.snr.speed_db:.1f} dB{mark}"
    axis.set_title(title, loc="left", fontsize=10)
    axis.set_ylabel("TCP speed [mm/s]")
    axis.grid(alpha=0.3)
    axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), frameon=False, ncols=2)


if __name__ == "__main__":
    main()
