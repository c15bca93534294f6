"""How one box serves a hundred clients: fifty RTDE clients at 125 Hz and fifty realtime readers at once."""

from __future__ import annotations

import time

from bench.box_process import box_process
from bench.length import FULL, Length
from bench.side_process import SideProcesses
from ur_emulator.machine.models.generations import CB3

N_RTDE, N_REALTIME = 50, 50
_SETTLE = 1.0  # s; until the box has settled


def measure_clients(length: Length = FULL) -> dict[str, float]:
    """Serve them; compare with the same box without clients."""
    seconds = length.seconds
    with box_process("--seed", "7") as box:
        time.sleep(_SETTLE)
        box.process.cpu_percent()
        time.sleep(min(seconds, 10.0))
        idle = box.process.cpu_percent()
        clients = [(box.host, box.ports.rtde, "rtde")] * N_RTDE
        clients += [(box.host, box.ports.realtime, "realtime")] * N_REALTIME
        beside = SideProcesses(seconds, CB3.period_s, clients)
        box.process.cpu_percent()
        time.sleep(seconds)
        busy = box.process.cpu_percent()
        seen = beside.wait()
    return {
        "rtde_clients_125hz": float(sum(lost == 0 for lost in seen.lost[:N_RTDE])),
        "realtime_readers_125hz": float(sum(lost == 0 for lost in seen.lost[N_RTDE:])),
        "clients_lost_cycles": float(sum(seen.lost)),
        "clients_late_p50_us": seen.late_us[0],
        "clients_late_p99_us": seen.late_us[1],
        "clients_late_p999_us": seen.late_us[2],
        "clients_late_max_us": seen.late_us[3],
        "clients_late_p999_over_timer_us": seen.late_us[2] - seen.timer_us[0],
        "clients_bare_timer_late_p999_us": seen.timer_us[0],
        "clients_cpu_percent": busy,
        "clients_cpu_us_per_frame": 1e4 * (busy - idle) / (CB3.cycle_rate * (N_RTDE + N_REALTIME)),
    }
