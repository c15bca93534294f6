"""The table of builtins against the script manuals, and how calls fit its rows.

The texts of wrong arguments are in `chunks/errors_of_arguments.script`.
"""

import itertools
import pickle
from collections import Counter
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urscript.builtins import pure_builtins
from urscript.catalogue import ALL_ROWS, CB3_3_15, Builtin, Generation, TimeClass, catalogue_for
from urscript.catalogue.calls import compile_fitting, fits, static_bind
from urscript.catalogue.catalogue import read_rows
from urscript.catalogue.types import REQUIRED, ParamType, Support, Version
from urscript.check.checking import check_program
from urscript.errors import ScriptRuntimeError, ScriptTypeError

VERSIONS = (
    "3.2", "3.8", "3.14", "3.15", "5.0", "5.4", "5.10", "5.11", "5.15", "5.21", "5.23", "5.25", "10.13",
)  # fmt: skip

# --- rows


@pytest.mark.parametrize(
    ("version", "counts", "n_undocumented"),
    [
        ("3.15", {"motion": 35, "internals": 44, "urmath": 34, "interfaces": 65, "ioconfiguration": 16}, 17),
        ("5.11", {"motion": 44, "internals": 48, "urmath": 34, "interfaces": 63, "ioconfiguration": 14,
                  "processpath": 9, "interpreter_mode": 3}, 14),
    ],
)  # fmt: skip
def test_chapters_have_as_many_functions_as_the_manual(version, counts, n_undocumented):
    catalogue = catalogue_for(version)
    documented = [row for row in catalogue if row.is_documented_in(catalogue.version)]
    assert Counter(row.module for row in documented) == counts
    assert len(catalogue) == len(documented) + n_undocumented


# e-Series release -> how many functions it brought. Source: the manuals by release, gates of the maker's clients.
BROUGHT = {3: 1, 4: 1, 9: 2, 10: 6, 14: 1, 15: 14, 16: 2, 17: 4, 19: 2, 21: 2, 22: 2, 23: 5, 24: 23}


def test_each_release_of_the_e_series_brought_its_functions_and_dropped_none():
    names = [{row.name for row in ALL_ROWS if row.is_in(Version(5, minor))} for minor in range(26)]
    for minor, (before, after) in enumerate(itertools.pairwise(names), start=1):
        assert len(after - before) == BROUGHT.get(minor, 0)
        assert before <= after


def described(rows):
    return [f"{row.name}-{row.since}" for row in rows]


def test_every_row_says_what_it_is():
    assert described(row for row in ALL_ROWS if not row.summary) == []
    assert described(row for row in ALL_ROWS if str(row.since) == "-") == []
    # Approximate rows say what differs.
    assert described(row for row in ALL_ROWS if not row.note and row.support is not Support.EXACT) == []


def test_parameters_have_names_of_their_own_and_those_with_defaults_come_last():
    for row in ALL_ROWS:
        names = [param.name for param in row.params]
        assert len(set(names)) == len(names), row.name
        optional = [not param.is_required for param in row.params]
        assert optional == sorted(optional), row.name


def test_defaults_fit_their_own_parameters():
    for row in ALL_ROWS:
        for param in row.params:
            assert param.default in (REQUIRED, None) or fits(param.type, param.default), (
                row.name,
                param.name,
            )
        if not any(param.is_required for param in row.params):
            compile_fitting(row.name, row.params, row.nan_ok)([param.default for param in row.params])


RESULTS = {
    "None", "bool", "int", "float", "number", "string", "pose", "list", "handle", "value", "int or float",
    "float or None", "int or list", "bool or int", "matrix or list", "matrix or pose", "matrix 6 x 6", "list of 3",
    "list of 6", "list of 32 bool", "list of strings", "list of number + 1", "struct", "struct(mass", "struct(sec",
}  # fmt: skip


def test_results_are_declared_in_words_the_compiler_reads():
    assert {row.returns.partition(",")[0] for row in ALL_ROWS} <= RESULTS


