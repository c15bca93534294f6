"""The quick loop over the parser's table makes what lark makes of it, place by place, or leaves the text to lark."""

from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lark.exceptions import LarkError
from random_trees import WORDS, programs
from tree_printer import print_program

from urscript.errors import ScriptSyntaxError
from urscript.syntax.parser import _lark, _quick

CHUNKS = sorted(Path(__file__).parent.glob("chunks/*.script"))


def by_lark(text):
    try:
        return _lark().parse(text)
    except (LarkError, ScriptSyntaxError):
        return None


def everything(node):
    """All nodes of a tree, one after the other, with the places that do not count when trees are compared."""
    found, todo = [], [node]
    while todo:
        item = todo.pop()
        if is_dataclass(item):
            found.append(type(item).__name__)
            todo += [getattr(item, field.name) for field in fields(item)]
        elif type(item) is tuple:
            found.append(len(item))
            todo += item
        else:
            found.append((type(item).__name__, item))
    return found


def assert_same(text):
    expected = by_lark(text)
    found = _quick().parse(text)
    assert (found is None) == (expected is None)
    if expected is not None:
        assert everything(found) == everything(expected)


@pytest.mark.parametrize("file", CHUNKS, ids=lambda file: file.name)
def test_all_chunks_are_read_alike(file):
    for text in file.read_bytes().decode("latin-1").split("\n---"):
        assert_same(text)


@settings(max_examples=50)
@given(programs)
def test_random_programs_are_read_alike(tree):
    assert_same(print_program(tree))


@given(st.lists(st.sampled_from([*WORDS, "\r\n"]), max_size=25).map(" ".join))
def test_random_words_are_read_alike(text):
    assert_same(text)


@given(st.text(st.characters(max_codepoint=255), max_size=40))
def test_random_bytes_are_read_alike(text):
    assert_same(text)
