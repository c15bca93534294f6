"""Before an arm moves that does not say itself that it is simulated: the plan is shown, and a person says yes."""

import io
import sys

import pytest
from integration_support import Messages, port_base_of, programs_since

from pc_client.driver import report

pytestmark = pytest.mark.usefixtures("without_page")

PLAN = (
    "UR3, software 3.15.8",
    "speed slider",
    "TCP offset",
    "box of motion",
    "top TCP speed",
    "top joint speed",
    "duration",
    "joint range",
)


@pytest.fixture
def run_movement(ur_client, standard_box, tmp_path, monkeypatch):
    """Run a movement on the box; the loopback address says nothing about it: real arms are reached by tunnels."""

    def run(answer, *options):
        monkeypatch.setattr(sys, "stdin", answer if answer is None else io.StringIO(answer))
        where = ("--robot", standard_box.host, "--port-base", port_base_of(standard_box))
        return ur_client("run", "uniform_4_1", *where, "--out", tmp_path / "out", *options)

    return run


@pytest.fixture
def marks_hidden(monkeypatch):
    """The client finds no mark of a simulator in the box, nor a proof that it is real."""
    monkeypatch.setattr(report, "_is_simulated", lambda *told: None)


@pytest.mark.usefixtures("marks_hidden")
@pytest.mark.parametrize(
    "answer", ["n\n", "\n", "", "maybe\nno\n"], ids=["no", "enter", "nothing", "undecided"]
)
def test_without_a_yes_the_plan_is_shown_and_nothing_moves(run_movement, standard_box, tmp_path, answer):
    with Messages(standard_box) as primary:
        done = run_movement(answer)
        assert done.code == 1
        assert all(words in done.out for words in PLAN)
        assert done.err.splitlines()[-1] == "ur-client: aborted"
        assert "Traceback" not in done.err
        assert programs_since(primary, standard_box) == []
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("marks_hidden")
def test_where_nobody_can_be_asked_the_answer_is_no(run_movement, standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_movement(None)
        assert done.code == 1
        assert "there is no terminal to ask at" in done.complaint()
        assert "--yes" in done.complaint()
        assert programs_since(primary, standard_box) == []
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("marks_hidden")
def test_after_a_yes_it_runs(run_movement, standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_movement("y\n")
        assert done.code == 0, done.err
        assert "velocity_receiver" in programs_since(primary, standard_box)
    assert all(words in done.out for words in PLAN)
    assert (tmp_path / "out" / "uniform_4_1_r1.mcap").exists()


def test_a_box_that_says_it_is_simulated_runs_without_a_question(run_movement, tmp_path):
    done = run_movement(None)
    assert done.code == 0, done.err
    assert (tmp_path / "out" / "uniform_4_1_r1.mcap").exists()
