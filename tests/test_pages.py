"""Every block of code of every page runs as it stands, or says why it does not."""

from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
from page_blocks import ROOT, PageReader, blocks_of

from pc_client.movements.movement import load_movement

PAGES = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]


def drawing(path):
    """A curved stroke of a pen: x, y in millimetres and t in seconds, 100 samples a second."""
    movement = load_movement("lognorm_4_1")
    t = np.arange(0.0, movement.duration, 0.01)
    path.write_text(
        "".join(f"{x} {y} {s}\n" for (x, y), s in zip(1e3 * movement.sample(t).p[:, :2], t, strict=True))
    )


def drawings(path):
    """A zip of one drawing."""
    drawing(Path("one.txt"))
    with ZipFile(path, "w") as archive:
        archive.write("one.txt")


STOCK = {
    "drawing.txt": drawing,
    "targets.csv": lambda path: path.write_text("x,y,z,t\n.3,-.1,.2,0\n.35,0,.25,2\n.3,.1,.2,3.5\n"),
    "my_movement.toml": lambda path: load_movement("uniform_4_1").save(path),
    "letter.txt": drawing,
    "reaches/": lambda path: drawing(path / "reach.txt"),
    "others.zip": drawings,
    "my_program.script": lambda path: path.write_text('def hello():\n  textmsg("hello")\nend\n'),
    "my_programs": lambda path: (path / "pick.script").write_text('def hello():\n  textmsg("hello")\nend\n'),
}
"""What a reader has before a page is read."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```" in page.read_text(encoding="utf-8")],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)  # fmt: skip
def test_the_blocks_of_a_page_run(page, tmp_path, monkeypatch, ur_box_factory):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    (tmp_path / "examples").symlink_to(ROOT / "examples")

    def make_box(**options):
        return ur_box_factory(standard_ports=True, **{"seed": 7, "control_port": 29900, **options})

    PageReader(make_box, STOCK).read(blocks_of(page))
