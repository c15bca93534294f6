"""The pages docs/protocol/*.md leave nothing out, and what they show works."""

import dataclasses
import re
import shlex
from pathlib import Path

import pytest

from docs.generate import ports_page, primary_page, realtime_page, rtde_page, scripts_page
from docs.generate.page_parts import table
from protocol.__main__ import _parser
from protocol.primary.layout import SUB_PACKAGES
from protocol.primary.messages import MESSAGES
from protocol.realtime.layout import COLUMNS, VERSIONS
from protocol.rtde.fields import input_fields, output_fields
from protocol.script_channel import CONTROLLER_WORDS
from protocol.ur_types import Ports, SoftwareVersion
from protocol.wire_record import wire_fields

FOLDER = Path(__file__).parents[2] / "docs" / "protocol"


def test_every_page_of_the_folder_is_linked_from_the_overview():
    overview = ports_page.render()
    for path in FOLDER.glob("*.md"):
        assert path.name == "README.md" or f"({path.name})" in overview


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.md")), ids=lambda path: path.name)
def test_links_lead_somewhere(path):
    for target in re.findall(r"\]\(([^)#]+)", path.read_text()):
        assert (path.parent / target).exists(), target


def test_every_port_has_a_row():
    assert {row.name for row in ports_page.ROWS} == {field.name for field in dataclasses.fields(Ports)}


def test_every_column_and_size_is_on_the_page_of_30003():
    page = realtime_page.render()
    for column in COLUMNS:
        assert page.count(f"| `{column.name}` |") == 1
    for version, size in VERSIONS:
        assert f"| {version.major}.{version.minor} | {size} |" in page


def test_the_sample_of_a_frame_has_the_names_and_units_of_the_columns():
    lines = [line for line in realtime_page._SAMPLE[1:] if "..." not in line]
    for line, column in zip(lines, COLUMNS, strict=False):
        assert line.split()[0] == column.name
        assert line.split()[-1] == column.unit
        assert line.count(",") == column.count - 1


def test_every_field_and_message_is_on_the_page_of_30001():
    page = primary_page.render()
    for record in SUB_PACKAGES:
        assert f"### {record.SUB_TYPE} {record.__name__}\n" in page
        assert all(f"| `{field.name}` |" in page for field in wire_fields(record))
    for message in MESSAGES:
        row = next(
            line
            for line in page.splitlines()
            if line.startswith(f"| {message.MESSAGE_TYPE} | {message.__name__}")
        )
        assert all(f"`{field.name}`" in row for field in wire_fields(message))


@pytest.mark.parametrize("version", [SoftwareVersion(3, 15, 8), SoftwareVersion(5, 12)])
@pytest.mark.parametrize("fields", [output_fields, input_fields])
def test_every_variable_is_on_the_page_of_30004(version, fields):
    names = set()
    for stem, first, last in re.findall(r"^\| `(\w+?)(\d*)(?: \.\.\. (\d+))?` \|", rtde_page.render(), re.M):
        names |= {f"{stem}{n}" for n in range(int(first), int(last) + 1)} if last else {stem + first}
    assert set(fields(version)) <= names


def test_every_word_is_on_the_page_of_scripts():
    page = scripts_page.render()
    assert all(f"| `{word.text}" in page for word in CONTROLLER_WORDS)


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.md")), ids=lambda path: path.name)
def test_the_commands_that_pages_show_exist(path):
    for command in re.findall(r"python -m protocol ([^`\n]+)", path.read_text()):
        if "FILE" not in command and command not in ("layout", "decode"):
            _parser().parse_args(shlex.split(command))


def test_a_bar_in_a_cell_does_not_end_it():
    assert list(table(("a", "b"), [("x|y", 1)])) == ["| a | b |", "|---|---|", "| x\\|y | 1 |"]
