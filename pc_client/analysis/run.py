"""Everything that is measured on one recording, in one value."""

from __future__ import annotations

from dataclasses import dataclass

from pc_client.analysis.budget import Budget, error_budget
from pc_client.analysis.metrics import Errors, measure_errors
from pc_client.analysis.snr import Snr, measure_snr
from pc_client.analysis.track import TcpTrack, track_of
from pc_client.recording.loader import Recording
from pc_client.recording.provenance import Provenance


@dataclass(frozen=True, slots=True)
class MeasuredRun:
    """One recording and what was measured on it."""

    recording: Recording
    track: TcpTrack
    snr: Snr
    errors: Errors
    budget: Budget

    @property
    def provenance(self) -> Provenance:
        """Where the recording comes from."""
        return self.recording.provenance


def analyse_run(recording: Recording) -> MeasuredRun:
    """Measure one recording.

    Raises:
        RecordingError: signals are missing, or the movement phase is too short to be judged.
    """
    track = track_of(recording)
    snr = measure_snr(track)
    return MeasuredRun(
        recording=recording,
        track=track,
        snr=snr,
        errors=measure_errors(recording, track, snr.velocity_lag_s),
        budget=error_budget(recording, track, snr.speed_lag_s),
    )
