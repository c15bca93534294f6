"""Figures of an arm in a record of RTDE packages: real or emulated, they are computed alike.

`python tests/ur_emulator/real_arm_figures.py FILE.csv ...` prints those of RTDE record files: a line of names,
then a line a package, with blanks between the columns.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# Shares of a joint's top speed: it moves at constant speed above the first; a slower joint than LEAST does not move.
_AT_SPEED = 0.97
_LEAST = 0.02  # rad/s


@dataclass(frozen=True)
class Moving:
    """A joint at its top speed, of one motion.

    Attributes:
        speed: [rad/s].
        behind: (target - actual) over speed, mean [ms].
        scatter: rms of it about its mean [mrad].
        largest: of abs(target - actual) in the whole motion [mrad].
        speed_noise: sd of actual - target speed [mrad/s].
        speed_behind: of the speed, by the best shift [ms].
        current: mean of the actual one, along the motion [A].
        current_noise: sd of actual - target current [A].
        target_current: mean, along the motion [A].
    """

    speed: float
    behind: float
    scatter: float
    largest: float
    speed_noise: float
    speed_behind: float
    current: float
    current_noise: float
    target_current: float


@dataclass(frozen=True)
class Resting:
    """A joint at rest.

    Attributes:
        noise: sd of the angle [µrad].
        standing: target - actual, mean [µrad].
        current_noise: sd of the current [A].
        standing_current: actual - target current, mean [A].
        speed: largest reported one [rad/s].
    """

    noise: float
    standing: float
    current_noise: float
    standing_current: float
    speed: float


def moving(record, joint):
    """The figures of a joint in a record, columns (n, 6) by RTDE names; None if it does not move."""
    t, q, qd, actual_qd, current, expected = (
        record[name][:, joint]
        for name in ("target_q", "actual_q", "target_qd", "actual_qd", "actual_current", "target_current")
    )
    speed = np.abs(qd).max()
    if speed < _LEAST:
        return None
    at_speed = np.abs(qd) > _AT_SPEED * speed
    sign, behind = np.sign(qd[at_speed].mean()), t - q
    return Moving(
        speed=speed,
        behind=1e3 * np.mean(behind[at_speed] / qd[at_speed]),
        scatter=1e3 * np.std(behind[at_speed]),
        largest=1e3 * np.abs(behind).max(),
        speed_noise=1e3 * np.std((actual_qd - qd)[at_speed]),
        speed_behind=1e3 * _shift(qd, actual_qd, np.median(np.diff(record["timestamp"]))),
        current=sign * np.mean(current[at_speed]),
        current_noise=np.std((current - expected)[at_speed]),
        target_current=sign * np.mean(expected[at_speed]),
    )


def _shift(early, late, period):
    """By how much `late` comes after `early`, where their squared difference is least [s]."""
    times = np.arange(len(early)) * period
    shifts = np.arange(-0.01, 0.03, 1e-4)
    errors = [np.sum((np.interp(times - shift, times, early) - late) ** 2) for shift in shifts]
    return shifts[np.argmin(errors)]


def resting(record, joint):
    """The figures of a joint before the first motion, as `moving`."""
    still = slice(0, np.flatnonzero(record["target_qd"].any(axis=1))[0])
    t, q, qd, current, expected = (
        record[name][still, joint]
        for name in ("target_q", "actual_q", "actual_qd", "actual_current", "target_current")
    )
    return Resting(
        noise=1e6 * np.std(q),
        standing=1e6 * np.mean(t - q),
        current_noise=np.std(current),
        standing_current=np.mean(current - expected),
        speed=np.abs(qd).max(),
    )


def read_record(path):
    """Columns by RTDE names, (n,), or (n, 6) where a name has numbers."""
    lines = [line.split() for line in Path(path).read_text().splitlines() if line.strip()]
    columns = dict(zip(lines[0], np.array(lines[1:], dtype=float).T, strict=True))
    names = dict.fromkeys(name.rstrip("0123456789").removesuffix("_") for name in columns)
    return {
        name: columns[name]
        if name in columns
        else np.column_stack([columns[f"{name}_{i}"] for i in range(6)])
        for name in names
    }


def main(paths):
    for path in paths:
        record = read_record(path)
        print(path)
        for joint in range(6):
            for figures in (moving(record, joint), resting(record, joint)):
                if figures is not None:
                    row = " ".join(f"{name} {value:.4g}" for name, value in vars(figures).items())
                    print(f"  {joint} {type(figures).__name__}: {row}")


if __name__ == "__main__":
    main(sys.argv[1:])
