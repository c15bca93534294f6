"""The operations, and everything that follows from their dataclasses: methods, checks, page, JSON."""

import inspect
import json
import math
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ur_emulator.commands.operation import Kind
from ur_emulator.commands.surroundings import SIZES
from ur_emulator.control_api.operations import OPERATIONS, BoxOperations, ReadProperty, describe, make
from ur_emulator.control_api.step_operations import CONDITIONS
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import ArgumentError
from ur_emulator.plant.obstacles import SHAPES

ROOT = Path(__file__).parents[2]
EVERY = pytest.mark.parametrize("name", OPERATIONS)
# A value of each kind that must fit, beside ranges.
FITTING = {Kind.BOOLEAN: True, Kind.TEXT: "text", Kind.SCRIPT: "text", Kind.ANSWER: 7, Kind.OBJECT: {"x": 1}}


def fitting(parameter):
    if parameter.kind is Kind.CHOICE:
        return parameter.choices[0]
    if parameter.kind is Kind.VECTOR:
        return (0.1,) * parameter.lengths[1]
    return FITTING.get(parameter.kind, 1 if parameter.high is None else parameter.high)


@EVERY
def test_an_operation_that_acts_is_a_method_with_its_parameters_and_its_sentence(name):
    operation, method = OPERATIONS[name], getattr(ControlBox, name)
    assert inspect.getdoc(method).splitlines()[0] == operation.meaning
    if operation.only_reads:
        assert isinstance(method, ReadProperty)
        return
    assert method.__name__ == name
    parameters = list(inspect.signature(method).parameters.values())[1:]
    assert [p.name for p in parameters] == [p.name for p in operation.parameters]
    for mine, row in zip(parameters, operation.parameters, strict=True):
        assert (mine.default is inspect.Parameter.empty) == row.is_required
        if not row.is_required:
            assert mine.default == row.default
        assert f"\n    {row.name}: {row.meaning} ({row.allowed})." in method.__doc__


@EVERY
def test_a_method_hands_all_its_arguments_on(name):
    asked = {}

    class Recorder(BoxOperations):
        def _perform(self, name, arguments):
            asked[name] = arguments
            return {"tick": 3}

    operation = OPERATIONS[name]
    values = {p.name: fitting(p) for p in operation.parameters}
    if operation.only_reads:
        return
    assert getattr(Recorder(), name)(**values) == 3
    assert asked == {name: values}


def test_no_method_is_without_an_operation():
    assert {name for name in vars(BoxOperations) if not name.startswith("_")} == set(OPERATIONS)


def test_conditions_are_those_of_wait_until():
    names = {p.name for p in OPERATIONS["wait_until"].parameters}
    assert names == set(CONDITIONS) | {"time", "log", "after", "timeout"}


def test_the_shapes_of_obstacles_are_those_of_the_plant():
    assert list(SIZES) == list(SHAPES)


@EVERY
def test_what_fits_is_taken_and_defaults_are_filled_in(name):
    operation = OPERATIONS[name]
    required = {p.name: fitting(p) for p in operation.parameters if p.is_required}
    assert list(asdict(make(name, required))) == [p.name for p in operation.parameters]
    everything = {p.name: fitting(p) for p in operation.parameters}
    assert asdict(make(name, everything)) == everything


@EVERY
def test_what_is_missing_or_unknown_is_named(name):
    rows = OPERATIONS[name].parameters
    with pytest.raises(ArgumentError, match="no parameter 'colour'"):
        make(name, {p.name: fitting(p) for p in rows} | {"colour": 1})
    for parameter in rows:
        if parameter.is_required:
            others = {p.name: fitting(p) for p in rows if p is not parameter}
            with pytest.raises(ArgumentError, match=f"{name} needs {parameter.name}"):
                make(name, others)


ODD = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=2),
)


@EVERY
@settings(max_examples=40)
@given(data=st.data())
def test_whatever_comes_fits_or_is_refused_in_one_line(name, data):
    for parameter in OPERATIONS[name].parameters:
        value = data.draw(ODD)
        try:
            checked = parameter.check(value)
        except ArgumentError as error:
            complaint = str(error)
        else:
            complaint = ""
        if complaint:
            assert "\n" not in complaint
            assert complaint.startswith(parameter.name)
            continue
        numbers = checked if isinstance(checked, tuple) else [checked]
        for number in numbers:
            if isinstance(number, float):
                assert math.isfinite(number)
                assert parameter.low is None or number >= parameter.low
                assert parameter.high is None or number <= parameter.high
        json.dumps(checked).encode()


@pytest.mark.parametrize(
    ("operation", "name", "text", "value"),
    [
        ("set_digital_input", "level", "ON", True),
        ("set_digital_input", "level", "false", False),
        ("set_digital_input", "level", "up", "up"),
        ("set_digital_input", "n", "3", 3),
        ("set_digital_input", "n", "three", "three"),
        ("set_speed", "fraction", "0.5", 0.5),
        ("push", "force", "1 2 -3", [1.0, 2.0, -3.0]),
        ("push", "force", "1,2,x", [1.0, 2.0, "x"]),
        ("answer", "value", "true", True),
        ("answer", "value", "3", 3),
        ("answer", "value", "3.5", 3.5),
        ("answer", "value", '"3"', "3"),
        ("answer", "value", "some words", "some words"),
        ("answer", "value", "[" * 100_000, "[" * 100_000),
        ("add_to_log", "text", "3", "3"),
    ],
)
def test_words_of_a_command_line_become_values(operation, name, text, value):
    parameter = {p.name: p for p in OPERATIONS[operation].parameters}[name]
    parsed = parameter.parse(text)
    assert (parsed, type(parsed)) == (value, type(value))


def test_the_table_is_json():
    rows = json.loads(json.dumps(describe(), allow_nan=False))
    assert [row["name"] for row in rows] == list(OPERATIONS)
    assert all(row["meaning"].endswith(".") for row in rows)


def test_the_command_line_loads_no_physics():
    code = "import sys, ur_emulator.control_api.command_line; print(*sorted({'mujoco', 'numpy', 'lark'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == ""
