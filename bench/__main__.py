"""`make bench`: measure, print, write bench/results.json. BENCH_MINUTES shortens the parts in real time."""

import json
import os
from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench.boxes import measure_boxes
from bench.clients import measure_clients
from bench.compiling import measure_compiling
from bench.connect_storm import measure_connect_storm
from bench.lockstep import measure_lockstep
from bench.realtime import measure_realtime
from bench.script import measure_script
from bench.script_in_box import measure_script_in_box

RESULTS = Path(__file__).with_name("results.json")
# What the project asks of itself, by figure: (sign, bound).
ASKED = {
    "compile_1200_lines_s": ("<=", 0.3),
    "compile_20000_locals_s": ("<=", 1.0),
    "script_sync_thread_us": ("<=", 10.0),
    "statements_in_a_cycle": (">=", 100_000.0),
    "frames_lost_while_compiling": ("<=", 0.0),
    "lockstep_x_realtime": (">=", 40.0),
    "stream_late_p999_us": ("<=", 1000.0),
    "stream_lost_cycles": ("<=", 0.0),
    "cpu_percent": ("<=", 15.0),
    "rss_mb": ("<=", 150.0),
    "startup_s": ("<=", 1.0),
    "rtde_clients_125hz": (">=", 50.0),
    "realtime_readers_125hz": (">=", 50.0),
    "clients_late_p999_us": ("<=", 2000.0),
    "boxes_realtime": (">=", 20.0),
    "connect_storm_per_s": (">=", 199.0),
    "connect_storm_leak_kb": ("<=", 1024.0),
    "connect_storm_leak_descriptors": ("<=", 0.0),
    "connect_storm_lost_cycles": ("<=", 0.0),
}


def main() -> None:
    """Run all measurements."""
    minutes = float(os.environ.get("BENCH_MINUTES", "10"))
    seconds = 60.0 * min(minutes, 1.0)
    results = {
        **measure_script(),
        **measure_script_in_box(),
        **measure_compiling(seconds),
        **measure_lockstep(),
        **measure_realtime(minutes),
        **measure_clients(seconds),
        **measure_boxes(seconds),
        **measure_connect_storm(seconds),
    }
    RESULTS.write_text(
        json.dumps({name: round(value, 3) for name, value in results.items()}, indent=2) + "\n"
    )
    table = Table("figure", "measured", "asked")
    for name, value in results.items():
        sign, bound = ASKED.get(name, ("", None))
        table.add_row(name, f"{value:.4g}", f"{sign} {bound:g}" if bound is not None else "")
    Console().print(table)
    print(f"written to {RESULTS}")


main()
