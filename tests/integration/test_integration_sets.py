"""The two sets of ten through ports: which runs, under which names, and how well the arm follows."""

import json
from statistics import fmean

import pytest
from integration_support import at

from pc_client.movements.library_sets import library_names

pytestmark = [pytest.mark.usefixtures("without_page"), pytest.mark.timeout(360)]  # on a busy machine


def table(ur_client, box, out, *options):
    done = ur_client("experiment", *at(box), "--out", out, *options)
    assert done.code == 0, done.err
    return json.loads((out / "table1.json").read_text())


@pytest.mark.slow
def test_preview_follows_the_paper_set_far_better_than_the_paper(standard_box, ur_client, tmp_path):
    data = table(ur_client, standard_box, tmp_path / "out", "--controller", "preview", "--repeat", "1")
    assert [row["name"] for row in data["rows"]] == library_names("paper")
    assert data["mean_snr_db"]["lognormal"] >= 35.0
    assert data["mean_snr_db"]["uniform"] >= 30.0
    for row in data["rows"]:
        assert row["mean_snr_db"] >= row["paper_snr_db"] + 5.0


@pytest.mark.slow
def test_best_is_within_one_decibel_of_the_floor_on_the_third_run(standard_box, ur_client, tmp_path):
    data = table(ur_client, standard_box, tmp_path / "out", "--controller", "best")
    assert len(data["rows"]) == 10  # what one movement shows of the gears serves the others
    for row in data["rows"]:
        assert row["snr_db"][2] >= row["noise_floor_db"] - 1.0
    assert fmean(row["snr_db"][2] for row in data["rows"]) > fmean(row["snr_db"][0] for row in data["rows"])


@pytest.mark.slow
def test_the_arcs_run_under_names_that_no_row_of_the_paper_has(standard_box, ur_client, tmp_path):
    names = "arcs/uniform_5_3,arcs/lognorm_4_1"
    data = table(ur_client, standard_box, tmp_path / "out", "--movements", names, "--repeat", "1")
    assert [row["name"] for row in data["rows"]] == ["arcs_uniform_5_3", "arcs_lognorm_4_1"]
    assert [row["paper_snr_db"] for row in data["rows"]] == [None, None]
    assert data["mean_snr_db"]["lognormal"] >= 35.0


def test_a_set_that_is_not_there_is_named_with_those_that_are(ur_client, tmp_path):
    words = ("experiment", "--robot", "127.0.0.1", "--out", tmp_path / "out", "--set")
    done = ur_client(*words, "mine")
    assert (done.code, done.err) == (1, 'ur-client: no set of movements "mine": give one of paper, arcs\n')
    done = ur_client(*words, "arcs", "--movements", "x.toml")
    assert done.code == 2
    assert "give only one" in done.err
