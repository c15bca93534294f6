"""What `make bench` measures, and what the project asks of itself."""

from collections.abc import Callable

from bench.boxes import measure_box_start, measure_boxes
from bench.clients import measure_clients
from bench.compiling import measure_compiling
from bench.connect_storm import measure_connect_storm
from bench.length import Length
from bench.lockstep import measure_lockstep
from bench.paper_set import measure_paper_set
from bench.realtime import measure_realtime
from bench.script import measure_script
from bench.script_in_box import measure_script_in_box
from bench.tick import measure_tick

Measurement = Callable[[Length], dict[str, float]]
# A cycle of 2 ms.
E_SERIES_ARM = "ur5e"


def _on_e_series(figures: dict[str, float]) -> dict[str, float]:
    """The same figures under names of their own."""
    return {f"e_series_{name}": value for name, value in figures.items()}


MEASUREMENTS: dict[str, Measurement] = {
    "script": measure_script,
    "script_in_box": measure_script_in_box,
    "compiling": measure_compiling,
    "tick": measure_tick,
    "lockstep": measure_lockstep,
    "realtime": measure_realtime,
    "clients": measure_clients,
    "box_start": measure_box_start,
    "boxes": measure_boxes,
    "e_series_tick": lambda length: _on_e_series(measure_tick(length, E_SERIES_ARM)),
    "e_series_lockstep": lambda length: _on_e_series(measure_lockstep(length, E_SERIES_ARM)),
    "e_series_realtime": lambda length: _on_e_series(measure_realtime(length, E_SERIES_ARM)),
    "e_series_boxes": lambda length: _on_e_series(measure_boxes(length, 5, E_SERIES_ARM)),
    "connect_storm": measure_connect_storm,
    "paper_set": measure_paper_set,
}
# What the project asks of itself: measurement -> figure -> (sign, bound).
ASKED: dict[str, dict[str, tuple[str, float]]] = {
    "script": {"compile_1200_lines_s": ("<=", 0.3)},
    "script_in_box": {
        "compile_20000_locals_s": ("<=", 1.0),
        "script_sync_thread_us": ("<=", 10.0),
        "statements_in_a_cycle": (">=", 100_000.0),
    },
    "compiling": {"frames_lost_while_compiling": ("<=", 0.0)},
    "tick": {"tick_x_steps": ("<=", 2.5)},
    "lockstep": {"lockstep_x_realtime": (">=", 40.0), "lockstep_cycle_x_limit": ("<=", 3.0)},
    "realtime": {
        "stream_late_p50_us": ("<=", 250.0),
        "stream_late_p999_over_timer_us": ("<=", 300.0),
        "stream_lost_cycles": ("<=", 0.0),
        "cpu_percent": ("<=", 15.0),
        "rss_mb": ("<=", 150.0),
        "startup_s": ("<=", 1.0),
    },
    "clients": {
        "rtde_clients_125hz": (">=", 50.0),
        "realtime_readers_125hz": (">=", 50.0),
        "clients_late_p999_over_timer_us": ("<=", 1000.0),
    },
    "box_start": {"box_start_ms": ("<=", 60.0)},
    "boxes": {"boxes_realtime": (">=", 20.0)},
    "e_series_lockstep": {"e_series_lockstep_x_realtime": (">=", 20.0)},
    "e_series_realtime": {
        "e_series_stream_late_p50_us": ("<=", 250.0),
        "e_series_stream_late_p999_over_timer_us": ("<=", 300.0),
        "e_series_stream_lost_cycles": ("<=", 0.0),
        "e_series_cpu_percent": ("<=", 40.0),
        "e_series_rss_mb": ("<=", 150.0),
    },
    "e_series_boxes": {"e_series_boxes_realtime": (">=", 5.0)},
    "connect_storm": {
        "connect_storm_per_s": (">=", 199.0),
        "connect_storm_leak_kb": ("<=", 1024.0),
        "connect_storm_leak_descriptors": ("<=", 0.0),
        "connect_storm_lost_cycles": ("<=", 0.0),
    },
    "paper_set": {
        "paper_set_preview_lognormal_db": (">=", 35.0),
        "paper_set_preview_uniform_db": (">=", 30.0),
        "paper_set_preview_least_above_paper_db": (">=", 5.0),
        "paper_set_best_third_least_above_floor_db": (">=", -1.0),
        "paper_set_best_third_above_first_db": (">=", 0.0),
    },
}
