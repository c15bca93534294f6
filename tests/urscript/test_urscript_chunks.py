"""The conformance corpus: every chunk runs, every rule and every error of the language is shown by one.

The places in the code that make an error are found in its syntax; those that chunks pass are recorded while
the chunks run. An error counts only if a chunk ended with it.
"""

import ast
import re
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest
from chunk_runner import load_chunks, matches, run_chunk, unknown_types

import urscript
from urscript import errors
from urscript.builtins import pure_builtins

TESTS = Path(__file__).parents[1]
CHUNKS = load_chunks(*sorted((TESTS / "urscript" / "chunks").glob("*.script")))


@pytest.mark.parametrize("chunk", CHUNKS, ids=str)
def test_chunk(chunk):
    errors_of(chunk)


@pytest.mark.parametrize("chunk", CHUNKS, ids=str)
def test_chunk_without_static_types(chunk):
    with unknown_types():
        run_chunk(chunk)


def test_a_wrong_expectation_is_noticed():
    assert matches("a ... b", "a long b")
    assert not matches("a ... b", "a long c")
    assert not matches("division", "division by zero")


def test_every_row_of_the_language_notes_is_shown_by_a_chunk():
    notes = Path(__file__).with_name("reference_rows.txt").read_text(encoding="utf-8")
    rows = re.findall(r"^([^#\n].*?): ", notes, re.MULTILINE)
    assert {row for chunk in CHUNKS for row in chunk.rows} == set(rows)
    assert len(rows) == len(set(rows)) > 100


def test_every_builtin_without_a_robot_is_called_by_a_chunk():
    called = {name for chunk in CHUNKS for name in re.findall(r"\b(\w+)\(", chunk.text)}
    assert set(pure_builtins(0)) - called == set()


def test_no_chunk_is_another_one_with_other_numbers():
    """Of all chunks, those of the box too; marks of what is expected are part of a chunk, words for people are not."""
    comment = re.compile(r'("[^"\n]*")|#(?: |#|ref ).*')
    number = re.compile(r'("[^"\n]*")|(?<!\w)[0-9]*\.?[0-9]+([eE][+-]?[0-9]+)?')
    alike = defaultdict(list)
    for chunk in load_chunks(*sorted(TESTS.glob("*/chunks/*.script"))):
        program = comment.sub(lambda found: found[1] or "", chunk.text)
        alike[" ".join(number.sub(lambda found: found[1] or "0", program).split())].append(str(chunk))
    assert [names for names in alike.values() if len(names) > 1] == []


# --- errors ----------------------------------------------------------------------------------------------

PACKAGE = Path(urscript.__file__).parent
# Commands and warnings: they report errors, their own tests look at those.
NOT_THE_LANGUAGE = re.compile(r"(check|commands)/.*|(cli|formatter)\.py")
ERROR_CLASSES = {
    name for name, value in vars(errors).items() if isinstance(value, type) and issubclass(value, Exception)
}

OUT_OF_REACH = {
    "compile/compiler.py compile_resolved": "the limits before it are lower than Python's",
    "compile/interpreter_mode.py compile_statements": "as program.py resolve_source; tests/ur_emulator/test_interpreter",
    "names/resolver.py resolve": "201 functions; test_urscript_running",
    "program.py resolve_source": "the resolver is deeper than the compiler in no program short enough for a chunk",
    "program.py RunningProgram._finish": "a fault of a host; test_urscript_running",
    "run/runtime.py _declared_only.call": "the recording host has every builtin; the chunks of the box do",
    "program.py _script_error": "a fault of a host; test_urscript_running",
    "values.py Pose.of": "six items are the grammar's",
}
"""Functions whose errors no chunk can make, and why."""


UNUSED_TEXTS = {r"at\ most\ .+"}
"""Parts of texts that no builtin needs: none has an upper bound alone."""


@cache
def modules():
    """Path below the package, syntax tree of every module of the language."""
    names = [path.relative_to(PACKAGE).as_posix() for path in sorted(PACKAGE.rglob("*.py"))]
    return [
        (name, ast.parse((PACKAGE / name).read_text(encoding="utf-8")))
        for name in names
        if not NOT_THE_LANGUAGE.fullmatch(name)
    ]


