"""Every block of code of every page runs as it stands, or says why it does not."""

import re
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from page_blocks import (
    APPS,
    MANUAL,
    PAGES,
    PROJECT,
    ROOT,
    PageReader,
    blocks_of,
    commands_in_text,
    options_of,
)

from pc_client.analysis.report import build_tables
from pc_client.movements.movement import Movement, load_movement


def drawing(path):
    """A curved stroke of a pen: x, y in millimetres and t in seconds, 100 samples a second, as fast as a hand."""
    movement = load_movement("lognorm_4_1").stretched(0.15)
    t = np.arange(0.0, movement.duration, 0.01)
    path.write_text(
        "".join(f"{x} {y} {s}\n" for (x, y), s in zip(1e3 * movement.sample(t).p[:, :2], t, strict=True))
    )


def drawings(path):
    """A zip of one drawing."""
    drawing(Path("one.txt"))
    with ZipFile(path, "w") as archive:
        archive.write("one.txt")


def movement(path):
    """A movement of 1.2 s."""
    Movement.through([(0.35, -0.05, 0.25), (0.35, 0.05, 0.28)], durations=[1.2]).save(path)


# What a page shows, at the beginning of a line or in it, and the extra that it needs; the first that fits a line.
NEEDS = {
    r"^dask |^ur-client sweep .*--dask": "cluster",
    r"^ur-client sweep .*search": "search",
    r"^ur-emulator serve .*--pendant|^ur-emulator pendant |^ur-client view |\.view\(": "pendant",
    r"^ur-client (run|experiment|draw|compare|extract|report|sweep) |\.plot\(": "report",
    r"^ur-client |^(import|from) pc_client": "client",
    r"^ur-emulator |^urscript |^python -m protocol|^(import|from) (ur_emulator|urscript|protocol)": "",
}
# Pages that test_wheel.py runs, with what their install brings, and those that cost more than a second or show what
# tests and examples do: `make test` reads them only.
INSTALLED = ("README.md", "docs/start/paper.md", "docs/start/real-ur3.md")
AT_NIGHT = (
    "docs/drawing.md", "docs/extraction.md", "docs/grippers.md", "docs/library.md", "docs/recordings.md",
    "docs/start/driver-in-ci.md", "docs/tracking.md",
)  # fmt: skip
SHOWN = ("sh", "console", "python")
STOCK = {
    "drawing.txt": drawing,
    "targets.csv": lambda path: path.write_text("x,y,z,t\n.3,-.1,.2,0\n.35,0,.25,2\n.3,.1,.2,3.5\n"),
    "my_movement.toml": movement,
    "letter.txt": drawing,
    "reaches/": lambda path: drawing(path / "reach.txt"),
    "others.zip": drawings,
    "my_program.script": lambda path: path.write_text('def hello():\n  textmsg("hello")\nend\n'),
    "my_programs": lambda path: (path / "pick.script").write_text('def hello():\n  textmsg("hello")\nend\n'),
}
"""What a reader has before a page is read."""


@contextmanager
def one_thread(workers, dask):
    """In place of processes, which cost more than the work of a page."""
    with ThreadPoolExecutor(1) as executor:
        yield executor


def brings(extra):
    """An extra and those that it brings; "" stands for the package alone."""
    asked = " ".join(PROJECT["optional-dependencies"].get(extra, ()))
    return {extra, ""}.union(
        *(brings(e) for names in re.findall(r"ur-hil\[(.*?)\]", asked) for e in names.split(","))
    )


@pytest.mark.parametrize("page", MANUAL, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_names_the_install_that_its_blocks_need(page):
    lines = [
        line.removeprefix("$ ")
        for b in blocks_of(page)
        for line in b.text.splitlines()
        if b.language in SHOWN
    ]
    needs = {
        next((e for pattern, e in NEEDS.items() if re.search(pattern, line)), None) for line in lines
    } - {None}
    installs = [line for line in [*lines, *commands_in_text(page)] if line.startswith("pip install")]
    named = re.findall(r"(?<![\w-])(?:\./)?(?:ur-hil|\.)(?:\[([\w,]+)\])?(?=['\s]|$)", "\n".join(installs))
    assert needs <= set().union(*(brings(extra) for extras in named for extra in extras.split(",")))


def test_commands_in_text_and_their_options_exist():
    for page in MANUAL:
        for line in commands_in_text(page):
            if line.split()[0] in APPS and "OPERATION" not in line:
                named = set(re.findall(r"(?<![\w-])--[a-z-]+", line))
                assert named <= options_of(line), f"{page}: {line}"


NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES if "```" in page.read_text(encoding="utf-8")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "runs"),
    [
        *((name, name not in INSTALLED + AT_NIGHT) for name in NAMES),
        *(pytest.param(name, True, marks=pytest.mark.nightly) for name in AT_NIGHT),
    ],
)
def test_the_blocks_of_a_page_run(name, runs, tmp_path, monkeypatch, ur_box_factory):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr("pc_client.studies.executors.open_executor", one_thread)
    # `ur-client report` draws the page of a run; `run` need not draw the same before.
    monkeypatch.setattr("pc_client.commands.experiment.show_report", build_tables)
    (tmp_path / "examples").symlink_to(ROOT / "examples")

    def make_box(**options):
        return ur_box_factory(standard_ports=True, **{"seed": 7, "control_port": 29900, **options})

    blocks = blocks_of(ROOT / name)
    if not runs:
        blocks = [replace(block, reason="another test runs it") for block in blocks]
    PageReader(make_box, STOCK).read(blocks)
