"""Programs deeper and longer than any that a person writes, and several errors in one text."""

import pytest

from urscript.check.checking import check_program
from urscript.errors import ScriptCompileError, ScriptSyntaxError
from urscript.program import compile_program
from urscript.recording_host import RecordingHost


def _error_of(text):
    """The error that compiling `text` gives, None if there is none; anything else flies on."""
    try:
        compile_program(text)
    except ScriptCompileError as error:
        return error
    return None


@pytest.mark.parametrize(
    "text",
    [
        "x = " + "(" * 5000 + "1" + ")" * 5000,
        "x = " + "[" * 3000 + "]" * 3000,
        "x = " + "-" * 5000 + "1",
        "x = " + "not " * 5000 + "True",
        "x = 1" + " + 1" * 5000,
        "x = " + "norm(" * 3000 + "1" + ")" * 3000,
        "x = [1]\ny = x" + "[0]" * 5000,
        "if True:\n" * 3000 + "end\n" * 3000,
        "while True:\n" * 30 + "end\n" * 30,
        "def f():\n" * 2000 + "end\n" * 2000,
        "(" * 10000,
        "x = 0\nif x == 0:\n" + "".join(f"elif x == {n}:\n" for n in range(1, 3000)) + "end",
    ],
    ids=lambda text: text[:12],
)
def test_deep_nesting_compiles_or_is_refused_in_words(text):
    error = _error_of(text)
    assert error is None or error.line >= 1


def test_a_chain_of_many_arms_needs_no_nesting():
    arms = "".join(f"elif x == {n}:\n  textmsg({n})\n" for n in range(1, 300))
    host = RecordingHost()
    host.run(compile_program(f"x = 299\nif x == 0:\n{arms}end"))
    assert host.messages == ["299"]


def test_all_syntax_errors_are_found_in_one_pass():
    text = 'def f():\n  textmsg("a"\n  x = 3 +\n  while x\n    y = 1\n  end\n  a += 1\n  z = 2 @\nend\n'
    errors, _ = check_program(text)
    found = [(error.line, error.column) for error in errors]
    assert found == [(3, 3), (4, 3), (5, 5), (7, 6), (8, 9)]


def test_a_message_shows_no_more_of_a_line_than_a_client_can_hold():
    text = "x = [" + "1, " * 100_000 + "@"
    assert _error_of(text).wire_text == f"syntax_error_on_line:1:{text[:1_000]}:"


@pytest.mark.parametrize("form", ["{} = 1", "global {} = 1", "def {}():\nend", "thread {}():\nend"])
def test_every_name_has_a_longest_length(form):
    assert _error_of(form.format("n" * 255)) is None
    error = _error_of(form.format("n" * 256))
    assert error.message == "a name of 256 characters; allowed: up to 255"
    assert (error.line, error.column, error.width) == (1, 1 + form.index("{"), 256)


def test_a_string_literal_is_no_longer_than_a_string():
    assert _error_of(f'x = "{"a" * 65_536}"') is None
    assert _error_of(f'x = "{"a" * 65_537}"').message == "a string of 65537 characters; allowed: up to 65536"


def test_a_syntax_error_in_the_middle_of_garbage_names_its_line():
    with pytest.raises(ScriptSyntaxError) as caught:
        compile_program("def f():\n  textmsg(1)\n  @@@\nend\n")
    assert (caught.value.line, caught.value.column) == (3, 3)
    assert caught.value.wire_text == "syntax_error_on_line:3:  @@@:"
