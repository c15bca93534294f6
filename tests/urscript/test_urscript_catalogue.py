"""The table of builtins against the script manuals, and the page that shows all of it."""

import itertools
import pickle
from collections import Counter

import pytest

from docs.generate.coverage_page import render
from urscript.builtins import pure_builtins
from urscript.catalogue import (
    ALL_ROWS,
    CB3_3_15,
    REQUIRED,
    Builtin,
    Generation,
    ParamType,
    Support,
    TimeClass,
    Version,
    catalogue_for,
)
from urscript.catalogue.calls import compile_check, fits
from urscript.catalogue.catalogue import read_rows
from urscript.catalogue.methods import METHODS

VERSIONS = (
    "3.2", "3.8", "3.14", "3.15", "5.0", "5.4", "5.10", "5.11", "5.15", "5.21", "5.23", "5.25", "10.13",
)  # fmt: skip


@pytest.mark.parametrize(
    ("version", "counts", "n_undocumented"),
    [
        ("3.15", {"motion": 35, "internals": 44, "urmath": 34, "interfaces": 65, "ioconfiguration": 16}, 16),
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


@pytest.mark.parametrize("minor", range(1, 26))
def test_each_release_of_the_e_series_brought_its_functions_and_dropped_none(minor):
    before, after = ({row.name for row in ALL_ROWS if row.is_in(Version(5, n))} for n in (minor - 1, minor))
    assert len(after - before) == BROUGHT.get(minor, 0)
    assert before <= after


@pytest.mark.parametrize(
    ("version", "name", "known"),
    [
        ("3.5", "get_tcp_offset", False),
        ("3.6", "get_tcp_offset", True),
        ("3.7", "protective_stop", False),
        ("3.8", "protective_stop", True),
        ("3.13", "tool_contact", False),
        ("3.14", "tool_contact", True),
        ("3.14", "get_inverse_kin_has_solution", False),
        ("5.8", "get_inverse_kin_has_solution", False),
        ("5.9", "get_inverse_kin_has_solution", True),
        ("5.9", "set_target_payload", False),
        ("5.10", "set_target_payload", True),
        ("5.14", "make_list", False),
        ("5.15", "make_list", True),
        ("5.22", "get_jacobian", False),
        ("5.23", "get_jacobian", True),
        ("3.15", "interpreter_mode", False),
        ("3.15", "set_tool_communication", False),
        ("10.7", "optimovej", False),
        ("10.8", "optimovej", True),
        ("5.24", "ros_publisher_factory", False),
        ("10.11", "ros_publisher_factory", True),
        ("10.10", "direct_torque", False),
        ("10.11", "direct_torque", True),
    ],
)
def test_first_releases(version: str, name: str, known: bool) -> None:
    assert (name in catalogue_for(version)) is known


@pytest.mark.parametrize(
    ("version", "name", "signature"),
    [
        ("3.15", "movej", "movej(q, a=1.4, v=1.05, t=0, r=0)"),
        ("3.15", "movel", "movel(pose, a=1.2, v=0.25, t=0, r=0)"),
        ("3.15", "movep", "movep(pose, a=1.2, v=0.25, r=0)"),
        ("3.15", "movec", "movec(pose_via, pose_to, a=1.2, v=0.25, r=0, mode=0)"),
        ("3.15", "servoj", "servoj(q, a=0, v=0, t=0.008, lookahead_time=0.1, gain=300)"),
        ("5.25", "servoj", "servoj(q, a=0, v=0, t=0.002, lookahead_time=0.1, gain=300)"),
        ("3.15", "stopl", "stopl(a, aRot=a)"),
        ("3.15", "stop_conveyor_tracking", "stop_conveyor_tracking(a=20)"),
        ("3.15", "freedrive_mode", "freedrive_mode()"),
        (
            "5.10",
            "freedrive_mode",
            "freedrive_mode(freeAxes=[1, 1, 1, 1, 1, 1], feature=p[0, 0, 0, 0, 0, 0])",
        ),
        (
            "3.15",
            "get_inverse_kin",
            "get_inverse_kin(x, qnear=current joint positions, maxPositionError=1e-10, "
            "maxOrientationError=1e-10, tcp=active TCP)",
        ),
        ("3.15", "popup", 'popup(s, title="Popup", warning=False, error=False, blocking=False)'),
        ("3.15", "socket_open", 'socket_open(address, port, socket_name="socket_0")'),
        (
            "3.15",
            "socket_read_binary_integer",
            'socket_read_binary_integer(number, socket_name="socket_0", timeout=2)',
        ),
        (
            "3.15",
            "socket_read_string",
            'socket_read_string(socket_name="socket_0", prefix="", suffix="", interpret_escape=False, '
            "timeout=2)",
        ),
        ("3.15", "rtde_set_watchdog", 'rtde_set_watchdog(variable_name, min_frequency, action="pause")'),
        (
            "5.25",
            "direct_torque",
            "direct_torque(torque, friction_comp=True, viscous_scale=[0.9, 0.9, 0.8, 0.9, 0.9, 0.9], "
            "coulomb_scale=[0.8, 0.8, 0.7, 0.8, 0.8, 0.8])",
        ),
        ("5.24", "direct_torque", "direct_torque(torque, friction_comp=True)"),
        ("10.11", "direct_torque", "direct_torque(torque, friction_comp=True)"),
        ("5.17", "time", "time()"),
        ("5.18", "time", "time(mode=0)"),
        (
            "5.10",
            "set_target_payload",
            "set_target_payload(m, cog, inertia=[0, 0, 0, 0, 0, 0], transition_time=0)",
        ),
    ],
)
def test_signatures(version: str, name: str, signature: str) -> None:
    assert catalogue_for(version)[name].signature == signature


@pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: f"{row.name}-{row.since}")
def test_row_is_sane(row: Builtin) -> None:
    names = [param.name for param in row.params]
    assert len(set(names)) == len(names)
    optional = [not param.is_required for param in row.params]
    assert optional == sorted(optional), "a parameter with default stands before one without"
    assert row.summary
    assert row.source
    assert str(row.since) != "-"
    # Approximate rows say what differs.
    assert bool(row.note) or row.support is Support.EXACT


@pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: f"{row.name}-{row.since}")
def test_defaults_fit_their_own_parameters(row: Builtin) -> None:
    defaults = [param.default for param in row.params if param.default is not REQUIRED]
    required = [param for param in row.params if param.is_required]
    for param in row.params[len(required) :]:
        if param.default is not None:
            assert fits(param.type, param.default)
    if not required:
        compile_check(row)(defaults)