@pytest.mark.parametrize("version", VERSIONS)
def test_no_version_has_two_forms_of_one_name(version):
    wanted = Version.of(version)
    names = Counter(row.name for row in ALL_ROWS if row.is_in(wanted))
    assert [name for name, count in names.items() if count > 1] == []
    assert {row.name for row in catalogue_for(version)} == set(names)


def test_successive_forms_leave_no_gap():
    forms: dict[str, list[Builtin]] = {}
    for row in ALL_ROWS:
        forms.setdefault(row.name, []).append(row)
    for rows in forms.values():
        for earlier, later in itertools.pairwise(rows):
            ends, begins = earlier.until.e_series, later.since.e_series
            only_other_generation = earlier.since.e_series is None
            assert only_other_generation or ends == begins


def test_pure_functions_are_exactly_those_of_the_table():
    newest = catalogue_for("5.25")
    strings = {row.name for row in newest if row.name.startswith(("str_", "to_"))}
    urmath = {row.name for row in newest if row.module == "urmath"}
    assert set(pure_builtins(0)) == strings | urmath
    assert all(newest[name].support is not Support.DECLARED_ONLY for name in pure_builtins(0))


def test_an_array_ends_where_its_functions_do():
    for array in CB3_3_15.arrays.values():
        for name in (array.getter, array.setter):
            assert CB3_3_15[name].params[0].high == array.size - 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f(a: number)\n    sum\n    exact", "write name"),
        ("f(a: number) -> None", "write name"),
        ("f(a: float) -> None\n    sum\n    exact", "'a: float' of .* is not a parameter"),
        ("f(a: number = 1 2) -> None\n    sum\n    exact", "'a: number = 1 2' of .* is not a parameter"),
        ("f() -> None\n    sum\n    exactly", "exactly in 'exactly'; allowed: zero, motion"),
    ],
)
def test_a_row_that_cannot_be_read_is_refused(text, message):
    with pytest.raises(ValueError, match=message):
        list(read_rows(text, "motion"))


def test_what_holds_by_default_ends_with_the_section():
    text = "by default:\n    exact, nan ok\nf() -> int\n    one\ng() -> int\n    two\n    motion, exact\n\n"
    f, g, h = read_rows(text + "h() -> int\n    three\n    approximate: why", "motion")
    assert [row.nan_ok for row in (f, g, h)] == [True, False, False]
    assert (g.time, h.support, h.note) == (TimeClass.MOTION, Support.APPROXIMATE, "why")


# --- catalogues


def test_versions():
    assert Version.of("3.15.8") == Version.of((3, 15, 8, 106339)) == (3, 15)
    assert catalogue_for((3, 15, 8, 0)) is CB3_3_15
    assert Version(5, 9) < Version(5, 11)
    assert [Version(major, 0).generation for major in (3, 5, 10)] == list(Generation)
    assert Version(11, 0).generation is Generation.POLYSCOPE_X
    with pytest.raises(ValueError, match=r"use 3\.x"):
        catalogue_for("1.8")
    with pytest.raises(ValueError, match="not a software version"):
        catalogue_for("three")


@pytest.mark.parametrize(
    ("misspelt", "meant"),
    [
        ("movJ", "movej"),
        ("getactual_joint_positions", "get_actual_joint_positions"),
        ("a_joint_defualt", "a_joint_default"),
        ("my_functoin", "my_function"),
        ("zzz", None),
    ],
)
def test_suggestions(misspelt, meant):
    assert CB3_3_15.suggest(misspelt, ["my_function"]) == meant


def test_so_many_names_of_a_program_get_a_suggestion():
    errors, _ = check_program("\n".join(f"movej{n}()" for n in range(42)))
    assert [error.hint for error in errors] == 40 * ["did you mean 'movej'?"] + [None, None]


