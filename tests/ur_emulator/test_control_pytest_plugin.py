"""The pytest plug-in, tried on small test-suites of its own."""

import subprocess
import sys
from inspect import signature

import numpy  # noqa: F401 - cannot be loaded a second time, as pytester would
import pytest

from ur_emulator import ControlBox
from ur_emulator.host.replay import replay
from ur_emulator.pytest_plugin import OPTIONS, _own_addresses

pytest_plugins = ["pytester"]


@pytest.fixture
def suite(pytester, monkeypatch):
    """Run the tests of a text."""
    monkeypatch.delenv("PYTEST_XDIST_WORKER", raising=False)
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)

    def run(text, *words):
        pytester.makepyfile(text)
        return pytester.runpytest_inprocess("-p", "no:cacheprovider", *words)

    return run


def test_fixtures_give_fresh_boxes_as_marks_say_the_nearest_first(suite, pytester):
    pytester.mkdir("programs").joinpath("hello.script").write_text('textmsg("hello")\n')
    result = suite(
        """
        import pytest
        from ur_emulator.errors import NotRunningError
        pytestmark = pytest.mark.ur(seed=5, version="3.4.0")
        boxes = []

        def test_one(ur_box):
            facts = ur_box.identity
            assert [facts[name] for name in ("robot", "software", "seed", "pace")] == ["UR3", "3.4.0", 5, "lockstep"]
            assert ur_box.ports.primary != 30001
            ur_box.set_speed(0.5)

        @pytest.mark.ur(robot="ur5", seed=6, pace="realtime", fidelity="ideal", programs="programs")
        def test_marked(ur_box):
            facts = ur_box.identity
            assert (facts["robot"], facts["software"], facts["seed"]) == ("UR5", "3.4.0", 6)
            assert (facts["pace"], facts["fidelity"]) == ("realtime", "ideal")
            assert ur_box.state.speed == 1.0
            ur_box.run_program(file="hello.script")
            ur_box.wait_until(log="hello")

        def test_three(ur_box_factory):
            boxes.extend(ur_box_factory(seed=k) for k in range(3))
            assert len({box.serial_number for box in boxes}) == 3
            assert len({box.ports.primary for box in boxes}) == 3

        def test_they_have_ended():
            for box in boxes:
                with pytest.raises(NotRunningError):
                    box.power_on()
        """,
        "--strict-markers",
    )
    result.assert_outcomes(passed=4)


@pytest.mark.parametrize("mark", ["ur()", "ur(in_process=True)"])
def test_a_failing_test_shows_state_and_log_of_its_box_and_no_frames_of_ours(suite, mark):
    result = suite(
        f"""
        import pytest
        @pytest.mark.{mark}
        def test_fails(ur_box):
            ur_box.add_to_log("the last words of the box")
            ur_box.wait_until(robot_mode="IDLE", timeout=0)
        def test_passes(ur_box):
            ur_box.add_to_log("nobody wants to know")
        def test_calls_wrongly(ur_box):
            ur_box.wait_until(robot="IDLE")
        """
    )
    result.assert_outcomes(failed=2, passed=1)
    result.stdout.fnmatch_lines(
        [
            "E  *WaitTimeoutError: waited 0 s in vain: robot_mode is RUNNING, not IDLE",
            "*state of the UR3 CB3 3.15.8 at 127.0.0.1:*",
            "robot mode RUNNING, safety mode NORMAL",
            "joints [[]0.3944, *[]] rad, at rest, after 60.008 s",
            "*log of the UR3 CB3 3.15.8 at 127.0.0.1:*",
            "*INFO Control: the last words of the box",
            "E  *ArgumentError: wait_until: got an unexpected keyword argument 'robot'; it takes time, robot_mode*",
        ]
    )
    for never in ("*nobody wants to know*", "*/ur_emulator/*.py:*"):
        result.stdout.no_fnmatch_line(never)


def test_one_line_makes_a_test_of_several_robots(suite):
    result = suite(
        """
        import pytest
        ROBOTS = ["ur3", "ur5 3.4.0", {"robot": "ur5e", "version": "5.12", "seed": 3}]
        @pytest.mark.ur(seed=5)
        @pytest.mark.parametrize("ur_box", ROBOTS, indirect=True)
        def test_all(ur_box):
            print(*(ur_box.identity[name] for name in ("robot", "software", "seed")))
        """,
        "-s",
    )
    result.assert_outcomes(passed=3)
    result.stdout.fnmatch_lines(["*UR3 3.15.8* 5*", "*UR5 3.4.0 5*", "*UR5e 5.12.* 3*"])


