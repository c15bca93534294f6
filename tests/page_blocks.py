"""The blocks of code of a page of documentation, and a reader who does what they say.

A page is read from the top in an empty folder:

    `name`: before a block     the block is a file of that name; another block uses it
    python                     runs, all blocks of a page in one namespace; tests in it run under pytest
    sh                         each line runs; `ur-emulator serve` starts the box of the page
    console                    each line after `$` runs and prints what stands below it
    urscript, toml, yaml       are compiled or parsed; the steps of a workflow run
    mermaid                    is drawn when the site is built
    text                       is no code: a formula, a picture in letters, an output seen once

A block that cannot run has the line `<!-- not run: reason -->` before it. In `sh`, commands of this project
are then parsed all the same: programs, options and values exist.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import pytest
import typer
import yaml
from typer.testing import CliRunner

import pc_client.cli
import ur_emulator.cli
import urscript.cli
from docs.generate.sessions import played
from ur_emulator.host.control_api import command_line
from urscript import compile_program

ROOT = Path(__file__).parents[1]
APPS = {"ur-client": pc_client.cli.app, "ur-emulator": ur_emulator.cli.app, "urscript": urscript.cli.app}
PAGES = [
    *ROOT.glob("*.md"),
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "examples").rglob("*.md")),
]
MANUAL = [page for page in PAGES if page.name != "CHANGELOG.md"]  # what holds now
LANGUAGES = {"python", "sh", "console", "urscript", "toml", "yaml", "text", "mermaid"}
CODE = re.compile(r"^(?:\$|ur-\w+|urscript|make|pip|import|from|def|git) ", re.MULTILINE)
_FENCED = re.compile(r"^```.*?^```$", re.DOTALL | re.MULTILINE)
_COMMAND = re.compile(r"`((?:ur-client|ur-emulator|urscript|make|pip|python)\s[^`]+)`")
REASON = re.compile(r"<!-- not run: (.+) -->")
NAME = re.compile(r"`([\w./-]+\.\w+)`:$")
MAKE_TARGETS = set(re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE))
# What would meddle with the pytest that is running already.
_PLAIN_PYTEST = ["-s", *(f"-pno:{name}" for name in ("cacheprovider", "faulthandler", "timeout", "xdist"))]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@dataclass(frozen=True)
class Block:
    """A fenced block: where it stands, its language, its text, the file that it is, why it does not run."""

    page: str
    line: int
    language: str
    text: str
    name: str | None
    reason: str | None

    def __str__(self):
        return f"{self.page}:{self.line}"


def blocks_of(path):
    """All blocks of a page, from the top."""
    lines = path.read_text(encoding="utf-8").splitlines()
    found, begin = [], None
    for number, line in enumerate(lines):
        if not line.startswith("```"):
            continue
        if begin is None:
            begin = number
        elif line == "```":
            before = [text for text in lines[:begin] if text.strip()]
            reason = REASON.fullmatch(before[-1]) if before else None
            name = NAME.search(before[-2 if reason else -1]) if before else None
            found.append(
                Block(
                    path.relative_to(ROOT).as_posix(),
                    begin + 1,
                    lines[begin].removeprefix("```"),
                    "\n".join(lines[begin + 1 : number]) + "\n",
                    name and name[1],
                    reason and reason[1],
                )
            )
            begin = None
    assert begin is None, f"{path}:{begin}: this block does not end"
    return found


class PageReader:
    """Does what the blocks of a page say, in the current folder, with boxes on loopback addresses of its own."""

    def __init__(self, make_box, stock):
        self._make_box, self._stock = make_box, stock
        self._box = None
        self._names = {"__name__": "page"}

    def read(self, blocks):
        """Write the files of the page, then run its blocks."""
        for block in blocks:
            assert block.language in LANGUAGES, f"{block}: its language is not one of {sorted(LANGUAGES)}"
            if block.name:
                Path(block.name).parent.mkdir(parents=True, exist_ok=True)
                Path(block.name).write_text(self._here(block.text), encoding="utf-8")
        text = "".join(block.text for block in blocks)
        for name, write in self._stock.items():
            if name in text and not Path(name).exists():
                if not Path(name).suffix:
                    Path(name).mkdir()
                write(Path(name))
        for block in blocks:
            if block.language == "yaml" and "steps:" in block.text:
                self._workflow(block)
            elif block.name:
                others = [other for other in blocks if other is not block]
                used = any(Path(block.name).stem in other.text for other in others)
                assert used or block.name.startswith("test_"), f"{block}: no other block uses {block.name}"
            else:
                self._run(block)

    def _run(self, block):
        if block.language == "text":
            assert not CODE.search(block.text), f"{block}: this is code, and `text` is never run"
        match block.language:
            case "python" if block.reason is None:
                self._python(block)
            case "python":
                compile(block.text, str(block), "exec")
            case "sh":
                for command in commands_of(block.text):
                    self._command(command, block, parse_only=block.reason is not None)
            case "console" if block.reason is None:
                assert played(block.text) == block.text, f"{block}: run: make docs"
            case "urscript":
                compile_program(block.text)
            case "toml":
                tomllib.loads(block.text)

    def _python(self, block):
        if re.search(r"^def test_", block.text, re.MULTILINE):
            Path(f"test_line_{block.line}.py").write_text(block.text, encoding="utf-8")
            self._pytest([f"test_line_{block.line}.py"], block)
        else:
            exec(compile(self._here(block.text), str(block), "exec"), self._names)

    def _command(self, line, block, parse_only=False):
        words = shlex.split(line, comments=True)
        match words:
            case []:
                return
            case ["make", *targets]:
                assert set(targets) <= MAKE_TARGETS, f"{block}: {line}"
            case ["pip", "install", *names]:
                for name in names:
                    base, _, extras = name.rstrip("]").partition("[")
                    if base == PROJECT["name"]:
                        assert {e for e in extras.split(",") if e} <= set(PROJECT["optional-dependencies"]), (
                            line
                        )
            case ["ur-emulator", "serve", *rest] if not parse_only:
                self._serve(rest)
            case ["ur-emulator", "ctl", *rest] if not parse_only:
                box = self._the_box()
                at = ["--host", box.host, "--control-port", str(box.control_port)]
                assert command_line.main([*rest, *at]) == 0, f"{block}: {line}"
            case ["ur-client", *rest]:
                if parse_only:
                    parsed(pc_client.cli.app, rest)
                else:
                    briefly = ["--seconds", "0.1"] if rest[0] == "doctor" else []
                    words = [self._here(word) for word in rest]
                    assert pc_client.cli.run([*words, *briefly]) == 0, f"{block}: {line}"
            case ["urscript", *rest]:
                if parse_only:
                    parsed(urscript.cli.app, rest)
                else:
                    done = CliRunner().invoke(urscript.cli.app, rest)
                    assert done.exit_code == 0, f"{block}: {line}\n{done.output}"
            case ["ur-emulator", "ctl", *rest]:
                command_line.make_parser().parse_args(rest)
            case ["ur-emulator", *rest]:
                parsed(ur_emulator.cli.app, rest)
            case ["python", "-m", "pytest", *rest] if not parse_only:
                self._pytest(rest, block)
            case ["python", *rest] if not parse_only:
                self._process([sys.executable, *map(self._here, rest)], block)
            case [program, *_] if not parse_only:
                assert shutil.which(program), f"{block}: {program} is not there, so this is not run"
                self._process(["bash", "-ec", self._here(line)], block)

    def _workflow(self, block):
        """Run the steps of a workflow of GitHub Actions; those that `use` somebody else's need a version."""
        for job in yaml.safe_load(block.text)["jobs"].values():
            assert job["runs-on"]
            matrix = job.get("strategy", {}).get("matrix", {})
            for values in product(*matrix.values()):
                for step in job["steps"]:
                    assert ("uses" in step) != ("run" in step), f"{block}: {step}"
                    if "uses" in step:
                        assert re.fullmatch(r"[\w-]+/[\w-]+@v\d+", step["uses"]), f"{block}: {step}"
                    command = step.get("run", "")
                    for name, value in zip(matrix, values, strict=True):
                        command = command.replace(f"${{{{ matrix.{name} }}}}", value)
                    for line in commands_of(command):
                        self._command(line, block)

    def _serve(self, words):
        given = parsed(ur_emulator.cli.app, ["serve", *words])
        options = {
            name: given[name] for name in ("robot", "seed", "fidelity", "tool", "programs", "control_port")
        }
        options["version"] = given["software"]
        options["programs"] = given["programs"] and given["programs"].absolute()
        if given["boxes"] == 1:
            self._box = self._make_box(
                **{name: value for name, value in options.items() if value is not None}
            )

    def _the_box(self):
        if self._box is None:
            self._box = self._make_box()
        return self._box

    def _here(self, text):
        """The text with the addresses of the page's box in place of those that the page names."""
        if not re.search(r"127\.0\.0\.\d|192\.168\.0\.10\b", text):
            return text
        network, _, last = self._the_box().host.rpartition(".")
        text = re.sub(r"\b127\.0\.0\.(\d+)", lambda m: f"{network}.{int(last) + int(m[1]) - 1}", text)
        return re.sub(r"\b192\.168\.0\.10\b", self._box.host, text)

    @staticmethod
    def _pytest(words, block):
        """Run tests of the page in this process, where the next box starts at once; their modules go again."""
        kept, path = set(sys.modules), list(sys.path)
        try:
            assert pytest.main([*_PLAIN_PYTEST, *words]) == 0, f"{block}: pytest {words}"
        finally:
            sys.path[:] = path
            for name in sys.modules.keys() - kept:
                if Path(getattr(sys.modules[name], "__file__", None) or "/").is_relative_to(Path.cwd()):
                    del sys.modules[name]

    @staticmethod
    def _process(words, block):
        places = os.pathsep.join((os.getcwd(), str(ROOT)))
        done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": places})
        assert done.returncode == 0, f"{block}: {words}\n{done.stdout}{done.stderr}"


