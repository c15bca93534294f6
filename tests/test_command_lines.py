"""What the three commands share: exit codes, versions, help and its examples, completion."""

import argparse
import re
import shlex
import sys
from functools import partial
from importlib import import_module
from importlib.metadata import version

import pytest
import typer
from page_blocks import APPS, ROOT, parsed

import ur_emulator.cli
import ur_hil
from ur_emulator.host.control_api import command_line
from ur_emulator.host.control_api.operations import OPERATIONS
from ur_hil.command_line import EXIT_CODES, ExitCode

MODULES = {"ur-client": "pc_client.cli", "ur-emulator": "ur_emulator.cli", "urscript": "urscript.cli"}


@pytest.fixture
def run(monkeypatch, capfd):
    """Run a command in this process; test_wheel.py starts the installed ones."""

    def run(program, *words):
        monkeypatch.setattr(sys, "argv", [program, *words])
        with pytest.raises(SystemExit) as end:
            import_module(MODULES[program]).main()
        return end.value.code, *capfd.readouterr()

    return run


def commands(command, words):
    """Every command below one, with its words."""
    for name, inner in getattr(command, "commands", {}).items():
        if name != "ctl":
            yield (*words, name), inner
        yield from commands(inner, (*words, name))


ALL = [
    (words, command)
    for program, app in APPS.items()
    for words, command in commands(typer.main.get_command(app), (program,))
]
LEAVES = [pair for pair in ALL if not hasattr(pair[1], "commands")]


def test_the_page_has_the_table_of_exit_codes():
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| (.+) \|$", page, re.MULTILINE)
    assert rows == [(str(int(code)), meaning) for code, meaning in EXIT_CODES.items()]
    assert set(EXIT_CODES) == set(ExitCode)


@pytest.mark.parametrize("program", APPS)
def test_version_is_that_of_the_tool(run, program):
    assert run(program, "--version") == (0, f"{program} {version('ur-hil')}\n", "")


@pytest.mark.parametrize("program", APPS)
@pytest.mark.parametrize("words", [("nothing",), ("--nothing",)])
def test_wrong_usage_is_one_line_and_2(run, program, words):
    code, _, told = run(program, *words)
    assert code == ExitCode.WRONG_USAGE
    assert told.startswith(f"{program}: ")
    assert told.count("\n") == 1


@pytest.mark.parametrize("program", APPS)
def test_without_words_the_commands_are_listed(run, program):
    code, shown, _ = run(program)
    assert code == 0
    for words, _ in ALL:
        assert words[0] != program or len(words) > 2 or words[1] in shown


@pytest.mark.parametrize(("words", "command"), ALL, ids=[" ".join(words) for words, _ in ALL])
def test_every_command_has_a_short_help_option(words, command):
    context = command.make_context(words[-1], [], resilient_parsing=True, help_option_names=["-h", "--help"])
    assert {"-h", "--help"} <= set(command.get_help_option(context).opts)


@pytest.mark.parametrize(("words", "command"), LEAVES, ids=[" ".join(words) for words, _ in LEAVES])
def test_every_help_text_has_examples_that_parse(words, command):
    lines = [line.strip() for line in command.epilog.splitlines()[2:]]
    assert lines
    for line in lines:
        given = shlex.split(line)
        assert tuple(given[: len(words)]) == words
        parsed(APPS[words[0]], given[1:])


