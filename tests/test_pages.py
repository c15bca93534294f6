"""Every block of code of every page runs as it stands, or says why it does not."""

import re
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from page_blocks import APPS, PAGES, ROOT, PageReader, blocks_of, commands_in_text, options_of

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


def test_commands_in_text_and_their_options_exist():
    for page in (page for page in PAGES if page.name != "CHANGELOG.md"):
        for line in commands_in_text(page):
            if line.split()[0] in APPS:
                named = set(re.findall(r"(?<![\w-])--[a-z-]+", line))
                assert named <= options_of(line), f"{page}: {line}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```" in page.read_text(encoding="utf-8")],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)  # fmt: skip
def test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch, ur_box_factory):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr("pc_client.studies.executors.open_executor", one_thread)
    # `ur-client report` draws the page of a run; `run` need not draw the same before.
    monkeypatch.setattr("pc_client.commands.experiment.show_report", build_tables)
    (tmp_path / "examples").symlink_to(ROOT / "examples")

    def make_box(**options):
        return ur_box_factory(standard_ports=True, **{"seed": 7, "control_port": 29900, **options})

    PageReader(make_box, STOCK).read(blocks_of(page))
