import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lark import Lark
from program_texts import print_program, programs, statements
from typer.testing import CliRunner

from urscript.cli import app
from urscript.errors import ScriptSyntaxError
from urscript.formatter import format_program
from urscript.source import Source
from urscript.syntax.nodes import same_tree
from urscript.syntax.parser import parse

ROOT = Path(__file__).parents[2]
# Chunks are left out: they have no other words and no other layouts than random programs.
FOLDERS = ("urscript", "ur_emulator", "pc_client", "examples", "tests/programs", "docs")
SCRIPTS = sorted(file for folder in FOLDERS for file in (ROOT / folder).rglob("*.script"))
COMMENTS = []
LEXER = Lark(
    (ROOT / "urscript" / "syntax" / "grammar.lark").read_text(encoding="utf-8"),
    parser="lalr",
    lexer="basic",
    lexer_callbacks={"COMMENT": COMMENTS.append},
    keep_all_tokens=True,
)


def formatted(text):
    return format_program(Source(text))


def comments_of(text):
    """Every comment, in order, found in another way than the formatter does: by the lexer."""
    COMMENTS.clear()
    list(LEXER.lex(text))
    return [str(comment).rstrip(" \t\r\f\v") for comment in COMMENTS]


def assert_is_canonical(result):
    assert formatted(result) == result
    lines = result.split("\n")
    assert lines[-1] == ""
    assert lines[0] != "" or result == ""
    assert "\n\n\n" not in result
    assert not [line for line in lines if line != line.rstrip(" \t\r")]


comment_texts = st.text(st.characters(max_codepoint=255, exclude_characters="\n"), max_size=6)
gaps = st.one_of(
    st.sampled_from([" ", "\n", "\t", "\r\n", "\n\n", "\n\n\n\n", "   \n  \n"]),
    st.builds(
        "{}#{}\n{}".format,
        st.sampled_from([" ", "\n", "\n\n\n  "]),
        comment_texts,
        st.sampled_from(["", "  "]),
    ),
)


@given(programs, st.data())
def test_any_blanks_and_comments_between_tokens_leave_the_tree_and_the_comments_as_they_are(tree, data):
    canonical = print_program(tree)
    assert formatted(canonical) == canonical
    text = data.draw(gaps)
    for token in LEXER.lex(canonical):
        # Nothing but a line end can stand after a label.
        text += token + ("\n" if token.type == "LABEL" else "") + data.draw(gaps)
    assert parse(Source(text)) == tree
    result = formatted(text)
    assert parse(Source(result)) == tree
    assert comments_of(result) == comments_of(text)
    assert_is_canonical(result)


@pytest.mark.parametrize("file", SCRIPTS, ids=lambda file: file.name)
def test_all_scripts_of_the_tree_stay_what_they_are(file):
    n_programs = 0
    for text in re.split(r"^---\s*$", file.read_bytes().decode("latin-1"), flags=re.MULTILINE):
        try:
            parse(Source(text))
        except ScriptSyntaxError:
            continue
        n_programs += 1
        result = formatted(text)  # raises where the layout would change the tree
        assert comments_of(result) == comments_of(text)
        assert_is_canonical(result)
    assert n_programs


# --- the layout ------------------------------------------------------------------------------------------

LAYOUTS = {
    "blank lines": ("\n\n\na = 1\n\n\n\nb = 2\n\nc = 3\n\n", "a = 1\n\nb = 2\n\nc = 3\n"),
    "empty": (" \n\n", ""),
    "only a comment": ("\n  # x  ", "# x\n"),
    "carriage returns": ("a = 1\r\n# c\r\nb = 2\r\n", "a = 1\n# c\nb = 2\n"),
    "labels": ('if x:\n$   2  "Move"  \nend', 'if x:\n  $ 2  "Move"\nend\n'),
    "a byte that looks like a blank": 2 * ('$ 1 "\xc3\xa0\n# \xc3\xa0\n',),
}
_FILE = Path(__file__).with_name("layouts.script").read_text(encoding="utf-8")
for name, _, both in (part.partition("\n") for part in re.split(r"^--- ", _FILE, flags=re.MULTILINE)[1:]):
    LAYOUTS[name] = both.split(">>>\n")


@pytest.mark.parametrize(("text", "expected"), LAYOUTS.values(), ids=LAYOUTS)
def test_the_canonical_layout(text, expected):
    assert formatted(text) == expected


def test_a_program_stays_one_program_on_the_wire():
    """Only the first line and the last `end` stand in column 1: that is how a controller finds the end."""
    text = "def f(\n):\n# c\nif (a and\nb\n) :\n$ 1\nx = [\n1\n]\n\nend\nend"
    lines = formatted(text).splitlines()
    assert [line for line in lines if line and line[0] != " "] == ["def f():", "end"]
    text = "def f(a,\nb\n):\nend"
    assert formatted(text) == "def f(a,\n    b\n  ):\nend\n"


def test_deep_nesting_is_laid_out_or_refused_in_words():
    for text in ("if True:\n" * 1000 + "end\n" * 1000, "x = " + "(" * 1000 + "1" + ")" * 1000 + "\n"):
        try:
            result = formatted(text)
        except ScriptSyntaxError:
            result = text
        assert result.replace(" ", "") == text.replace(" ", "")


# --- the command -----------------------------------------------------------------------------------------

UGLY, PRETTY = "x=1\r\n\n\n\ny = 2", "x = 1\n\ny = 2\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("ugly.script").write_bytes(UGLY.encode())
    Path("pretty.script").write_bytes(PRETTY.encode())
    Path("wrong.script").write_bytes(b"def f(:\n")
    return tmp_path


def call(*words, **more):
    return CliRunner().invoke(app, ["fmt", *words], **more)


def test_fmt_goes_on_after_a_program_with_errors_and_leaves_it_alone(folder):
    result = call("wrong.script", "ugly.script", "pretty.script")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "wrong.script:1:7: Syntax error" in result.stderr
    assert Path("wrong.script").read_bytes() == b"def f(:\n"
    assert Path("ugly.script").read_bytes() == Path("pretty.script").read_bytes() == PRETTY.encode()


def test_fmt_reads_and_writes_the_standard_streams():
    result = call("-", input=b'x="\xc3\xa4\xff"')
    assert (result.exit_code, result.stdout_bytes) == (0, b'x = "\xc3\xa4\xff"\n')


def test_check_and_diff_write_nothing(folder):
    result = call("--check", "ugly.script", "pretty.script")
    assert (result.exit_code, result.output) == (1, "ugly.script: not in canonical layout\n")
    assert call("--check", "pretty.script").exit_code == 0
    result = call("--diff", "ugly.script", "pretty.script")
    assert result.exit_code == 0
    assert "-x=1\r\n+x = 1\n" in result.stdout_bytes.decode()
    assert call("--diff", "--check", "ugly.script").exit_code == 1
    assert Path("ugly.script").read_bytes() == UGLY.encode()


@given(programs, statements)
def test_same_tree_is_equality(tree, other):
    assert same_tree(tree, parse(Source(print_program(tree))))
    assert not same_tree(tree, (*tree, other))
    for changed in ((*tree, other), (*tree[:-1], other), (other, *tree[1:])):
        assert same_tree(tree, changed) == (tree == changed)
