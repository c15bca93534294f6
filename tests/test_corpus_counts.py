"""The conformance corpus as a whole: the chunks of the language and those of the box, counted."""

import re
from collections import defaultdict
from pathlib import Path

import pytest

from urscript.catalogue import CB3_3_15
from urscript.errors import ScriptSyntaxError
from urscript.source import Source
from urscript.syntax import nodes
from urscript.syntax.nodes import all_expressions, all_statements, own_expressions
from urscript.syntax.parser import parse

TESTS = Path(__file__).parent
FOLDERS = ("urscript", "ur_emulator")
# What is said to people; marks with what is expected follow the sign at once.
COMMENT = re.compile(r'("[^"\n]*")|#(?: |#|ref ).*')
NUMBER = re.compile(r'("[^"\n]*")|(?<!\w)[0-9]*\.?[0-9]+([eE][+-]?[0-9]+)?')


def chunks(folder):
    """Name and text of every chunk of a folder."""
    for file in sorted((TESTS / folder / "chunks").glob("*.script")):
        line = 1
        for text in re.split(r"^---\s*$", file.read_bytes().decode("latin-1"), flags=re.MULTILINE):
            if text.strip():
                yield f"{file.name}:{line}", text
            line += text.count("\n")


CHUNKS = [chunk for folder in FOLDERS for chunk in chunks(folder)]


def calls(block):
    """Names of all functions that a block calls, also in the functions that it defines."""
    for statement in all_statements(block):
        if isinstance(statement, nodes.Function):
            yield from calls(statement.body)
        for expression in own_expressions(statement):
            for part in all_expressions(expression):
                if isinstance(part, nodes.Call):
                    yield part.function


def builtins_called(text):
    try:
        return set(calls(parse(Source(text))))
    except ScriptSyntaxError:
        return set()


@pytest.mark.parametrize("folder", FOLDERS)
def test_each_folder_has_chunks(folder):
    assert any(chunks(folder))


def test_there_are_at_least_400_chunks():
    assert len(CHUNKS) >= 400


def test_every_builtin_of_the_cb3_is_called():
    called = set().union(*(builtins_called(text) for _, text in CHUNKS))
    assert {row.name for row in CB3_3_15} - called == set()


def test_no_chunk_is_another_one_with_other_numbers():
    alike = defaultdict(list)
    for name, text in CHUNKS:
        program = COMMENT.sub(lambda found: found[1] or "", text)
        alike[" ".join(NUMBER.sub(lambda found: found[1] or "0", program).split())].append(name)
    assert [names for names in alike.values() if len(names) > 1] == []
