"""Pages that are made from tables are up to date, leave nothing out, and show what works."""

import dataclasses
import re
import shlex

import pytest

from docs.generate import ports_page, realtime_page, rtde_page
from docs.generate.__main__ import DOCS, PAGES, page
from docs.generate.page_parts import table
from protocol.__main__ import _parser
from protocol.realtime.layout import COLUMNS
from protocol.rtde.fields import input_fields, output_fields
from protocol.ur_types import Ports, SoftwareVersion

PROTOCOL = sorted((DOCS / "protocol").glob("*.md"))


COSTLY = {"movements.md": [pytest.mark.nightly]}  # thirty-five plans


@pytest.mark.parametrize("path", [pytest.param(path, marks=COSTLY.get(path, ())) for path in PAGES])
def test_a_page_is_what_its_tables_make(path):
    assert (DOCS / path).read_text(encoding="utf-8") == page(path), "run: make docs"


def test_the_overview_of_ports_has_every_port_and_every_page():
    overview = ports_page.render()
    assert {row.name for row in ports_page.ROWS} == {field.name for field in dataclasses.fields(Ports)}
    assert [path for path in PROTOCOL if path.name != "README.md" and f"({path.name})" not in overview] == []


@pytest.mark.parametrize("path", PROTOCOL, ids=lambda path: path.name)
def test_commands_of_a_page_exist(path):
    for command in re.findall(r"python -m protocol ([^`\n]+)", path.read_text(encoding="utf-8")):
        if "FILE" not in command and command not in ("layout", "decode"):
            _parser().parse_args(shlex.split(command))


def test_the_sample_of_a_frame_has_the_names_and_units_of_the_columns():
    lines = [line for line in realtime_page._SAMPLE[1:] if "..." not in line]
    for line, column in zip(lines, COLUMNS, strict=False):
        assert line.split()[0] == column.name
        assert line.split()[-1] == column.unit
        assert line.count(",") == column.count - 1


@pytest.mark.parametrize("version", [SoftwareVersion(3, 15, 8), SoftwareVersion(5, 12)])
@pytest.mark.parametrize("fields", [output_fields, input_fields])
def test_every_variable_is_on_the_page_of_30004(version, fields):
    names = set()
    for stem, first, last in re.findall(r"^\| `(\w+?)(\d*)(?: \.\.\. (\d+))?` \|", rtde_page.render(), re.M):
        names |= {f"{stem}{n}" for n in range(int(first), int(last) + 1)} if last else {stem + first}
    assert set(fields(version)) <= names


def test_a_bar_in_a_cell_does_not_end_it():
    assert list(table(("a", "b"), [("x|y", 1)])) == ["| a | b |", "|---|---|", "| x\\|y | 1 |"]
