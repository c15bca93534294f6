"""Scripts made from nodes, run on a controller: what they do, not only what they say."""

import pytest
from box_support import Bench
from dashboard_support import expression, script_line, urp
from urp_samples import CONTACT, assignment, branch, direction, move, until_distance, waypoint
from urp_support import NEW_BOX, script_of

from protocol.pose import pose_trans
from ur_emulator.controller.events import ErrorReported, PopupShown, ScriptFailed
from ur_emulator.models.robot_model import ZERO6

REST = '<Wait type="Sleep"><waitTime>0.1</waitTime></Wait>'


@pytest.fixture
def bench():
    return Bench(fidelity="ideal")


@pytest.fixture
def run(bench, tmp_path):
    def run_nodes(nodes, **options):
        text = script_of(tmp_path, urp(nodes, **options), NEW_BOX).encode().decode("latin-1")
        printed = bench.run(text)
        assert not [one for one in bench.events if isinstance(one, ScriptFailed | ErrorReported)]
        return printed

    return run_nodes


def say(text):
    return script_line(f'textmsg("{text}")')


def taught(bench, name, *step):
    """A waypoint at a step from where the tool is, in its axes."""
    pose, q = pose_trans(bench.now.target_tcp_pose, step or ZERO6), bench.now.target_q
    inside = f'<position joints="{", ".join(map(str, q))}" pose="{", ".join(map(str, pose))}"/>'
    return waypoint(name, f"<motionParameters/>{inside}"), pose


@pytest.mark.parametrize(("value", "said"), [("1", "one"), ("2", "two"), ("3", "default")])
def test_the_default_case_runs_when_no_other_one_does(run, value, said):
    cases = "".join(
        f'<Case caseValue="{number}"><children>{say(text)}</children></Case>'
        for number, text in (("1", "one"), ("2147483647", "default"), ("2", "two"))
    )
    assert run(f"<Switch>{expression(value)}<children>{cases}</children></Switch>") == [said]


def test_a_loop_counts_with_its_variable(run):
    loop = '<Loop type="Counting" count="3"><loopVariable name="Loop_1"/><children>{}</children></Loop>'
    assert run(loop.format(script_line('textmsg("turn ", Loop_1)'))) == ["turn 0", "turn 1", "turn 2"]


@pytest.mark.parametrize(("value", "said"), [("1", ["through"]), ("2", ["else"])])
def test_a_watched_condition_breaks_its_branch_off(run, value, said):
    watched = branch("If", script_line(f"x={value}") + REST + say("through"), "x≤1", watched=True)
    assert run(assignment("x", "0") + watched + branch("Else", say("else"))) == said


def test_a_watched_condition_breaks_its_loop_off(run):
    inside = script_line("x=x+1") + REST + script_line('textmsg("x", x)')
    loop = (
        f'<Loop type="While" checkContinuously="true">{expression("x≠2")}<children>{inside}</children></Loop>'
    )
    assert run(assignment("x", "0") + loop) == ["x1"]


def test_a_timer_counts_seconds_while_it_is_started(run):
    timer = "".join(
        f'<Timer action="{action}"><variable name="t"/></Timer>{REST}'
        for action in ("Reset", "Start", "Stop")
    )
    (said,) = run(timer + script_line('textmsg("", t)'))
    assert float(said) == pytest.approx(0.1, abs=0.01)


def test_a_popup_that_halts_is_shown_and_ends_the_program(run, bench):
    assert run('<Popup type="Message" haltProgram="true" message="enough"/>' + say("never")) == []
    assert [event.text for event in bench.events if isinstance(event, PopupShown)] == ["enough"]


def test_threads_run_after_the_statements_before_the_start(run):
    around = (
        f'<SpecialSequence type="BeforeStart"><children>{assignment("n", "1")}{REST}{say("before")}</children></SpecialSequence>'
        f'<Thread name="Watch" runOnlyOnce="true"><children>{say("thread")}</children></Thread>'
    )
    assert run(REST + say("main"), around=around) == ["before", "thread", "main"]


def test_a_direction_ends_after_its_distance(run, bench):
    before = bench.now.target_tcp_pose
    assert run(move("MoveL", direction(CONTACT + until_distance("0.05", say("arrived"))))) == ["arrived"]
    assert bench.now.target_tcp_pose == pytest.approx((*before[:2], before[2] - 0.05, *before[3:]), abs=1e-6)


def test_a_direction_ends_at_a_contact_and_goes_back(run, bench):
    nodes = move("MoveL", direction(CONTACT) + script_line('textmsg("", get_target_tcp_pose()[2])'))
    (height,) = run(nodes)
    assert 0.0 < float(height) < 0.06  # the tool has met the table and is two centimetres above it
    assert float(height) == pytest.approx(
        min(one.target_tcp_pose[2] for one in bench.snapshots) + 0.02, abs=0.01
    )


def test_lines_and_circles_lead_the_active_tool_to_the_taught_poses(run, bench):
    tool = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    via, _ = taught(bench, "Via", 0.02, 0.02, 0.0, 0.0, 0.0, 0.0)
    end, goal = taught(bench, "End", 0.04, 0.0, 0.0, 0.0, 0.0, 0.0)
    start, _ = taught(bench, "Start")
    circle = f'<CircleMove OrientationMode="UNCONSTRAINED"><children>{via}{end}</children></CircleMove>'
    run(
        script_line(f"set_tcp(p{list(tool)})")
        + move("MoveL", start)
        + move("MoveP", start + circle, 'blendRadius="0.0"')
    )
    assert bench.now.target_tcp_pose == pytest.approx(goal, abs=1e-5)
