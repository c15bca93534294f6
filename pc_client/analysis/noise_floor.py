"""The noise floor: the SNR of Eq. 10 that no controller can pass, derived from the arm's own recordings.

A perfect arm would still be judged by what its encoders say. Eq. 10 takes the length of differenced reported
positions; the noise n of that difference at rest, seen through the Jacobian J along the movement, adds

    P_floor = mean over the steps of E[ (|v_ref + n| - |v_ref|)^2 ],     n ~ N(0, J C J' / dt^2)

C (6, 6) is the covariance of the differences of `actual_q` over a step while the arm rests before and after
its movements: of the differences, so that whatever colour the noise has is in it. While the arm is fast only
the noise along the motion counts, near rest all of it does; the expectation takes care of both. Nothing is
fitted to the movement, and nothing is known of the arm but what it reports. The noise of the error budget is
the same.

What moves with the arm and does not repeat (the moment of sampling, for one) is not in C. It can be measured
together with the encoders' noise, from two runs as if driven alike: `unrepeatable_power`, half the mean
square of their difference. What noise adds to the mean of the speed near rest is the same in both and
drops out there: of a movement with long slow tails this figure is better than the floor, else a little worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from typing import Protocol

import numpy as np

from pc_client.analysis.measures import TcpTrack, rest_samples, speed, steps_of, velocity
from pc_client.arrays import Array
from pc_client.control.loop import LoopModel, velocity_response
from pc_client.errors import CellError
from pc_client.files import FILE_KINDS
from pc_client.kinematics.arms import ROBOTS
from pc_client.kinematics.model import RobotModel, robot_model, tcp_jacobian
from pc_client.recording.recording import Recording
from ur_hil.cell import NO_CELL, parse_cell

_NODES = 5
"""Nodes of the Gauss-Hermite rule an axis: exact for polynomials up to the ninth degree."""

LEAST_STEPS = 25
"""Differences at rest from which C is worth estimating: its diagonal is good to 30 %, the floor to .5 dB.
One run on a CB3 has 29."""


class _Tracked(Protocol):
    """A run: its recording, and the TCP path of it."""

    @property
    def recording(self) -> Recording: ...
    @property
    def track(self) -> TcpTrack: ...


def step_covariance(runs: Sequence[_Tracked]) -> Array | None:
    """Return C (6, 6) [rad2] of all runs of one arm together; None with fewer than `LEAST_STEPS` steps."""
    stretches = []
    for run in runs:
        for samples in rest_samples(run.recording, run.track):
            q = run.recording.column("actual_q")[run.track.rows[samples]]
            begins, ends = steps_of(run.track.t[samples])
            stretches.append(q[ends] - q[begins])
    if sum(map(len, stretches)) < LEAST_STEPS:
        return None
    steps = np.concatenate([stretch - stretch.mean(axis=0) for stretch in stretches])
    # The mean of n differences is the last value less the first over n: taking it away costs 1 / n^2 of the
    # noise, not 1 / n as of independent values.
    covariance: Array = steps.T @ steps / len(steps)
    return covariance


def noise_power(run: _Tracked, covariance: Array | None) -> tuple[float, float] | None:
    """Return what noise adds to the power of the speed error of a run by its mean and its variance [(m/s)2].

    None for an unknown arm or without rest. The noise is seen through the reference and the time stamps; C is
    (6, 6) [rad2]. The Jacobian of the nominal arm is good to the calibration, 1 %.
    """
    model = _nominal(run)
    if covariance is None or model is None:
        return None
    track, inside = run.track, run.track.movement_steps
    begins, ends = (samples[inside] for samples in steps_of(track.t))
    dt, jacobians = track.t[ends] - track.t[begins], _jacobians(run, model)[begins]
    noise = jacobians @ covariance @ jacobians.transpose(0, 2, 1) / np.square(dt)[:, None, None]
    mean, variance = speed_noise(velocity(track.t, track.p_ref)[inside], noise)
    return float(np.mean(np.square(mean))), float(np.mean(variance))


def speed_noise(v: Array, covariance: Array) -> tuple[Array, Array]:
    """Mean (n,) [m/s] and variance (n,) [(m/s)2] of |v + n| - |v|, n being normal with mean zero.

    The velocities are (n, 3) [m/s], the covariance of n is (n, 3, 3) or (3, 3) [(m/s)2]. By Gauss-Hermite
    quadrature.
    """
    nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    share = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    share /= share.sum()
    # A root of each covariance; a tiny negative eigenvalue is rounding.
    values, vectors = np.linalg.eigh(np.broadcast_to(covariance, (len(v), 3, 3)))
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    noisy = np.linalg.norm(v[:, None, :] + grid @ roots.transpose(0, 2, 1), axis=2)
    excess = noisy - np.linalg.norm(v, axis=1)[:, None]
    mean: Array = excess @ share
    variance: Array = np.square(excess) @ share - np.square(mean)
    return mean, np.maximum(variance, 0.0)


def unrepeatable_power(runs: Sequence[_Tracked]) -> float | None:
    """Return half the mean square difference [(m/s)2] of the speeds of two runs, as if driven alike.

    What the commands of the second differ by from those of the first (learned or fed back) is taken out
    through the loop that the client identified. It is the mean over all neighbours among the repetitions of
    one movement; None for a single run, an unknown arm or old recordings without a loop.
    """
    halves = []
    for first, second in pairwise(runs):
        p = _as_driven_like(first, second)
        if p is not None:
            steps = first.track.movement_steps
            a, b = (speed(first.track.t, x)[steps] for x in (first.track.p_actual, p))
            halves.append(0.5 * float(np.mean(np.square(a - b))))
    return float(np.mean(halves)) if halves else None


def _as_driven_like(first: _Tracked, second: _Tracked) -> Array | None:
    """Return the positions (n, 3) [m] of the second run as they would be with the commands of the first."""
    loop, model = _loop_of(first), _nominal(first)
    if loop is None or model is None or len(first.track.t) != len(second.track.t):
        return None
    period = float(np.median(np.diff(first.track.t)))
    commands = [run.recording.column("cmd_qd")[run.track.rows] for run in (first, second)]
    response = velocity_response(loop, period)
    more = commands[1] - commands[0]
    further = np.cumsum(
        np.stack([np.convolve(column, response)[: len(more)] for column in more.T], axis=1), axis=0
    )
    moved = np.einsum("nij,nj->ni", _jacobians(first, model), further * period)
    positions: Array = second.track.p_actual - moved
    return positions


def _jacobians(run: _Tracked, model: RobotModel) -> Array:
    """From joint velocities to that of the TCP, along the reference of a run, (n, 3, 6)."""
    q = run.recording.column("ref_q")[run.track.rows]
    return np.array([tcp_jacobian(model, q_k)[:3] for q_k in q])


def _nominal(run: _Tracked) -> RobotModel | None:
    """The nominal arm of a run, with its TCP; None for an unknown arm."""
    name, text = run.recording.provenance.robot_model.lower(), run.recording.provenance.cell_text
    cell = NO_CELL
    with suppress(CellError):  # the report says what is wrong with it
        cell = parse_cell(text, "recording", FILE_KINDS["cell"]) if text else NO_CELL
    return robot_model(name, cell) if name in ROBOTS else None


def _loop_of(run: _Tracked) -> LoopModel | None:
    """The loop that the client identified; None in old recordings."""
    loop, delay = run.recording.provenance.loop, run.recording.provenance.identified_delay_s
    if loop.keys() >= {"dead_time_s", "lag_s", "joint_spread_s"}:
        dead_time, lag, spread = (float(loop[x]) for x in ("dead_time_s", "lag_s", "joint_spread_s"))
        return LoopModel(dead_time, lag, spread, 0.0)
    return LoopModel.of_delay(delay, 0.0) if loop and delay is not None else None
