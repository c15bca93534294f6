"""Before an arm that is not on this machine moves: the plan is shown, and a person says yes."""

import pytest
from integration_support import Messages, command, port_base_of, programs_since

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


def run_elsewhere(box, out, text, *options):
    arguments = (
        "run",
        "uniform_4_1",
        "--robot",
        ELSEWHERE,
        "--port-base",
        port_base_of(box),
        "--out",
        out,
        *options,
    )
    return command("pc_client", *arguments, text=text)


@pytest.mark.parametrize("answer", ["n\n", ""], ids=["no", "nothing"])
def test_without_a_yes_the_plan_is_shown_and_nothing_moves(standard_box, tmp_path, answer):
    with Messages(standard_box) as primary:
        done = run_elsewhere(standard_box, tmp_path / "out", answer)
        assert done.code == 1
        assert all(words in done.out for words in PLAN)
        assert done.err.splitlines()[-1] == "ur-client: aborted"
        assert "Traceback" not in done.err
        assert programs_since(primary, standard_box) == []
    assert not (tmp_path / "out").exists()


def test_after_a_yes_it_runs(standard_box, tmp_path):
    with Messages(standard_box) as primary:
        done = run_elsewhere(standard_box, tmp_path / "out", "y\n")
        assert done.code == 0, done.err
        assert "velocity_receiver" in programs_since(primary, standard_box)
    assert all(words in done.out for words in PLAN)
    assert (tmp_path / "out" / "uniform_4_1_r1.mcap").exists()