@pytest.mark.parametrize("name", OPERATIONS)
def test_every_operation_of_ctl_has_an_example_that_parses(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_program.script").write_text("sync()\n")
    given = shlex.split(command_line.example(name))[2:]
    parser = command_line.make_parser()
    asked = vars(parser.parse_args(given))
    assert asked.pop("command") == name
    command_line._arguments(name, asked)
    (subparsers,) = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    assert command_line.example(name) in subparsers.choices[name].format_help()


@pytest.mark.parametrize("program", APPS)
def test_completion_is_offered_for_the_shells(program):
    names = {
        option for parameter in typer.main.get_command(APPS[program]).params for option in parameter.opts
    }
    assert {"--install-completion", "--show-completion"} <= names


@pytest.mark.parametrize(
    ("line", "offered", "not_offered"),
    [
        ("ur-emulator ctl ", {"push", "set_digital_input", "--host"}, {"--force"}),
        ("ur-emulator ctl pu", {"push"}, {"state"}),
        ("ur-emulator ctl --json push ", {"--force", "--duration", "--token"}, {"push", "--json"}),
        ("ur-emulator ctl push --force 0 0 20 --d", {"--duration"}, {"--force"}),
        ("ur-emulator ctl set_digital_input --group ", {"standard", "configurable", "tool"}, {"--n"}),
        ("ur-emulator ctl set_digital_input --level o", {"on", "off"}, {"--n"}),
    ],
)
def test_the_shell_completes_what_ctl_takes(monkeypatch, capsys, line, offered, not_offered):
    words = line.split(" ")
    for name, value in {
        "_UR_EMULATOR_COMPLETE": "complete_bash",
        "COMP_WORDS": line,
        "COMP_CWORD": str(len(words) - 1),
    }.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(SystemExit):
        ur_emulator.cli.app(prog_name="ur-emulator")
    shown = set(capsys.readouterr().out.split())
    assert offered <= shown
    assert not shown & not_offered


def test_the_software_of_the_robot_keeps_its_old_option_in_serve_only():
    for words, command in LEAVES:
        taken = {option for parameter in command.params for option in parameter.opts}
        assert ("--version" in taken) == (words == ("ur-emulator", "serve"))
    for option in ("--software", "--version"):
        assert parsed(APPS["ur-emulator"], ["serve", option, "3.4.0"])["software"] == "3.4.0"


@pytest.mark.parametrize(
    "words",
    [("ur-emulator", "serve", "--software", "3.99"), ("urscript", "check", "--software", "3.99", "a.script")],
)
def test_software_that_does_not_exist_is_named(run, words):
    code, _, told = run(*words)
    assert code == ExitCode.WRONG_USAGE
    assert "no software 3.99 is known: that of CB3 ends with 3.15" in told


def test_where_a_box_cannot_run_that_is_said(run, monkeypatch):
    for platform in ("linux", "darwin"):
        ur_emulator.check_platform(platform)
    monkeypatch.setattr(ur_emulator.cli, "check_platform", partial(ur_emulator.check_platform, "win32"))
    assert run("ur-emulator", "serve") == (
        ExitCode.FAILED,
        "",
        "ur-emulator: the box needs Linux or macOS: on Windows, run it in WSL 2 (docs/commands.md)\n",
    )


def test_a_host_that_does_not_exist_is_named_by_ctl(run):
    code, _, told = run("ur-emulator", "ctl", "state", "--host", "nowhere.invalid")
    assert code == ExitCode.FAILED
    assert re.fullmatch(r".*nowhere\.invalid.*cannot be looked up.*\n", told)


@pytest.mark.parametrize("name", MODULES)
@pytest.mark.parametrize(
    "raised", ["KeyboardInterrupt", "ImportError() from KeyboardInterrupt()"], ids=["python", "c"]
)
def test_ctrl_c_while_a_command_is_loaded_is_one_line(name, raised, tmp_path, monkeypatch, capfd):
    """Ctrl-C may come while modules are imported; those in C fail then."""
    (tmp_path / "slow_module.py").write_text(f"raise {raised}\n")
    monkeypatch.delitem(sys.modules, "slow_module", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "argv", [f"/somewhere/{name}"])
    with pytest.raises(SystemExit) as end:
        ur_hil.run_command("slow_module")
    assert (end.value.code, capfd.readouterr().err) == (ExitCode.INTERRUPTED, f"{name}: interrupted\n")
