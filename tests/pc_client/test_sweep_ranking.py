"""Which setting is the best, what varies, and when a line between points means something."""

from __future__ import annotations

from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sweep_samples import case, invented

from pc_client.control.controller import CONTROLLERS
from pc_client.recording.origin import origin_of
from pc_client.sweep.columns import origin_of_rows
from pc_client.sweep.folder import table_rows
from pc_client.sweep.outcome import failed
from pc_client.sweep.page import map_axes
from pc_client.sweep.ranking import rank_settings, spans_grid, varying


def rows_of(*cases):
    return table_rows((case, invented(case, False)) for case in cases)


def test_the_best_setting_has_the_largest_mean_over_all_its_runs():
    settings = rank_settings(
        rows_of(
            *(
                case(name, repeat=2, gain_p=g)
                for name in ("uniform_4_1", "lognorm_4_1")
                for g in (2.0, 4.0, 7.0)
            )
        )
    )
    assert [dict(s.values) for s in settings] == [{"gain_p": 4.0}, {"gain_p": 7.0}, {"gain_p": 2.0}]
    best = settings[0]
    assert best.n_runs == 4
    assert best.mean_snr_db == pytest.approx(30.0 - 1.0 - 1.0 + 0.15)
    assert best.gain_margin == 10.0
    assert best.max_position_error_mm == 5.0
    assert best.name == "gain_p = 4"


def test_a_setting_with_a_case_missing_stands_below_all_complete_ones():
    rows = rows_of(*(case(seed=seed, gain_p=g, gain_i=2.0) for g in (5.0, 9.0) for seed in (1, 2)))
    rows += table_rows([(case(seed=3, gain_p=5.0, gain_i=2.0), failed("broken"))])
    rows += rows_of(case(seed=3, gain_p=9.0, gain_i=2.0), case(seed=3, gain_p=30.0, gain_i=2.0))
    settings = rank_settings(rows)
    assert [s.values["gain_p"] for s in settings] == [9.0, 5.0, 30.0]
    assert [s.complete for s in settings] == [True, False, False]
    assert [(s.n_refused, s.n_failed) for s in settings] == [(0, 0), (0, 1), (1, 0)]
    assert settings[2].mean_snr_db is None
    assert settings[2].gain_margin == 0.5


def test_without_anything_to_compare_the_controller_is_named():
    (setting,) = rank_settings(rows_of(case(), case("lognorm_4_1")))
    assert setting.name == "controller = preview"


@pytest.mark.parametrize(
    ("own", "states", "simulated"),
    [
        (True, [None], True),  # a box of the sweep's own, whatever came of the case
        (False, [True, False], True),
        (False, [None, False], None),
        (False, [False, False], False),
    ],
)
def test_a_table_is_of_a_real_arm_only_if_every_row_is(own, states, simulated):
    rows = [{"fidelity": "typical" if own else None, "simulated": state} for state in states]
    assert origin_of_rows(rows) is origin_of(simulated)


def test_axes_are_what_varies():
    rows = rows_of(case(gain_p=2.0, uses_preview=True), case("lognorm_4_1", gain_p=3.0, uses_preview=False))
    assert varying(rows) == ["movement", "gain_p", "uses_preview"]


def test_what_follows_from_the_name_of_a_controller_is_no_axis():
    paper = {**asdict(CONTROLLERS["paper"]), "gain_i": 2.0}
    others = [case(**{**paper, "gain_p": gain}) for gain in (3.0, 4.0)]
    rows = rows_of(*others, *(case(gain_p=gain, gain_i=2.0) for gain in (3.0, 4.0)))
    assert varying(rows) == ["controller", "gain_p"]
    assert spans_grid(rows)
    assert len(rank_settings(rows)) == 4


def test_the_map_prefers_the_gains():
    assert map_axes(rows_of(case(gain_p=1.0), case(gain_p=2.0))) is None
    rows = rows_of(case(gain_p=1.0, gain_i=1.0, slew_limit=1.0), case(gain_p=2.0, gain_i=2.0, slew_limit=2.0))
    assert map_axes(rows) == ("gain_p", "gain_i")
    rows = rows_of(case(gain_i=1.0, slew_limit=1.0), case(gain_i=2.0, slew_limit=2.0))
    assert map_axes(rows) == ("gain_i", "slew_limit")


@given(
    ps=st.sets(st.integers(1, 9), min_size=2, max_size=4),
    qs=st.sets(st.integers(1, 9), min_size=2, max_size=4),
    missing=st.booleans(),
)
def test_a_grid_is_known_by_its_corners(ps, qs, missing):
    settings = [(float(p), float(q)) for p in sorted(ps) for q in sorted(qs)]
    rows = rows_of(*(case(gain_p=p, gain_i=q) for p, q in settings[missing:]))
    assert spans_grid(rows) is not missing
