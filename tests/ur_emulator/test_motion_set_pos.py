"""set_pos: the simulated arm is placed at other joint angles."""

import pytest
from box_support import Bench

from ur_emulator.controller.events import ScriptFailed

ELSEWHERE = [0.5, -1.2, -1.5, -1.0, 1.2, 0.4]


def failures(bench):
    return [e.text for e in bench.events if isinstance(e, ScriptFailed)]


def test_the_arm_is_where_it_was_put_and_moves_on_from_there():
    bench = Bench()
    said = bench.run(
        f"def f():\n  set_pos({ELSEWHERE})\n  textmsg(get_target_joint_positions() == {ELSEWHERE})\n  sync()\n"
        f"  textmsg(norm(get_actual_joint_positions()[0] - 0.5) < 0.001)\n  movej({[0.6, *ELSEWHERE[1:]]})\nend\n"
    )
    assert not failures(bench)
    assert said == ["True", "True"]
    assert bench.now.actual_q == pytest.approx([0.6, *ELSEWHERE[1:]], abs=2e-3)
    assert max(abs(x) for s in bench.snapshots for x in s.actual_qd) < 1.2


@pytest.mark.parametrize(
    ("q", "word"),
    [
        ([7.0, -1.2, -1.5, -1.0, 1.2, 0.4], "joint 0"),
        ([0.0, 1.2, 0.0, 0.0, 0.0, 0.0], "touch"),
    ],
)
def test_where_no_arm_can_be(q, word):
    bench = Bench()
    before = bench.now.target_q
    bench.run(f"def f():\n  set_pos({q})\nend\n")
    (text,) = failures(bench)
    assert word in text
    assert bench.now.target_q == before


def test_not_while_the_arm_moves():
    bench = Bench()
    bench.start(
        f"def f():\n  thread t():\n    movej({ELSEWHERE})\n  end\n  run t()\n  sleep(0.2)\n  set_pos({ELSEWHERE})\nend\n"
    )
    bench.tick(60)
    (text,) = failures(bench)
    assert "moves" in text
    assert max(abs(x) for s in bench.snapshots for x in s.target_qd) < 1.2