RESULTS = {
    "None", "bool", "int", "float", "number", "string", "pose", "list", "handle", "value", "int or float",
    "float or None", "int or list", "bool or int", "matrix or list", "matrix or pose", "matrix 6 x 6", "list of 3",
    "list of 6", "list of 32 bool", "list of strings", "list of number + 1", "struct", "struct(mass", "struct(sec",
}  # fmt: skip


@pytest.mark.parametrize("row", ALL_ROWS, ids=lambda row: f"{row.name}-{row.since}")
def test_results_are_declared_in_words_the_compiler_reads(row: Builtin) -> None:
    assert row.returns.partition(",")[0] in RESULTS


@pytest.mark.parametrize("version", VERSIONS)
def test_no_version_has_two_forms_of_one_name(version: str) -> None:
    wanted = Version.of(version)
    names = Counter(row.name for row in ALL_ROWS if row.is_in(wanted))
    assert [name for name, count in names.items() if count > 1] == []
    assert catalogue_for(version).names == set(names)


def test_successive_forms_leave_no_gap() -> None:
    forms: dict[str, list[Builtin]] = {}
    for row in ALL_ROWS:
        forms.setdefault(row.name, []).append(row)
    for rows in forms.values():
        for earlier, later in itertools.pairwise(rows):
            ends, begins = earlier.until.e_series, later.since.e_series
            only_other_generation = earlier.since.e_series is None
            assert only_other_generation or ends == begins


def test_time_classes_that_the_interpreter_depends_on() -> None:
    def of_class(time: TimeClass) -> set[str]:
        return {row.name for row in CB3_3_15 if row.time is time}

    assert of_class(TimeClass.FRAMES) == {"sleep", "sync"}
    moves = "movej movel movep movec servoj servoc speedj speedl stopj stopl stop_conveyor_tracking"
    assert of_class(TimeClass.MOTION) == set(moves.split())
    modes = "force_mode freedrive_mode teach_mode"
    begin = {*modes.split(), "freedrive_mode_no_incorrect_payload_check"}
    assert of_class(TimeClass.SWITCH) == begin | {f"end_{mode}" for mode in modes.split()}
    reads = {row.name for row in CB3_3_15 if row.name.startswith(("socket_read", "request_"))}
    assert of_class(TimeClass.BLOCKING) == reads | {"popup", "socket_open", "socket_get_var"}
    assert CB3_3_15["speedj"].may_wait
    assert not CB3_3_15["force_mode"].may_wait
    assert not CB3_3_15["socket_send_int"].may_wait