def test_a_wrong_mark_is_one_line(suite):
    marks = {
        'robot="ur9"': "*no box: *ur9*",
        "colour=1": "*a box has no colour: choose from robot, version*",
        '"ur5"': "*takes keywords only*",
        'programs="nowhere"': "*no box: *nowhere*",
    }
    tests = (f"@pytest.mark.ur({mark})\ndef test_{k}(ur_box):\n    pass\n" for k, mark in enumerate(marks))
    result = suite("import pytest\n" + "".join(tests))
    result.assert_outcomes(errors=len(marks))
    result.stdout.fnmatch_lines([*marks.values()])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_the_command_line_names_defaults_and_the_software_is_for_the_arms_that_run_it(suite):
    result = suite(
        """
        import pytest
        def test_default(ur_box):
            assert (ur_box.identity["robot"], ur_box.identity["software"]) == ("UR10", "3.5.0")
        @pytest.mark.ur(robot="ur3")
        def test_named(ur_box):
            assert (ur_box.identity["robot"], ur_box.identity["software"]) == ("UR3", "3.5.0")
        @pytest.mark.ur(robot="ur5e")
        def test_other_generation(ur_box):
            assert ur_box.identity["software"].startswith("5.")
        """,
        "--ur-robot=ur10",
        "--ur-version=3.5.0",
    )
    result.assert_outcomes(passed=3)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--ur-robot=ur5e", "--ur-version=3.5.0"], "*version 3.5.0 given: software of the e-Series is 5.x*"),
        (["--ur-robot=ur9"], "*unknown robot 'ur9'*"),
    ],
)
def test_defaults_that_cannot_be_are_one_line(suite, words, text):
    result = suite("def test_never(ur_box): pass\n" * 3, *words)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([text])
    assert len(result.errlines) <= 2


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has all of 127.0.0.0/8")
def test_boxes_with_standard_ports_have_addresses_of_their_own(suite):
    result = suite(
        """
        import socket, pytest
        @pytest.mark.ur(standard_ports=True)
        def test_standard(ur_box, ur_box_factory):
            other = ur_box_factory(standard_ports=True)
            assert ur_box.host != other.host
            for box in (ur_box, other):
                assert (box.ports.dashboard, box.ports.primary, box.ports.rtde) == (29999, 30001, 30004)
                with socket.create_connection((box.host, 29999), timeout=20) as sock:
                    assert sock.recv(100).startswith(b"Connected")
        """
    )
    result.assert_outcomes(passed=1)


def test_workers_look_for_addresses_in_blocks_of_their_own(monkeypatch):
    blocks = set()
    for worker in ("", *(f"gw{n}" for n in range(150))):
        monkeypatch.setenv("PYTEST_XDIST_WORKER", worker)
        addresses = list(_own_addresses())
        assert len(set(addresses)) == len(addresses)
        blocks.add(addresses[0].split(".")[1])
    assert len(blocks) == 151


def test_a_mark_takes_what_a_box_takes():
    assert set(OPTIONS) == set(signature(ControlBox).parameters) - {"generation"} | {"standard_ports"}


def test_the_plug_in_loads_nothing_heavy():
    heavy = {"mujoco", "numpy", "lark", "protocol", "ur_emulator.emulator"}
    code = f"import sys, ur_emulator.pytest_plugin; print(*sorted({heavy!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_each_box_may_keep_a_journal(suite, tmp_path):
    result = suite(
        "def test_it(ur_box, ur_box_factory):\n"
        "    ur_box.set_digital_input('standard', 0, True)\n"
        "    ur_box_factory(seed=2).set_digital_input('standard', 1, True)\n",
        f"--ur-journal={tmp_path / 'kept'}",
    )
    result.assert_outcomes(passed=1)
    files = sorted((tmp_path / "kept").iterdir())
    assert [file.name.partition("test_it-")[2] for file in files] == ["1.journal", "2.journal"]
    assert all(str(replay(file)).startswith("identical: ") for file in files)