def commands_of(text):
    """The commands of a shell: lines, joined where a quote or a backslash goes on."""
    command = ""
    for line in text.splitlines(keepends=True):
        command += line
        try:
            shlex.split(command, comments=True)
        except ValueError:
            continue
        yield command.rstrip("\n")
        command = ""
    assert not command, f"this command does not end: {command}"


def shown_commands():
    """Commands by their first words: those that blocks of pages run, and those that pages show.

    In place of what installs and serves, and of targets, a `PageReader` does something else.
    """
    run, shown = set(), set()
    for page in MANUAL:
        for block in blocks_of(page):
            lines = commands_of(block.text) if block.language == "sh" else _after_prompts(block)
            (shown if block.reason else run).update(map(_first_words, lines))
        shown.update(map(_first_words, commands_in_text(page)))
    not_run = {command for command in run if command.startswith(("make ", "pip ", "ur-emulator serve"))}
    return run - not_run - {""}, (shown | not_run) - {""}


def commands_in_text(page):
    """The commands of this project that stand in the running text and the tables of a page."""
    text = _FENCED.sub("", page.read_text(encoding="utf-8"))
    return [" ".join(span.split()).replace("\\|", "|") for span in _COMMAND.findall(text)]


def _after_prompts(block):
    return [line[2:] for line in block.text.splitlines() if line.startswith("$ ")] * (
        block.language == "console"
    )


