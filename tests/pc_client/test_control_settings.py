"""The numbers of a controller: what each may be, where they come from, and what tells two settings apart."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pc_client.control.controller import CONTROLLERS, FIELDS, Controller, load_controller
from pc_client.errors import ControllerError

PAPER = CONTROLLERS["paper"]

values = {
    name: st.floats(field.schema["ge"], field.schema["le"]) if field.kind is float else st.booleans()
    for name, field in FIELDS.items()
}
controllers = st.builds(
    Controller.changed,
    st.sampled_from(list(CONTROLLERS.values())),
    st.fixed_dictionaries({}, optional=values),
)


def test_the_table_has_a_row_for_every_field_but_the_name():
    assert {"name", *FIELDS} == {field.name for field in dataclasses.fields(Controller)}


@pytest.mark.parametrize("config", CONTROLLERS.values(), ids=lambda config: config.name)
def test_named_controllers_keep_the_ranges(config):
    own = {name: getattr(config, name) for name in FIELDS}
    assert config.changed(own) == config
    assert config.title == config.name


@given(one=controllers, other=controllers)
def test_a_title_stands_for_one_setting(one, other):
    assert (one.title == other.title) == (one == other)
    assert one.title.startswith(one.name)


def test_a_title_names_what_differs_from_the_named_controller():
    assert PAPER.changed({"gain_p": 4, "gain_i": 2.0}).title == "paper"
    own = PAPER.changed({"gain_p": 10, "gain_i": 2.5, "uses_ilc": True})
    assert own.title == "paper with gain_p 10, gain_i 2.5, uses_ilc true"


def load(folder, text):
    path = folder / "my.toml"
    path.write_text(text, encoding="utf-8")
    return load_controller(str(path))


def test_a_file_starts_from_a_named_controller(tmp_path):
    assert load(tmp_path, "") == CONTROLLERS["preview"]
    own = load(tmp_path, 'base = "paper"\ngain_p = 10\nuses_preview = true')
    assert own == dataclasses.replace(PAPER, gain_p=10.0, uses_preview=True)
    assert isinstance(own.gain_p, float)


def test_a_file_may_give_every_field(tmp_path):
    best = CONTROLLERS["best"]
    own = {name: getattr(best, name) for name in FIELDS}
    lines = [f"{name} = {str(v).lower() if isinstance(v, bool) else v}" for name, v in own.items()]
    read = load(tmp_path, "\n".join(lines))
    assert {name: getattr(read, name) for name in FIELDS} == own


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gain_p = [", "not TOML"),
        ("gain_q = 3", "gain_q: no such key; did you mean gain_"),
        ('name = "mine"', "name: no such key"),
        ('base = "papr"', "base: 'papr'; give one of paper, preview, best"),
        ("gain_p = true", "gain_p: True; give a number"),
        ("gain_i = -0.1", "gain_i: -0.1; give a number"),
        ("speedj_acceleration = 0", "give a number from 0.1 to 100 rad/s2"),
        ("learning_gain = 1.5", "give a number from 0 to 1"),
    ],
)
def test_a_file_that_makes_no_sense_is_one_line_with_file_and_field(text, words, tmp_path):
    with pytest.raises(ControllerError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "my.toml"))
    assert words in message
    assert "\n" not in message


def test_a_file_that_is_not_there():
    with pytest.raises(ControllerError, match=r"nowhere\.toml: cannot be read"):
        load_controller("nowhere.toml")


def test_a_name_that_nobody_knows():
    with pytest.raises(ControllerError, match=r"'pid'; choose one of paper, preview, best"):
        load_controller("pid")
