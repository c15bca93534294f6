"""Many boxes: one after another from Python, and in one process in real time, with two clients each."""

from __future__ import annotations

import sys
import time
from statistics import median

from bench.box_process import box_process
from bench.length import FULL, Length
from bench.side_process import SideProcesses
from ur_emulator import ControlBox
from ur_emulator.machine.models.robots import robot_by_name

_STARTS = 20
_SETTLE = 1.0  # s


def measure_box_start(length: Length = FULL) -> dict[str, float]:
    """Start boxes as a test-suite does: the first one, and those after it; each until it answers."""
    durations = []
    for _ in range(1 + length.part_of(_STARTS)):
        began = time.perf_counter()
        with ControlBox(pace="lockstep", port_base=None) as box:
            assert box.state.steady
            durations.append(1e3 * (time.perf_counter() - began))
    return {"box_first_start_ms": durations[0], "box_start_ms": median(durations[1:])}


def measure_boxes(length: Length = FULL, n_boxes: int = 20, robot: str = "ur3") -> dict[str, float]:
    """Run so many boxes at once."""
    if sys.platform == "darwin":
        return {}
    seconds = length.seconds
    with box_process("--robot", robot, "--seed", "7", "--boxes", str(length.part_of(n_boxes))) as rack:
        time.sleep(_SETTLE)
        kinds = (("realtime", rack.ports.realtime), ("rtde", rack.ports.rtde))
        clients = [(host, port, kind) for host in rack.hosts for kind, port in kinds]
        beside = SideProcesses(seconds, robot_by_name(robot).generation.period_s, clients)
        rack.process.cpu_percent()
        time.sleep(seconds)
        cpu = rack.process.cpu_percent()
        seen = beside.wait()
        rss = rack.process.memory_info().rss
    per_box = [sum(seen.lost[k : k + 2]) for k in range(0, len(seen.lost), 2)]
    return {
        "boxes_realtime": float(sum(lost == 0 for lost in per_box)),
        "boxes_lost_cycles": float(sum(per_box)),
        "boxes_late_p50_us": seen.late_us[0],
        "boxes_late_p999_us": seen.late_us[2],
        "boxes_late_max_us": seen.late_us[3],
        "boxes_bare_timer_late_p999_us": seen.timer_us[0],
        "boxes_cpu_percent": cpu,
        "boxes_rss_mb": rss / 2**20,
        "boxes_startup_s": rack.startup_s,
    }