def functions(tree, prefix=""):
    """Qualified name and node of every function, the innermost first."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            yield from functions(node, f"{prefix}{node.name}.")
            yield prefix + node.name, node
        else:
            inner = f"{prefix}{node.name}." if isinstance(node, ast.ClassDef) else prefix
            yield from functions(node, inner)


@cache
def makers():
    """Names of the functions that return an error, by what they declare."""
    return {
        node.name
        for _, tree in modules()
        for _, node in functions(tree)
        if isinstance(node.returns, ast.Name) and node.returns.id in ERROR_CLASSES
    }


@cache
def error_sites():
    """File, function, first and last line of every expression that makes an error."""
    return list(_error_sites())


def _error_sites():
    making = ERROR_CLASSES | makers()
    for file, tree in modules():
        seen = set()
        for name, function in functions(tree):
            for node in ast.walk(function):
                if isinstance(node, ast.Call):
                    made = getattr(node.func, "id", getattr(node.func, "attr", ""))
                elif isinstance(node, ast.Raise):
                    made = getattr(node.exc, "id", "")
                else:
                    continue
                if made in making and id(node) not in seen:
                    seen.add(id(node))
                    yield file, name, node.lineno, node.end_lineno


def partial_texts():
    """Patterns of what is put into a variable first, on its way to a message."""
    for _, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, (ast.Assign, ast.AugAssign)):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                if any(getattr(target, "id", "") in ("message", "allowed") for target in targets):
                    yield from patterns(node.value)


def patterns(expression):
    """The strings that an expression can be, with anything where values are filled in."""
    match expression:
        case ast.Constant(str(text)):
            yield re.escape(text)
        case ast.JoinedStr(parts):
            yield "".join(re.escape(p.value) if isinstance(p, ast.Constant) else ".+" for p in parts)
        case ast.IfExp(body=one, orelse=other):
            yield from patterns(one)
            yield from patterns(other)
        case ast.BinOp(left=left):
            yield from patterns(left)


@pytest.fixture(scope="module", autouse=True)
def met():
    """Returns all errors that chunks end with; `passed` of each are the places it came through."""
    make = errors.ScriptError.__init__
    home = f"{PACKAGE.as_posix()}/"

    def note(self, *args, **kwargs):
        make(self, *args, **kwargs)
        self.passed = set()
        frame = sys._getframe(1)
        while frame is not None and frame.f_code.co_filename.startswith(home):
            self.passed.add((frame.f_code.co_filename.removeprefix(home), frame.f_lineno))
            frame = frame.f_back

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(errors.ScriptError, "__init__", note)
        yield lambda: [
            error for chunk in CHUNKS if chunk.errors or chunk.discarded for error in errors_of(chunk)
        ]


@cache
def errors_of(chunk):
    """Run a chunk, once for all tests; the errors that it met."""
    return run_chunk(chunk)


def test_every_error_is_made_by_a_chunk(met):
    passed = set().union(*(error.passed for error in met()))
    missing = {
        f"{file} {function}": line
        for file, function, line, last in error_sites()
        if not any((file, number) in passed for number in range(line, last + 1))
    }
    assert {site: line for site, line in missing.items() if site not in OUT_OF_REACH} == {}
    assert set(OUT_OF_REACH) - set(missing) == set(), "chunks reach these"


def test_every_part_of_a_text_occurs_in_a_chunk(met):
    texts = [error.message for error in met()]
    missing = {pattern for pattern in partial_texts() if not any(re.search(pattern, text) for text in texts)}
    assert missing == UNUSED_TEXTS


def test_the_search_finds_the_places():
    sites = error_sites()
    assert len(sites) > 80
    assert {"type_error", "explain", "_syntax_error", "_out_of_range"} <= makers()
    assert {file for file, *_ in sites} >= {
        "run/runtime.py",
        "run/variables.py",
        "builtins.py",
        "names/resolver.py",
    }
