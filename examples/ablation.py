"""What each piece of the controller brings: `make ablation` runs this.

Runs the ten movements three times with every composition of the controller's pieces, on boxes of all three
fidelities in lockstep, then the best composition on further seeds and once in real time. Nothing is chosen
for a movement or a box: the compositions are the rows of `COMPOSITIONS`. Results: ablation.md, ablation.json
and ablation.png in the folder, the recordings in folders below it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import Any

import pc_client as ur
from pc_client.analysis.inference import paired_difference
from pc_client.analysis.measures import PARTS
from pc_client.analysis.run import analyse_run
from pc_client.analysis.table import build_table
from pc_client.movements.library_sets import library_names
from pc_client.recording.recording import load_recording
from ur_emulator import ControlBox

PAPER, PREVIEW, BEST = ur.Controller.paper(), ur.Controller.preview(), ur.Controller.best()
LAG = replace(BEST, compensates_gear=False, uses_ilc=False)

COMPOSITIONS: dict[str, tuple[ur.Controller, str]] = {
    "paper": (PAPER, "PI and feed-forward, as published"),
    "short ramp": (
        replace(PREVIEW, uses_preview=False, path_tolerance=PAPER.path_tolerance),
        "the robot's own ramp 40 rad/s2, other gains",
    ),
    "preview": (PREVIEW, "+ feed-forward ahead by the identified delay"),
    "lag": (LAG, "+ dead time and lag apart: qd + lag qdd, ahead by the dead time"),
    "lag, gear": (replace(LAG, compensates_gear=True), "lag + feed-forward against the waves of the gears"),
    "lag, learning": (replace(LAG, uses_ilc=True), "lag + learning between repetitions"),
    "preview, learning": (replace(LAG, compensates_lag=False, uses_ilc=True), "the same without lag"),
    "best": (BEST, "lag + gear + learning"),
}
FIDELITIES = ("ideal", "typical", "poor")
SEEDS = (0, 1, 2, 7)
KINDS = ("lognormal", "uniform")


def main() -> int:
    parser = argparse.ArgumentParser(description="What each piece of the controller brings.")
    parser.add_argument("--out", type=Path, default=Path("out/ablation"))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--quick", action="store_true", help="two movements, one composition, one box")
    parser.add_argument("--set", default="arcs", help="of the library; arcs is what docs/tracking.md shows")
    parser.add_argument("--movement", nargs="+", help="of the library, in place of a whole set")
    parser.add_argument(
        "--fidelity", nargs="+", help="boxes of these fidelities or files instead, and --composition on each"
    )
    parser.add_argument("--composition", nargs="+", choices=COMPOSITIONS, default=list(COMPOSITIONS))
    options = parser.parse_args()
    movements = options.movement or library_names(options.set)
    cases = [
        *((name, fidelity, options.seed, "lockstep") for fidelity in FIDELITIES for name in COMPOSITIONS),
        *(("best", "typical", seed, "lockstep") for seed in SEEDS if seed != options.seed),
        ("best", "typical", options.seed, "realtime"),
    ]
    if options.quick:
        movements = ["lognorm_4_1", "uniform_4_1"]
        cases = [("best", "typical", options.seed, "lockstep")]
    if options.fidelity:
        cases = [
            (name, fidelity, options.seed, "lockstep")
            for fidelity in options.fidelity
            for name in options.composition
        ]
    plans = [ur.plan(ur.Movement.library(name)) for name in movements]
    results: list[dict[str, Any]] = []
    for name, fidelity, seed, pace in cases:
        words = (name.replace(", ", "_").replace(" ", "_"), Path(fidelity).stem, str(seed), pace)
        folder = options.out / "-".join(words)
        try:
            result = run_case(name, fidelity, seed, pace, plans, folder)
        except ur.ClientError as error:
            print(f"{name:18} {fidelity:8} seed {seed} {pace:8}  {error}", flush=True)
            continue
        print(f"{name:18} {fidelity:8} seed {seed} {pace:8}  {result['summary']}", flush=True)
        results.append(result)
        write(results, options.out)
    return 0


def write(results: list[dict[str, Any]], out: Path) -> None:
    """Write the three files from what there is by now."""
    (out / "ablation.json").write_text(json.dumps(results, indent=1) + "\n")
    (out / "ablation.md").write_text(markdown(results))
    draw(results, out / "ablation.png")


def run_case(
    name: str, fidelity: str, seed: int, pace: str, plans: Sequence[ur.Plan], out: Path
) -> dict[str, Any]:
    """Run the movements with one composition on one box; returns figures by movement."""
    with ControlBox(port_base=None, pace=pace, fidelity=fidelity, seed=seed) as box:
        arm = ur.connect(box.host, box.ports)
        report = arm.experiment(plans, 3, COMPOSITIONS[name][0], out, overwrite=True)
    table = build_table([analyse_run(load_recording(path)) for path in report.paths])
    rows = {
        row["name"]: {
            "kind": row["kind"],
            "snr_db": [round(x, 2) for x in row["snr_db"]],
            "noise_floor_db": row["noise_floor_db"],
            "unrepeatable_db": row["unrepeatable_db"],
            "budget_share": {part: table.runs[row["name"]][-1].budget.share(part) for part in PARTS},
        }
        for row in table.frame.to_dicts()
    }
    means = {
        kind: [fmean(row["snr_db"][k] for row in rows.values() if row["kind"] == kind) for k in range(3)]
        for kind in KINDS
    }
    summary = "  ".join(f"{kind} {' '.join(f'{x:.2f}' for x in means[kind])} dB" for kind in KINDS)
    return {
        "composition": name,
        "fidelity": Path(fidelity).stem,
        "seed": seed,
        "pace": pace,
        "rows": rows,
        "means": means,
        "loop": dict(report.delay.facts()),
        "late_frames": sum(stream.late_frames for stream in report.streams),
        "lost_frames": sum(stream.lost_frames for stream in report.streams),
        "remarks": report.remarks,
        "summary": summary,
    }


def markdown(results: list[dict[str, Any]]) -> str:
    """Tables of mean SNRs and error budgets, and the rows of the best composition."""
    lines = [
        "Mean SNR (Eq. 10) of the movements of a kind in dB: runs 1, 2, 3. Floor: what the encoders' "
        "noise at rest alone would leave.",
        "",
        "| composition | what it is | fidelity | lognormal r1, r2, r3 | floor | uniform r1, r2, r3 | floor |",
        "|---|---|---|---|---:|---|---:|",
    ]
    for r in _of_main(results):
        cells = [r["composition"], COMPOSITIONS[r["composition"]][1], r["fidelity"]]
        for kind in KINDS:
            cells += [
                ", ".join(f"{x:.1f}" for x in r["means"][kind]),
                f"{_mean(r, kind, 'noise_floor_db'):.1f}",
            ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        "By how much the third run of a composition is above that of `preview`, dB: mean of the paired "
        "differences of all movements, its 95 % interval, p of a permutation test.",
        "",
        "| composition | fidelity | mean | interval | pairs | p |",
        "|---|---|---:|---|---:|---:|",
        *_against_preview(results),
    ]
    parts = list(next(iter(results[0]["rows"].values()))["budget_share"])
    lines += [
        "",
        "Where the error power of the third run lies, mean over the ten movements, in %.",
        "",
        "| composition | fidelity | " + " | ".join(parts) + " |",
        "|---|---|" + "---:|" * len(parts),
    ]
    for r in _of_main(results):
        shares = [100.0 * fmean(row["budget_share"][part] for row in r["rows"].values()) for part in parts]
        cells = [r["composition"], r["fidelity"], *(f"{share:.0f}" for share in shares)]
        lines.append("| " + " | ".join(cells) + " |")
    best = [r for r in results if (r["composition"], r["fidelity"]) == ("best", "typical")]
    heads = [f"seed {r['seed']}, {r['pace']}" for r in best]
    lines += [
        "",
        "The best composition at typical fidelity: all runs of the first box, then the third run of each box "
        "and by how much it is above the floor, dB.",
        "",
        f"| movement | {heads[0]}: r1, r2, r3 | " + " | ".join(f"{head}: r3" for head in heads) + " |"
        if best
        else "",
        "|---|---|" + "---:|" * len(best),
    ]
    for name in best[0]["rows"] if best else ():
        cells = [name, ", ".join(f"{x:.1f}" for x in best[0]["rows"][name]["snr_db"])]
        for r in best:
            third, floor = r["rows"][name]["snr_db"][-1], r["rows"][name]["noise_floor_db"]
            cells.append(f"{third:.2f} ({third - floor:+.2f})")
        lines.append("| " + " | ".join(cells) + " |")
    lines += [
        "",
        "The loop that the best composition identified, and its margins.",
        "",
        "| fidelity | seed | pace | dead time, lag, spread [ms] | gain margin | phase [deg] | delay [ms] "
        "| cut-off [Hz] | contraction | late, lost frames |",
        "|---|---|---|---|---:|---:|---:|---:|---:|---|",
    ]
    for r in (r for r in results if r["composition"] == "best"):
        loop = r["loop"]
        times = ", ".join(f"{1e3 * loop[x]:.1f}" for x in ("dead_time_s", "lag_s", "joint_spread_s"))
        lines.append(
            f"| {r['fidelity']} | {r['seed']} | {r['pace']} | {times} | {loop['gain_margin']:.1f} "
            f"| {loop['phase_margin_deg']:.0f} | {1e3 * loop['delay_margin_s']:.0f} "
            f"| {loop['learning_cut_off_hz']:.0f} | {loop['learning_contraction']:.2f} "
            f"| {r['late_frames']}, {r['lost_frames']} |"
        )
    return "\n".join(lines) + "\n"


def _against_preview(results: list[dict[str, Any]]) -> Iterator[str]:
    third = {
        (r["fidelity"], r["composition"]): {name: row["snr_db"][-1] for name, row in r["rows"].items()}
        for r in _of_main(results)
    }
    for (fidelity, name), levels in third.items():
        base = third.get((fidelity, "preview"))
        if base and name != "preview":
            d = paired_difference(list(levels.values()), [base[movement] for movement in levels])
            cells = [
                name,
                fidelity,
                f"{d.mean:.2f}",
                f"{d.low:.2f} to {d.high:.2f}",
                f"{d.n_pairs}",
                f"{d.p:.2g}",
            ]
            yield "| " + " | ".join(cells) + " |"


def draw(results: list[dict[str, Any]], path: Path) -> None:
    """Draw one panel a fidelity: mean SNR of each composition, by kind and run, and the floor."""
    from pc_client.results.figures import BLUE, ORANGE, figure, image_bytes

    fidelities = [f for f in FIDELITIES if any(r["fidelity"] == f for r in _of_main(results))]
    with figure(4.4, "SIMULATED") as page:
        grid = page.subplots(1, len(fidelities), squeeze=False)[0]
        for k, (fidelity, axes) in enumerate(zip(fidelities, grid, strict=True)):
            cases = [r for r in _of_main(results) if r["fidelity"] == fidelity]
            for shift, kind, colour in ((-0.2, "lognormal", BLUE), (0.2, "uniform", ORANGE)):
                for i, r in enumerate(cases):
                    label = kind if i == 0 else None
                    runs = r["means"][kind]
                    axes.plot([i + shift] * len(runs), runs, color=colour, lw=1.0, alpha=0.6)
                    axes.scatter([i + shift] * len(runs), runs, s=[10, 22, 40], color=colour, label=label)
                # The highest: an arm that still settles has noise at rest which is not its encoders'.
                floor = max(_mean(r, kind, "noise_floor_db") for r in cases)
                axes.axhline(floor, color=colour, lw=1.2, ls="--", label=f"encoders' noise floor, {kind}")
                rest = _mean(cases[-1], kind, "unrepeatable_db")
                axes.axhline(rest, color=colour, lw=1.2, ls=":", label=f"what does not repeat, {kind}")
            axes.set_xticks(range(len(cases)), [r["composition"] for r in cases], rotation=40, ha="right")
            axes.set_title(fidelity)
            axes.grid(axis="x", visible=False)
            if k == 0:
                axes.set_ylabel("mean SNR [dB]; small to large: runs 1, 2, 3")
                axes.legend(loc="lower right")
    path.write_bytes(image_bytes(page))


def _of_main(results: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The cases of the table: one seed, lockstep."""
    return [r for r in results if r["seed"] == results[0]["seed"] and r["pace"] == "lockstep"]


def _mean(result: dict[str, Any], kind: str, figure_name: str) -> float:
    return fmean(row[figure_name] for row in result["rows"].values() if row["kind"] == kind)


if __name__ == "__main__":
    sys.exit(main())