def _first_words(line):
    """Enough of a command to know it by; "" for none."""
    words = shlex.split(line, comments=True)
    match words:
        case ["python", "-m", "protocol", *_]:
            n = 4
        case ["python", "-m", *_] | ["ur-client", "movements", *_]:
            n = 3
        case ["ur-client" | "ur-emulator" | "urscript" | "make" | "pip" | "python", *_]:
            n = 2
        case _:
            n = 1
    return " ".join(words[:n]) if len(words) >= n else ""


def options_of(line):
    """The long options that a command of this project takes; an error if there is no such command."""
    words = line.split()
    if words[:2] == ["ur-emulator", "ctl"]:
        (operations,) = (a.choices for a in command_line.make_parser()._actions if a.dest == "command")
        parsers = [operations[word] for word in words[2:3] if word in operations] or operations.values()
        return {option for parser in parsers for option in parser._option_string_actions}
    command = typer.main.get_command(APPS[words.pop(0)])
    while hasattr(command, "commands") and words:
        command = command.commands[words.pop(0)]
    return {option for parameter in command.params for option in parameter.opts}


def parsed(app, words):
    """The values that a command of an app would get; what it would refuse is an error here."""
    command = typer.main.get_command(app)
    words = list(words)
    while hasattr(command, "commands") and words[0] in command.commands:
        command = command.commands[words.pop(0)]
    return command.make_context(command.name, words).params
