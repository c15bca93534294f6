"""Small hand-made recordings for the tests of recording and analysis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pc_client.recording.provenance import Provenance
from pc_client.recording.recorder import Recorder
from pc_client.recording.rows import Phase

SIGNALS = (
    ("timestamp", 1, "s"),
    ("actual_q", 6, "rad"),
    ("actual_TCP_pose", 6, "m, rad"),
    ("robot_mode", 1, "enum"),
)
N_VALUES = 14
PERIOD = 0.008


def provenance(**changes: Any) -> Provenance:
    """A complete provenance; keyword arguments replace single values."""
    values: dict[str, Any] = {
        "movement": "lognorm_4_1",
        "kind": "lognormal",
        "repetition": 1,
        "controller": "preview",
        "robot_model": "UR3",
        "firmware": "3.15.8",
        "serial": "20993000007",
        "simulated": True,
        "seed": 7,
        "pace": "lockstep",
        "client_version": "0.1.0",
        "identified_delay_s": 0.031,
        "controller_config": {"kp": 12.0, "anti_windup": True, "law": "PI"},
        "movement_text": 'name = "lognorm_4_1"\n# µ and "quotes" and\nlines\n',
        "target_points": ((0.1, 0.2, 0.3), (0.2, 0.1, 0.35)),
    }
    return Provenance(**{**values, **changes})


def append_rows(recorder: Recorder, n: int) -> None:
    """Append n rows in which every number is different."""
    for i in range(n):
        frame = 1000.0 * i + np.arange(N_VALUES)
        frame[0] = 50.0 + PERIOD * i
        recorder.append(
            frame,
            PERIOD * i,
            np.arange(6) + i,
            np.arange(6) - i,
            (0.1 * i, 0.2, 0.3),
            (1.0, 2.0, 0.01 * i),
            np.arange(6) * 0.5 + i,
            Phase(i % 3),
        )


def lognormal(t: np.ndarray, duration: float) -> np.ndarray:
    """Path length share 0..1 of one smooth speed profile, at rest outside [0, duration]."""
    x = np.clip(t / duration, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def record_movement(
    path: Path,
    *,
    lag: float = 0.0,
    gain: float = 1.0,
    noise: float = 0.0,
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    duration: float = 2.0,
    length: float = 0.3,
    rest: float = 0.8,
    seed: int = 0,
    distort: Callable[[np.ndarray], np.ndarray] | None = None,
    prov: Provenance | None = None,
    aborted: str = "",
) -> Path:
    """Record a straight reach along y; actual position = reference, delayed, scaled, offset, with noise.

    `distort` maps the times (n,) to extra actual positions (n, 3) in m.
    """
    rng = np.random.default_rng(seed)
    t = PERIOD * np.arange(-round(rest / PERIOD), round((duration + rest) / PERIOD) + 1)
    ref = np.column_stack([np.full_like(t, 0.3), length * lognormal(t, duration), np.full_like(t, 0.2)])
    velocity = np.gradient(ref, t, axis=0)
    actual = np.column_stack(
        [np.full_like(t, 0.3), gain * length * lognormal(t - lag, duration), np.full_like(t, 0.2)]
    )
    actual += np.asarray(offset) + rng.normal(0.0, noise, actual.shape) if noise else np.asarray(offset)
    if distort is not None:
        actual = actual + distort(t)
    with Recorder(path, prov or provenance(), SIGNALS) as recorder:
        for i, now in enumerate(t):
            frame = np.zeros(N_VALUES)
            frame[0] = 10.0 + PERIOD * i
            frame[1:7] = actual[i, 1]
            frame[7:10] = actual[i]
            phase = (
                Phase.SETTLE_BEFORE
                if now < 0
                else Phase.MOVEMENT
                if now < duration + PERIOD / 2
                else Phase.SETTLE_AFTER
            )
            recorder.append(
                frame, now, np.full(6, ref[i, 1]), np.zeros(6), ref[i], velocity[i], np.zeros(6), phase
            )
        recorder.close({"aborted": aborted} if aborted else {})
    return path
