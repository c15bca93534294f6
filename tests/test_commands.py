"""Every target of the Makefile, and every command that a page shows, begins and ends in a test, in its shortest form."""

import json
import os
import re
import runpy
import shlex
import subprocess
import sys
from ctypes.util import find_library
from importlib.util import find_spec
from pathlib import Path
from shutil import copy

import pytest
from page_blocks import MAKE_TARGETS, ROOT, blocks_of, commands_of, shown_commands

from bench.measurements import ASKED, MEASUREMENTS

BIN = Path(sys.executable).parent
# Of the e-Series are the same measurements of another arm.
MEASURED = [name for name in MEASUREMENTS if not name.startswith("e_series_") or name == "e_series_tick"]
# Targets, and options with which they end soon and write nothing into the tree; then what takes longer.
TARGETS = (
    ("attack", "--box CB3 --seconds 0.1 --out attack.json 'unread log'"),
    ("bench", "--short --out bench.json script"),
    ("walk", "--box 'CB3 3.15' --steps 1 --length 1"),
    pytest.param("bench", f"--short --out bench.json {' '.join(MEASURED)}", marks=pytest.mark.nightly),
    pytest.param("soak", "", marks=pytest.mark.nightly),
)
# Commands of pages, and what ends them soon; those of `LONGER` run at night.
ALONE = {
    "python -m docs.make_beside_picture": "--out picture.png",
    "python -m docs.make_extraction_picture": "--out picture.png",
    "python -m pc_client.movements.generate": "library",
    "python -m pydoc": "pc_client.Arm protocol.realtime.layout ur_emulator.ControlBox urscript.compile_program",
    "python tests/attack": "--box CB3 --seconds 0.1 --repeat 10 --growth 9 'unread log'",
    "python tests/fuzz/campaign.py": "--cases 1 controller",
}
LONGER = {"python -m docs.make_beside_picture", "python tests/attack", "python tests/fuzz/campaign.py"}
# Where the others begin and end, if not in the blocks of a page. CI begins with .ci/run, outside of any test.
ELSEWHERE = {
    "ur-emulator replay": "ur_emulator/test_journal.py::test_another_process_with_another_hash_seed_finds_the_same",
    "make ablation": "test_examples.py::test_ablation",
    "make attack": "test_commands.py::test_a_target_begins_and_ends",
    "make bench": "test_commands.py::test_a_target_begins_and_ends",
    "make check": "test_commands.py::test_targets_run_tests",
    "make check-static": ".ci/run",
    "make clean": "test_commands.py::test_make_clean_removes_what_was_made",
    "make demo": "test_examples.py::test_demo_and_plot",
    "make docs": "test_site.py::test_every_page_is_there_and_asks_no_other_machine",
    "make draw": "test_examples.py::test_draw",
    "make explore": "test_commands.py::test_targets_run_tests",
    "make format": "test_commands.py::test_make_format_makes_files_canonical",
    "make help": "test_commands.py::test_make_help_lists_the_targets",
    "make nightly": "test_commands.py::test_targets_run_tests",
    "make pick": "test_examples.py::test_pick",
    "make pictures": "test_commands.py::test_make_pictures_draws",
    "make setup": ".ci/run",
    "make show": "test_examples.py::test_show",
    "make soak": "test_commands.py::test_a_target_begins_and_ends",
    "make test": ".ci/run",
    "make walk": "test_commands.py::test_a_target_begins_and_ends",
    "pip install": "test_wheel.py::test_the_commands_of_a_page_need_no_more_than_its_install",
    "python -c": "test_commands.py::test_the_mean_of_an_extraction",
    "python -m docs.generate.results_page": "test_examples.py::test_demo_and_plot",
    "python -m protocol decode": "protocol/test_protocol_command.py::test_decode_realtime",
    "python -m protocol layout": "protocol/test_protocol_command.py::test_layout",
    "python examples/ablation.py": "test_examples.py::test_ablation",
    "python examples/draw.py": "test_examples.py::test_draw",
    "ur-client compare": "pc_client/test_comparison.py::test_command_executes_measures_and_writes",
    "ur-client experiment": "pc_client/test_client_cli.py::test_own_numbers_reach_robot_recording_and_table",
    "ur-client movements duplicate": "pc_client/test_movements_commands.py::test_duplicate_varies_a_movement_of_the_library",
    "ur-client movements generate": "pc_client/test_movements_commands.py::test_every_kind_can_be_generated_and_planned",
    "ur-client movements kinds": "pc_client/test_movements_commands.py::test_kinds_lists_every_generator_and_says_that_a_duplicate_has_its_own_target_points",
    "ur-client movements show": "pc_client/test_client_cli.py::test_a_movement_is_shown_for_people_and_as_json",
    "ur-client sweep": "pc_client/test_sweep_command.py::test_a_sweep_finds_the_best_gains_and_a_second_call_does_nothing_again",
    "ur-client view": "ur_pendant/test_pendant_recordings.py::test_a_page_needs_no_server",
    "ur-emulator pendant": "integration/test_integration_emulator_command.py::test_a_window_in_the_background_of_a_shell_ends_with_an_interrupt",
    "ur-emulator serve": "integration/test_integration_emulator_command.py::test_a_signal_ends_the_box_in_motion_with_exit_0_and_without_a_word",
}
# Programs of others that a page shows; the page says what they are for.
FOREIGN = {"dask", "pip show", "ros2", "sudo", "New-NetFirewallRule"}


