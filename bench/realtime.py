"""How punctual the box is in real time: frames on port 30003 as one client sees them come."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from rich.progress import track

from bench import bare_timer
from bench.box_process import box_process
from bench.length import FULL, Length
from protocol.frame_buffer import FrameBuffer
from protocol.realtime.layout import MAX_FRAME_SIZE, layout_for_size
from ur_emulator.machine.models.robots import robot_by_name

# What starts and takes memory is a box with everything switched on.
_PROGRAMS = Path(__file__).parent.parent / "examples" / "scripts"
_CONTROL_PORT = 31_090


def measure_realtime(length: Length = FULL, robot: str = "ur3") -> dict[str, float]:
    """Attach one client; compare arrivals with the grid on which the earliest lie."""
    minutes = length.minutes
    generation = robot_by_name(robot).generation
    period = generation.period_s
    everything = ("--programs", str(_PROGRAMS), "--control-port", str(_CONTROL_PORT))
    with box_process("--seed", "7", "--robot", robot, *everything) as box:
        timer = subprocess.Popen(
            [sys.executable, bare_timer.__file__, str(minutes * 60.0), str(period)],
            stdout=subprocess.PIPE,
            text=True,
        )
        stamps, arrivals = [], []
        n_frames = round(minutes * 60.0 / period)
        with socket.create_connection((box.host, box.ports.realtime), timeout=5.0) as sock:
            buffer = FrameBuffer(MAX_FRAME_SIZE)
            box.process.cpu_percent()
            for _ in track(range(n_frames), description=f"{generation.cycle_rate} Hz for {minutes:g} min"):
                while (frame := buffer.next_frame()) is None:
                    buffer.feed(sock.recv(65536))
                    now = time.monotonic()
                arrivals.append(now)
                stamps.append(layout_for_size(len(frame)).decode(frame).timestamp)
            cpu = box.process.cpu_percent()
            rss = box.process.memory_info().rss
        startup = box.startup_s
        timer_p999, timer_max = map(float, timer.communicate()[0].split())
    ticks = np.round(np.array(stamps) / period).astype(int)
    phase = np.array(arrivals) - ticks * period
    lateness_us = 1e6 * (phase - phase.min())
    return {
        "stream_minutes": minutes,
        "stream_lost_cycles": float(ticks[-1] - ticks[0] + 1 - len(ticks)),
        "stream_late_p50_us": float(np.percentile(lateness_us, 50.0)),
        "stream_late_p99_us": float(np.percentile(lateness_us, 99.0)),
        "stream_late_p999_us": float(np.percentile(lateness_us, 99.9)),
        "stream_late_max_us": float(lateness_us.max()),
        "stream_late_p999_over_timer_us": float(np.percentile(lateness_us, 99.9)) - timer_p999,
        "bare_timer_late_p999_us": timer_p999,
        "bare_timer_late_max_us": timer_max,
        "cpu_percent": cpu,
        "rss_mb": rss / 2**20,
        "startup_s": startup,
    }