def test_a_catalogue_of_the_tables_is_pickled_by_its_version_and_any_other_whole():
    assert pickle.loads(pickle.dumps(CB3_3_15)) is CB3_3_15
    own = catalogue_for("5.11", rows=ALL_ROWS[:30])
    assert list(pickle.loads(pickle.dumps(own))) == list(own)
    assert len(own) < len(catalogue_for("5.11"))


# --- calls


@pytest.mark.parametrize(
    ("name", "n_positional", "keywords", "text"),
    [
        ("speedl", 2, ["t_min"], "speedl() got an unexpected keyword argument 't_min'"),
        ("set_tcp", 0, [], "set_tcp takes exactly 1 argument (0 given)"),
        ("movej", 6, [], "movej takes exactly 1 to 5 arguments (6 given)"),
        ("str_sub", 1, [], "str_sub takes exactly 2 or 3 arguments (1 given)"),
        ("socket_open", 1, ["socket_name"], "socket_open() missing required argument 'port'"),
        ("movej", 1, ["a", "a"], "movej() got multiple values for keyword argument 'a'"),
    ],
)
def test_wrong_calls(name, n_positional, keywords, text):
    with pytest.raises(ScriptTypeError) as caught:
        CB3_3_15.static_bind(name, n_positional, keywords)
    assert caught.value.message == text
    assert caught.value.hint == f"use {CB3_3_15[name].signature}"
    assert caught.value.wire_text == f"Type error: {text}"


@pytest.mark.parametrize(
    ("version", "name", "n_positional", "keywords", "hint"),
    [
        ("3.15", "modbus_add_signal", 7, [], "5.15, PolyScope X 10.0; this is CB3 3.15"),
        ("5.12", "modbus_add_signal", 5, ["register_count"], "5.15, PolyScope X 10.0; this is e-Series 5.12"),
        ("3.15", "freedrive_mode", 1, [], "5.10, PolyScope X 10.0; this is CB3 3.15"),
    ],
)
def test_a_call_that_other_software_knows_names_it(version, name, n_positional, keywords, hint):
    with pytest.raises(ScriptTypeError) as caught:
        catalogue_for(version).static_bind(name, n_positional, keywords)
    assert caught.value.hint == f"with these arguments it is known since e-Series {hint}"


def test_every_row_binds_its_shortest_and_longest_call():
    for row in ALL_ROWS:
        if row.any_names:
            continue
        n_required, n_all = sum(param.is_required for param in row.params), len(row.params)
        kinds = [kind for kind, _ in static_bind(row, n_required)]
        assert kinds == ["arg"] * n_required + ["default"] * (n_all - n_required)
        assert static_bind(row, n_all) == [("arg", i) for i in range(n_all)]


@given(data=st.data(), row=st.sampled_from(sorted(CB3_3_15, key=lambda row: row.name)))
def test_any_split_into_positional_and_named_binds_the_same(data, row):
    names = [param.name for param in row.params]
    n_positional = data.draw(st.integers(0, len(names)))
    named = data.draw(st.permutations(names[n_positional:]))
    slots = [("arg", i) for i in range(n_positional)] + [("kw", name) for name in names[n_positional:]]
    assert CB3_3_15.static_bind(row.name, n_positional, tuple(named)) == slots


def test_parameter_types_all_have_a_check():
    assert [kind for kind in ParamType if kind is not ParamType.ANY and fits(kind, object())] == []


def taken(row, param, value):
    """What a builtin gets for a value, with its type; None if it refuses it."""
    try:
        (got,) = compile_fitting(row.name, (param,), row.nan_ok)([value])
    except ScriptRuntimeError:
        return None
    return repr(got)


def test_a_bool_is_a_number_and_a_number_a_bool_for_every_parameter():
    for row in ALL_ROWS:
        for param, length, (a_bool, a_number) in product(row.params, (0, 3, 6), ((True, 1), (False, 0))):
            first, second = ([value] * length if length else value for value in (a_bool, a_number))
            if not (fits(param.type, first) and fits(param.type, second)):  # else it takes values of any type
                assert taken(row, param, first) == taken(row, param, second), (row.name, param)