@pytest.fixture
def begin(tmp_path, monkeypatch):
    """Run `python ...` of this project in this process, in an empty folder, to its end."""

    def begin(words):
        monkeypatch.chdir(tmp_path)
        first, *rest = words[1:]
        code = 0
        try:
            if first == "-m":
                found = find_spec(rest[0])
                script = Path(
                    (find_spec(f"{rest[0]}.__main__") if found.submodule_search_locations else found).origin
                )
                rest = rest[1:]
            else:
                script = ROOT / first
                monkeypatch.syspath_prepend(script if script.is_dir() else script.parent)
            monkeypatch.setattr(sys, "argv", [first, *rest])
            runpy.run_path(str(script), run_name="__main__")
        except SystemExit as end:
            code = end.code
        assert not code

    return begin


def make(*words, cwd=ROOT):
    """Run make, as with an environment that is up to date; returns what it prints.

    It must not take itself for a part of the `make test` that runs this.
    """
    command = ["make", "-f", str(ROOT / "Makefile"), "STAMP=", f"BIN={BIN}", *words]
    own = {name: value for name, value in os.environ.items() if "MAKE" not in name and name != "MFLAGS"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=own)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(("target", "arguments"), TARGETS)
def test_a_target_begins_and_ends(target, arguments, begin, tmp_path, monkeypatch):
    """What `make -n` says is done in this process, where libraries are loaded."""
    monkeypatch.setenv("SOAK_MINUTES", "0.03")
    command, *_ = make("-n", target, f"ARGS={arguments}").splitlines()
    begin(shlex.split(command))
    written = {path.name: json.loads(path.read_text()) for path in tmp_path.rglob("*.json")}
    if target == "bench" and arguments.endswith(" script"):
        assert ASKED["script"].keys() <= written["bench.json"].keys()
    elif target == "bench":
        figures = written["bench.json"].keys()
        assert {name for measurement in MEASURED for name in ASKED.get(measurement, {})} <= figures
        # The file in the tree has all figures of a run, where they come from, and no others.
        known = json.loads((ROOT / "bench" / "results.json").read_text()).keys()
        assert {name for name in known if not name.startswith("e_series_")} == {
            name for name in figures if not name.startswith("e_series_")
        }
        assert {name.removeprefix("e_series_") for name in known if name.startswith("e_series_")} <= figures
    elif target == "attack":
        assert written["attack.json"]["figures"]["CB3"]["unread log"]["problems"] == []
    elif target == "soak":
        assert written["soak.json"]["figures"]["problems"] == []
        assert (tmp_path / "out" / "soak" / "soak.png").read_bytes().startswith(b"\x89PNG")


