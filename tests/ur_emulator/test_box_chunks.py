"""The builtins of the box: they agree with the catalogue, and a corpus of chunks calls each and shows each error."""

import ast
import inspect
import re
from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest
from box_support import Bench
from chunk_bench import compiled, run_box_chunk
from chunk_marks import load_box_chunks

import ur_emulator.machine.scripting
from ur_emulator.machine.scripting.robot_host import robot_hosts
from urscript.builtins import PURE
from urscript.catalogue import CB3_3_15, catalogue_for
from urscript.catalogue.types import Support
from urscript.errors import ScriptCompileError

# Run by the interpreter itself.
FLOW = {"sync", "sleep", "textmsg", "varmsg"}
STATEMENTS = {"pause"}


def offered():
    bench = Bench()
    host = robot_hosts(bench.controller.state)()
    return (set(host.builtins()) | set(PURE) | FLOW) - STATEMENTS


VERSIONS = ("3.15", "5.0", "5.4", "5.9", "5.12", "5.15", "5.17", "5.18", "5.22", "5.25", "10.11", "10.12")


@pytest.mark.parametrize("version", VERSIONS)
def test_every_function_takes_the_parameters_of_its_row(version):
    bench = Bench()
    effects = robot_hosts(bench.controller.state)().builtins()
    for row in catalogue_for(version):
        values = [None] * len(row.params)
        if row.name in effects:
            inspect.signature(effects[row.name]).bind(None, *values)
        elif row.name in PURE and not row.any_names:
            inspect.signature(PURE[row.name]).bind(*values)


@pytest.mark.parametrize("version", VERSIONS)
def test_every_modelled_builtin_is_offered_and_every_offered_one_is_modelled(version):
    catalogue = catalogue_for(version)
    modelled = {row.name for row in catalogue if row.support is not Support.DECLARED_ONLY}
    missing = modelled - offered()
    undeclared = {name for name in offered() if name in catalogue} - modelled
    assert not missing
    assert not undeclared


def test_the_box_offers_nothing_that_the_language_does_not_know():
    e_series = [catalogue_for("5.11"), catalogue_for("5.25")]
    assert {name for name in offered() if not any(name in each for each in (CB3_3_15, *e_series))} == set()


SCRIPTING = Path(ur_emulator.machine.scripting.__file__).parent
FILES = sorted(Path(__file__).parent.glob("chunks/**/*.script"))
CHUNKS = load_box_chunks(*FILES)


@pytest.mark.parametrize("chunk", CHUNKS, ids=str)
def test_box_chunk(chunk):
    run_box_chunk(chunk)


RIGHT = """def p():
  textmsg("a")      #0> a
  sync()
  protective_stop()
  x = get_flag(1)
end
#event C209A0 ...
#event safety PROTECTIVE_STOP
#cycles 2
#state robot_mode 7
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("#0> a", "#0> b"),
        ("#0> a", "#1> a"),
        ("#0> a", ""),
        ("#event safety PROTECTIVE_STOP", ""),
        ("#event C209A0 ...", "#event C20A0 ..."),
        ("#cycles 2", "#cycles 3"),
        ("#state robot_mode 7", "#state robot_mode 6"),
        ("#cycles 2", "#! 3:3 something"),
        ("#cycles 2", "#paused"),
        ("#cycles 2", '#sent "x"'),
        ("#cycles 2", "#called f []"),
        ("#cycles 2", "#life started q"),
        ("#cycles 2", "#modbus 1 1 1"),
        ("#cycles 2", "#custom 1 1 []"),
        ("get_flag(1)", "get_flag(99)"),
        ("get_flag(1)", "get_flag()"),
    ],
)
def test_a_wrong_expectation_is_noticed(tmp_path, old, new):
    file = tmp_path / "wrong.script"
    file.write_text(RIGHT)
    run_box_chunk(*load_box_chunks(file))
    assert old in RIGHT
    file.write_text(RIGHT.replace(old, new))
    with pytest.raises(AssertionError):
        run_box_chunk(*load_box_chunks(file))


def test_corpus_is_there():
    assert len(CHUNKS) >= 130


@pytest.mark.parametrize("catalogue", [CB3_3_15, catalogue_for("5.11"), catalogue_for("5.25")])
def test_every_modelled_builtin_that_needs_a_robot_is_called(catalogue):
    called = builtins_called()
    modelled = {row.name for row in catalogue if row.support is not Support.DECLARED_ONLY}
    missing = modelled - set(PURE) - called
    assert not missing


def test_every_error_text_of_the_box_occurs():
    texts = [text for chunk in CHUNKS for _, _, _, text in chunk.errors]
    missing = [
        f"{path.name}: {pattern}"
        for path in sorted(SCRIPTING.glob("*.py"))
        for pattern in error_patterns(path)
        if not any(re.search(pattern, text) for text in texts)
    ]
    assert not missing


@cache
def builtins_called():
    """The builtins that the programs of all chunks name."""
    called = set()
    for chunk in CHUNKS:
        programs = [chunk.text, *chunk.then]
        programs += [action.removeprefix("run ") for _, action in chunk.actions if action.startswith("run ")]
        for text in programs:
            with suppress(ScriptCompileError):
                called.update(compiled(text, catalogue_for(chunk.software)).builtins)
    return called


def error_patterns(path):
    """What the errors that a module raises look like, with anything where values are filled in."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in (
            "ScriptRuntimeError",
            "RemoteCallError",
        ):
            match node.args[0]:
                case ast.Constant(str(text)):
                    yield re.escape(text)
                case ast.JoinedStr(parts):
                    yield "".join(
                        re.escape(part.value) if isinstance(part, ast.Constant) else ".+" for part in parts
                    )
