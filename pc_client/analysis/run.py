"""All figures that are measured on one recording; tables and pages are made of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from pc_client.analysis import measures
from pc_client.analysis.noise_floor import noise_power, step_covariance
from pc_client.arrays import Array
from pc_client.errors import RecordingError
from pc_client.recording.provenance import Provenance
from pc_client.recording.recording import Recording

GIVEN_UP = "given up"
"""Kind of the movement of a run that did not come to its end."""


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """One recording and what was measured on it.

    Attributes:
        covariance: of the encoders' noise, (6, 6) [rad2], as all runs of the experiment show it at rest;
            None: as this one does.
    """

    recording: Recording
    track: measures.TcpTrack
    snr: measures.Snr
    errors: measures.Errors
    covariance: Array | None = None

    @cached_property
    def noise(self) -> tuple[float, float]:
        """What noise adds to the power of the speed error by its mean and its variance; 0 if not known."""
        covariance = step_covariance([self]) if self.covariance is None else self.covariance
        return noise_power(self, covariance) or (0.0, 0.0)

    @property
    def floor_db(self) -> float | None:
        """The SNR [dB] at which noise alone would leave the run; None where the noise is not known."""
        power, signal = sum(self.noise), self.budget.signal_power
        return measures.decibels(signal, power) if power > 0.0 < signal else None

    @cached_property
    def budget(self) -> measures.Budget:
        """The power of the speed error by its parts."""
        return measures.error_budget(self.track, self.snr.speed_lag_s, self.noise)

    @property
    def provenance(self) -> Provenance:
        """Where the recording comes from."""
        return self.recording.provenance

    @property
    def figures(self) -> dict[str, Any]:
        """The run as a row of a table: levels in dB, lags in ms, parts of the error budget as shares."""
        whose, snr, errors, budget = self.provenance, self.snr, self.errors, self.budget
        return {
            "simulated": whose.simulated,
            "name": whose.movement,
            "kind": whose.kind,
            "n_targets": len(whose.target_points),
            "repetition": whose.repetition,
            "snr_db": snr.speed_db,
            "snr_shifted_db": snr.speed_shifted_db,
            "lag_ms": 1e3 * snr.speed_lag_s,
            "vector_snr_db": snr.velocity_db,
            "vector_snr_shifted_db": snr.velocity_shifted_db,
            "vector_lag_ms": 1e3 * snr.velocity_lag_s,
            "max_position_error_mm": errors.max_position_error_mm,
            "rms_position_error_mm": errors.rms_position_error_mm,
            "max_path_error_mm": errors.max_path_error_mm,
            **{budget_column(part): budget.share(part) for part in measures.PARTS},
            **{f"{budget_column(part)}_alone_db": budget.alone_db(part) for part in measures.PARTS},
        }


def analyse_run(recording: Recording, *, include_aborted: bool = False) -> MeasuredRun:
    """Measure one recording.

    Args:
        recording: of a whole run: the SNR of half a movement cannot stand beside others.
        include_aborted: measure also a run that was given up; name and kind of its movement then say so.

    Raises:
        RecordingError: the run was given up or the file is cut off, signals are missing, or the movement
            phase is too short to be judged.
    """
    if recording.aborted:
        if not include_aborted:
            raise RecordingError(f"{recording.path}: {recording.aborted}: it has no SNR")
        whose = recording.provenance
        name = f"{whose.movement}_r{whose.repetition}_given_up"
        recording = replace(recording, provenance=replace(whose, movement=name, kind=GIVEN_UP))
    track = measures.track_of(recording)
    snr = measures.measure_snr(track)
    return MeasuredRun(
        recording=recording,
        track=track,
        snr=snr,
        errors=measures.measure_errors(recording, track, snr.velocity_lag_s),
    )


def budget_column(part: str) -> str:
    """Name of the column with the share of one part of the error budget."""
    return f"budget_{part.replace(' ', '_')}"
