"""The columns of a sweep's table, in order: what was chosen, what came of it, what was measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pc_client.analysis.measures import PARTS
from pc_client.analysis.run import budget_column
from pc_client.control.controller import FIELDS
from pc_client.recording.provenance import Origin, origin_of
from pc_client.results.tables import Column

FACTORS = (
    Column("robot", kind=str, text="type of the arm"),
    Column(
        "fidelity",
        kind=str,
        text="how imperfect the simulated arm is; none for a robot that was there already",
    ),
    Column("seed", kind=int, text="which simulated arm of its kind"),
    Column("movement", kind=str, text="name of the movement"),
    Column("controller", kind=str, text="named controller that the settings start from"),
    *(
        Column(name, kind=field.kind, text=f"as in Controller: {field.text}")
        for name, field in FIELDS.items()
    ),
)
"""What a case is made of; the axes of a sweep are those of them that vary."""

FIGURES = (
    Column("simulated", kind=bool, text="true: the robot says so; false: a real arm; missing: not known"),
    Column("kind", kind=str, text="model of the movement: lognormal, uniform ..."),
    Column("repetition", kind=int, text="run within the case, from 1"),
    Column("snr_db", text="SNR of the TCP speed, Eq. 10 of the paper: neither shifted nor smoothed"),
    Column("snr_shifted_db", text="the same after the one time shift that makes it best"),
    Column("lag_ms", text="that shift; positive: the arm is behind"),
    Column("vector_snr_db", text="SNR of the TCP velocity vector"),
    Column("vector_snr_shifted_db", text="the same after its own best shift"),
    Column("max_position_error_mm", text="largest distance of reference and reported TCP at one time"),
    Column("rms_position_error_mm", text="its root mean square"),
    Column("max_path_error_mm", text="the same after the best shift and without the constant offset"),
    *(Column(budget_column(part), text=f"share of {part} in the error power, 0..1") for part in PARTS),
    Column("delay_ms", text="loop delay that the client identified before the first run"),
    Column("gain_margin", text="factor by which both gains may grow on this loop; refused below 2"),
    Column("late_frames", kind=int, text="frames that came late"),
    Column("lost_frames", kind=int, text="frames that never came"),
)
"""What is measured on a run."""

COLUMNS = (
    Column("case", kind=str, text="identity: equal cases of any sweep share it"),
    Column("status", kind=str, text="done, refused (gain margin too small, nothing ran) or failed"),
    Column("error", kind=str, text="why it is not done"),
    *FACTORS,
    *FIGURES,
)


def origin_of_rows(rows: Sequence[Mapping[str, Any]]) -> Origin:
    """Return the words for a whole table: a real arm only if all its rows are known to be of one."""
    states = {True if row["fidelity"] is not None else row.get("simulated") for row in rows}
    return origin_of(True if True in states else None if None in states else False)