def test_make_walk_has_its_settings_as_options():
    command = shlex.split(make("-n", "walk", "SEED=5", "BOX=CB3 3.15", "STEPS=2000"))
    assert command[1:] == ["tests/walk", "--seed", "5", "--box", "CB3 3.15", "--steps", "2000"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [pytest.param(one, marks=[pytest.mark.nightly] if one in LONGER else []) for one in ALONE],
)
def test_a_command_of_a_page_begins_and_ends(command, begin):
    begin([*command.split(), *shlex.split(ALONE[command])])


@pytest.mark.nightly
def test_make_pictures_draws(tmp_path):
    """In a process of its own: the library that draws is chosen when MuJoCo is loaded."""
    if find_library("EGL") is None:
        pytest.skip("no off-screen OpenGL")
    make("pictures", f"ARGS=--only protective_stop --out {tmp_path}")
    (picture,) = tmp_path.iterdir()
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "target", ["explore", *(pytest.param(one, marks=pytest.mark.nightly) for one in ("check", "nightly"))]
)
def test_targets_run_tests(target):
    one = f"PYTEST={BIN}/python -m pytest tests/protocol/test_protocol_frame_buffer.py"
    assert "passed" in make(target, one, "-o", "check-static")


def test_make_format_makes_files_canonical(tmp_path):
    copy(ROOT / ".mdformat.toml", tmp_path)
    (tmp_path / "page.md").write_text("Title\n=====\n")
    (tmp_path / "module.py").write_text("x   = 'a'\n")
    make("format", "PAGES=page.md", cwd=tmp_path)
    assert (tmp_path / "page.md").read_text() == "# Title\n"
    assert (tmp_path / "module.py").read_text() == 'x = "a"\n'


def test_make_clean_removes_what_was_made(tmp_path):
    for name in (".venv/bin", "out/demo", "package/__pycache__", ".mypy_cache"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "package" / "kept.py").touch()
    make("clean", cwd=tmp_path)
    assert [path.relative_to(tmp_path).as_posix() for path in sorted(tmp_path.rglob("*"))] == [
        "package",
        "package/kept.py",
    ]


def test_make_help_lists_the_targets():
    listed = set(re.findall(r"^(\w+) +\S", make("help"), re.MULTILINE))
    assert listed == MAKE_TARGETS - {"check-static"}


def test_the_mean_of_an_extraction(tmp_path, monkeypatch, capsys):
    """The page takes 500 of 2,720 drawings."""
    monkeypatch.chdir(tmp_path)
    Path("found").mkdir()
    Path("found/extraction.json").write_text(json.dumps([{"snr_v_db": 24.0}] * 501))
    commands = [c for b in blocks_of(ROOT / "docs" / "extraction.md") for c in commands_of(b.text)]
    (text,) = [words[2] for c in commands if (words := shlex.split(c))[:2] == ["python", "-c"]]
    exec(text, {})
    assert capsys.readouterr().out == "24.0\n"


def test_no_command_is_left_out():
    run, shown = shown_commands()
    tested = run | ALONE.keys() | ELSEWHERE.keys()
    wanted = shown | {f"make {target}" for target in MAKE_TARGETS}
    assert wanted - tested - FOREIGN == set()
    assert ELSEWHERE.keys() <= wanted | run, "a row of a command that nothing shows"
    for command, where in ELSEWHERE.items():
        path, _, test = where.partition("::")
        word = Path(command.split()[-1]).name
        if not test:
            assert word in (ROOT / path).read_text().split(), where
            continue
        text = (ROOT / "tests" / path).read_text(encoding="utf-8")
        assert f"def {test}(" in text, where
        # An example is known by its file.
        script = re.search(r"examples/(\S+)", make("-n", word)) if command.startswith("make ") else None
        assert (script[1] if script else word) in text, f"{where} runs no {command}"
