"""Before an arm that is not on this machine moves: the plan is shown, and a person says yes."""

import io
import sys

import pytest
from integration_support import Messages, port_base_of, programs_since

# This machine by a spelling that the client need not take for its own: as good as a robot in the network.
ELSEWHERE = "127.1"
PLAN = (
    "UR3, software 3.15.8",
    "box of motion",
    "top TCP speed",
    "top joint speed",
    "duration",
    "joint range",
)


@pytest.fixture
def run_elsewhere(ur_client, standard_box, tmp_path, monkeypatch):
    def run(answer):
        monkeypatch.setattr(sys, "stdin", io.StringIO(answer))
        options = ("--robot", ELSEWHERE, "--port-base", port_base_of(standard_box), "--out", tmp_path / "out")
        return ur_client("run", "uniform_4_1", *options)

    return run


@pytest.mark.parametrize(
    "answer", ["n\n", "\n", "", "maybe\nno\n"], ids=["no", "enter", "nothing", "undecided"]
)
def test_without_a_yes_the_plan_is_shown_and_nothing_moves(run_elsewhere, standard_box, tmp_path, answer):
    with Messages(standard_box) as primary:
        done = run_elsewhere(answer)
        assert done.code == 1
        assert all(words in done.out for words in PLAN)
        assert done.err.splitlines()[-1] == "ur-client: aborted"
        assert "Traceback" not in done.err
        assert programs_since(primary, standard_box) == []
    assert not (tmp_path / "out").exists()


def test_after_a_yes_it_runs(run_elsewhere, standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_elsewhere("y\n")
        assert done.code == 0, done.err
        assert "velocity_receiver" in programs_since(primary, standard_box)
    assert all(words in done.out for words in PLAN)
    assert (tmp_path / "out" / "uniform_4_1_r1.mcap").exists()