def test_pure_functions_are_exactly_those_of_the_table() -> None:
    newest = catalogue_for("5.25")
    strings = {row.name for row in newest if row.name.startswith(("str_", "to_"))}
    urmath = {row.name for row in newest if row.module == "urmath"}
    assert set(pure_builtins(0)) == strings | urmath
    assert all(newest[name].support is not Support.DECLARED_ONLY for name in pure_builtins(0))


def test_module_variables_and_arrays() -> None:
    values = {name: item.value for name, item in CB3_3_15.variables.items()}
    assert values == {
        "a_joint_default": 1.4,
        "a_tool_default": 1.2,
        "v_joint_default": 1.05,
        "v_tool_default": 0.25,
    }
    array = CB3_3_15.arrays["digital_out"]
    assert array.getter in CB3_3_15
    assert array.setter in CB3_3_15
    assert CB3_3_15[array.getter].params[0].high == array.size - 1


def test_extra_names_are_switched_on_by_hand() -> None:
    opened = catalogue_for("3.15", extra=["set_tool_communication", "movej"])
    assert "set_tool_communication" in opened
    assert opened["movej"] == CB3_3_15["movej"]
    assert "set_tool_communication" not in CB3_3_15
    with pytest.raises(ValueError, match="no builtin named 'no_such'"):
        catalogue_for("3.15", extra=["no_such"])


def test_versions() -> None:
    assert Version.of("3.15.8") == Version.of((3, 15, 8, 106339)) == (3, 15)
    assert catalogue_for((3, 15, 8, 0)) is CB3_3_15
    assert Version(5, 9) < Version(5, 11)
    assert [Version(major, 0).generation for major in (3, 5, 10, 11)] == [
        Generation.CB3,
        Generation.E_SERIES,
        Generation.POLYSCOPE_X,
        Generation.POLYSCOPE_X,
    ]
    with pytest.raises(ValueError, match=r"use 3\.x"):
        catalogue_for("1.8")
    with pytest.raises(ValueError, match="not a software version"):
        catalogue_for("three")


@pytest.mark.parametrize(
    ("misspelt", "meant"),
    [
        ("movJ", "movej"),
        ("getactual_joint_positions", "get_actual_joint_positions"),
        ("sock_open", "socket_open"),
        ("a_joint_defualt", "a_joint_default"),
        ("my_functoin", "my_function"),
        ("zzz", None),
    ],
)
def test_suggestions(misspelt: str, meant: str | None) -> None:
    assert CB3_3_15.suggest(misspelt, ["my_function"]) == meant


def test_parameter_types_all_have_a_check() -> None:
    assert [kind for kind in ParamType if kind is not ParamType.ANY and fits(kind, object())] == []


def test_a_catalogue_of_the_tables_is_pickled_by_its_version_and_any_other_whole():
    assert pickle.loads(pickle.dumps(CB3_3_15)) is CB3_3_15
    own = catalogue_for("5.11", rows=ALL_ROWS[:30])
    assert pickle.loads(pickle.dumps(own)).names == own.names < catalogue_for("5.11").names


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


# --- the page


def test_page_shows_every_form_of_every_function() -> None:
    page = render()
    assert [row.signature for row in ALL_ROWS if f"`{row.signature}`" not in page] == []


def test_totals_add_up() -> None:
    line = next(line for line in render().splitlines() if line.startswith("| **total**"))
    cells = [int(cell) for cell in line.split("|")[2:6]]
    assert cells == [*(sum(row.support is kind for row in CB3_3_15) for kind in Support), len(CB3_3_15)]


def test_page_shows_every_method() -> None:
    page = render()
    assert [row.form for row in METHODS if f"`{row.form}`" not in page] == []


def test_every_version_has_its_totals() -> None:
    for version in ("3.15", "5.12", "10.11"):
        line = next(
            line for line in render().splitlines() if line.startswith("| ") and f" {version} |" in line
        )
        rows = catalogue_for(version)
        counts = [*(sum(row.support is kind for row in rows) for kind in Support), len(rows)]
        assert [int(cell) for cell in line.split("|")[2:6]] == counts


def test_tables_are_rectangular() -> None:
    width = 0
    for line in render().splitlines():
        if not line.startswith("|"):
            width = 0
            continue
        cells = line.replace("\\|", "").count("|")
        width = width or cells
        assert cells == width, line
