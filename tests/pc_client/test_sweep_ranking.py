"""Which setting is the best, what varies, and when a line between points means something."""

from __future__ import annotations

from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sweep_samples import case, invented, table_of, table_with

from pc_client.control.controller import CONTROLLERS
from pc_client.recording.provenance import origin_of
from pc_client.studies.sweep.case import failed, origin_of_rows
from pc_client.studies.sweep.page import map_axes
from pc_client.studies.sweep.settings import edge_of, rank_settings, spans_grid, varying


def test_the_best_setting_has_the_largest_mean_over_all_its_runs():
    settings = rank_settings(
        table_of(
            *(
                case(name, repeat=2, gain_p=g)
                for name in ("uniform_4_1", "lognorm_4_1")
                for g in (2.0, 4.0, 7.0)
            )
        )
    )
    assert settings["setting"].to_list() == ["gain_p = 4", "gain_p = 7", "gain_p = 2"]
    best = settings.row(0, named=True)
    assert best["complete"]
    assert best["n_runs"] == 4
    assert best["mean_snr_db"] == pytest.approx(30.0 - 1.0 - 1.0 + 0.15)
    assert best["gain_margin"] == 10.0
    assert best["max_position_error_mm"] == 5.0


def test_a_setting_with_a_case_missing_stands_below_all_complete_ones():
    cases = [case(seed=seed, gain_p=g, gain_i=2.0) for g in (5.0, 9.0) for seed in (1, 2)]
    cases += [case(seed=3, gain_p=g, gain_i=2.0) for g in (5.0, 9.0, 30.0)]
    outcomes = [(it, invented(it)) for it in cases]
    outcomes[4] = (cases[4], failed("broken"))
    settings = rank_settings(table_with(outcomes))
    assert settings["gain_p"].to_list() == [9.0, 5.0, 30.0]
    assert settings["complete"].to_list() == [True, False, False]
    assert settings.select("n_refused", "n_failed").rows() == [(0, 0), (0, 1), (1, 0)]
    assert settings["mean_snr_db"][2] is None
    assert settings["gain_margin"][2] == 0.5


def test_without_anything_to_compare_the_controller_is_named():
    settings = rank_settings(table_of(case(), case("lognorm_4_1")))
    assert settings["setting"].to_list() == ["controller = preview"]


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


@pytest.mark.parametrize(
    ("ps", "qs", "said"),
    [
        ((3.0, 5.0, 7.0), (1.0, 2.0, 3.0), ""),
        ((6.0, 8.0), (1.0, 2.0, 3.0), "gain_p = 6 is the smallest of 2"),
        ((2.0, 4.0), (0.5, 1.5), "gain_p = 4 is the largest of 2, gain_i = 1.5 is the largest of 2"),
        ((4.0, 5.0, 6.0), (0.0, 9.0), ""),  # there is no gain below 0
        ((5.0, 30.0), (2.0,), "gain_p = 5 is the smallest of 2"),  # 30 is refused
        ((30.0, 40.0), (2.0,), ""),  # nothing is the best
    ],
)
def test_a_best_setting_at_the_edge_is_named_with_its_side(ps, qs, said):
    table = table_of(*(case(gain_p=p, gain_i=q) for p in ps for q in qs))
    whole = f"the best lies at the edge of what was tried ({said}): a better one may lie beyond"
    assert edge_of(table, rank_settings(table)) == (whole if said else "")


def test_axes_are_what_varies():
    rows = table_of(case(gain_p=2.0, uses_preview=True), case("lognorm_4_1", gain_p=3.0, uses_preview=False))
    assert varying(rows) == ["movement", "gain_p", "uses_preview"]


def test_what_follows_from_the_name_of_a_controller_is_no_axis():
    paper = {**asdict(CONTROLLERS["paper"]), "gain_i": 2.0}
    others = [case(**{**paper, "gain_p": gain}) for gain in (3.0, 4.0)]
    rows = table_of(*others, *(case(gain_p=gain, gain_i=2.0) for gain in (3.0, 4.0)))
    assert varying(rows) == ["controller", "gain_p"]
    assert spans_grid(rows)
    assert len(rank_settings(rows)) == 4


def test_the_map_prefers_the_gains():
    assert map_axes(table_of(case(gain_p=1.0), case(gain_p=2.0))) is None
    rows = table_of(
        case(gain_p=1.0, gain_i=1.0, slew_limit=1.0), case(gain_p=2.0, gain_i=2.0, slew_limit=2.0)
    )
    assert map_axes(rows) == ("gain_p", "gain_i")
    rows = table_of(case(gain_i=1.0, slew_limit=1.0), case(gain_i=2.0, slew_limit=2.0))
    assert map_axes(rows) == ("gain_i", "slew_limit")


@given(
    ps=st.sets(st.integers(1, 9), min_size=2, max_size=4),
    qs=st.sets(st.integers(1, 9), min_size=2, max_size=4),
    missing=st.booleans(),
)
def test_a_grid_is_known_by_its_corners(ps, qs, missing):
    settings = [(float(p), float(q)) for p in sorted(ps) for q in sorted(qs)]
    rows = table_of(*(case(gain_p=p, gain_i=q) for p, q in settings[missing:]))
    assert spans_grid(rows) is not missing
