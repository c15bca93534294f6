"""What the packages share: records of files, patience, the check of package names."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ur_hil.input_files import MIB, FileKind
from ur_hil.patience import LONGEST_STEP, Patience
from ur_hil.records import (
    Finite,
    Flag,
    Items,
    checked,
    fields_of,
    number,
    record,
    text,
    whole,
    word,
)

ROOT = Path(__file__).parents[1]

# --- records: nothing is converted, nothing is left over, and what is wrong is one line


class ReadError(Exception):
    pass


@record
class Part:
    name: Annotated[str, text(5)]
    at: tuple[Finite, Finite] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.at[0] > self.at[1]:
            raise ValueError("at", "give the smaller one first")


@record
class Whole:
    share: Annotated[float, number(0.0, 1.0)]
    parts: Annotated[tuple[Part, ...], Items(1, 3)] = (Part(name="a"),)
    seed: Annotated[int, whole(0)] = 0
    colour: Annotated[str, word(("red", "blue"))] = "red"
    end: Literal["stop", "blend"] = "stop"
    on: Flag = False
    facts: Mapping[str, Finite] = field(default_factory=dict)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({}, "share: missing; give a number from 0 to 1"),
        ({"share": True}, "share: True; give a number from 0 to 1"),
        ({"share": "0.5"}, "share: '0.5'; give a number from 0 to 1"),
        ({"share": math.nan}, "share: nan; give a number from 0 to 1"),
        ({"share": 10**400}, "give a number from 0 to 1"),
        ({"share": 16**5000}, "share: a number of thousands of digits; give a number from 0 to 1"),
        ({"share": 1, "shade": 1}, "shade: no such key; did you mean share?"),
        ({"share": 1, "xyz": 1}, "xyz: no such key; known are share, parts, seed, colour, end, on, facts"),
        ({"share": 1, "seed": 1.0}, "seed: 1.0; give a whole number from 0"),
        ({"share": 1, "seed": -1}, "seed: -1; give a whole number from 0"),
        ({"share": 1, "colour": "green"}, "colour: 'green'; give one of red, blue"),
        ({"share": 1, "colour": []}, "colour: []; give one of red, blue"),
        ({"share": 1, "end": "go"}, "end: 'go'; give 'stop' or 'blend'"),
        ({"share": 1, "on": 1}, "on: 1; give true or false"),
        ({"share": 1, "parts": 1}, "parts: 1; give a list"),
        ({"share": 1, "parts": []}, "parts: []; give a list of 1 or more"),
        ({"share": 1, "parts": [1]}, "parts[0]: 1; give a table"),
        ({"share": 1, "parts": [{"name": "a"}] * 4}, "give a list of 3 or fewer"),
        ({"share": 1, "parts": [{"name": "a\nb"}]}, "parts[0].name: 'a\\nb'; give a text of at most 5"),
        ({"share": 1, "parts": [{"name": "a", "at": [1]}]}, "parts[0].at[1]: missing; give a finite number"),
        ({"share": 1, "parts": [{"name": "a", "at": [2, 1]}]}, "parts[0].at: give the smaller one first"),
        ({"share": 1, "parts": [{"name": "a", "as": 1}]}, "parts[0].as: no such key; did you mean at?"),
        ({"share": 1, "facts": 3}, "facts: 3; give a table"),
        ({"share": 1, "facts": {"a": "x"}}, "facts.a: 'x'; give a finite number"),
        (3, "3; give a table"),
    ],
)
def test_what_is_wrong_is_named_with_what_is_allowed(values, says):
    with pytest.raises(ReadError) as caught:
        checked(Whole, values, "f.toml", ReadError)
    message = str(caught.value)
    assert message.startswith("f.toml: ")
    assert says in message
    assert "\n" not in message
    assert len(message) < 300


def test_a_record_is_made_of_what_was_given():
    made = checked(Whole, {"share": 1, "parts": [{"name": "b", "at": [0, 2]}], "on": True}, "f", ReadError)
    assert made == Whole(share=1.0, parts=(Part(name="b", at=(0.0, 2.0)),), on=True)
    assert isinstance(made.share, float)


def test_a_field_says_what_it_may_hold_and_reads_a_single_value():
    fields = fields_of(Whole)
    assert list(fields) == ["share", "seed", "colour", "on"]
    assert (fields["seed"].kind, fields["on"].text) == (int, "true or false")
    assert checked(fields["share"], 1, "--share", ReadError) == 1.0
    with pytest.raises(ReadError, match=r"^--share: 2; give a number from 0 to 1$"):
        checked(fields["share"], 2, "--share", ReadError)


_VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=9), st.dates()),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["share", "parts", "seed", "name", "at", "x"]), inner)
    ),
    max_leaves=8,
)


@given(_VALUES)
def test_any_values_make_a_record_or_one_line(values):
    try:
        made = checked(Whole, values, "f.toml", ReadError)
    except ReadError as error:
        assert "\n" not in str(error)  # noqa: PT017 - one of two allowed outcomes
        return
    assert 0.0 <= made.share <= 1.0
    assert made.parts


def test_a_file_is_read_into_its_record(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('share = 0.5\n[[parts]]\nname = "é"\n', encoding="utf-8")
    kind = FileKind(MIB, ReadError, "")
    assert kind.read_record(path, Whole).parts[0].name == "é"
    path.write_text("share = 2")
    with pytest.raises(ReadError, match=r"a\.toml: share: 2; give a number from 0 to 1"):
        kind.read_record(path, Whole)


# --- patience: waiting counts only while the one who waits runs


@given(st.lists(st.floats(0.0, LONGEST_STEP), max_size=50))
def test_who_looks_often_counts_the_time_that_passes(steps):
    patience, now = Patience(), 1e6
    assert patience.spent(now) == 0.0
    for step in steps:
        now += step
        spent = patience.spent(now)
    assert abs((spent if steps else 0.0) - (now - 1e6)) < 1e-6


@given(st.lists(st.floats(0.0, 1e6), min_size=1, max_size=50))
def test_a_jump_of_the_clock_counts_as_one_step_at_most(steps):
    patience, now = Patience(), 0.0
    patience.spent(now)
    for step in steps:
        before, now = patience.spent(now), now + step
        assert before <= patience.spent(now) <= before + LONGEST_STEP + 1e-9


def test_a_new_wait_begins_with_its_first_look():
    patience = Patience()
    patience.spent(0.0)
    assert patience.spent(0.05) == 0.05
    patience.restart()
    assert patience.spent(10.0) == 0.0


# --- another package of one of our names is said in one line at import


@pytest.mark.parametrize("other", ["protocol/__init__.py", "protocol.py"])
def test_another_package_before_ours_is_named(other, tmp_path):
    (tmp_path / other).parent.mkdir(exist_ok=True)
    (tmp_path / other).touch()
    code = """
for package in ("pc_client", "ur_emulator", "urscript"):
    try:
        __import__(package)
    except ImportError as error:
        print(error)
"""
    places = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    said = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=places, capture_output=True, text=True
    )
    assert said.stdout.count(f"finds 'protocol' at {tmp_path / other}") == 3
    assert said.stdout.count("rename the other one") == said.stdout.count("\n") == 3
