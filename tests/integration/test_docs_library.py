"""The programs of docs/library.md run as they stand, one after the other."""

import re
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "library.md").read_text(encoding="utf-8")


def test_the_programs_of_the_page_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(block, names)
    assert (tmp_path / "run.png").stat().st_size > 10_000
    assert capsys.readouterr().out.startswith("<Arm UR3, software 3.15.8")


def test_every_public_name_is_on_the_page():
    import pc_client

    missing = {name for name in pc_client.__all__ if name not in PAGE}
    assert missing <= {"Arm", "Cell", "Plan", "Signals"}
