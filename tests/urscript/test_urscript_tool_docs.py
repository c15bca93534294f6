"""docs/urscript-tool.md shows what the command really does; `python <this file>` writes its output anew."""

import os
import re
import shlex
import tempfile
from pathlib import Path

from typer.testing import CliRunner

from urscript.cli import app
from urscript.lint.rules import RULES

PAGE = Path(__file__).parents[2] / "docs" / "urscript-tool.md"
PROGRAM = re.compile(r"^`(\w+\.script)`:\n\n```urscript\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SESSION = re.compile(r"(?<=^```console\n).*?(?=^```$)", re.MULTILINE | re.DOTALL)
TABLE = re.compile(r"^\| code \|.*?\n(?=\n)", re.MULTILINE | re.DOTALL)


REAL_TIME = re.compile(r"[\d.]+ s of real time")


def shown(command):
    """The command and its output as on a terminal; how long a run really took is not its own doing."""
    words = shlex.split(command)
    if words[0] == "cat":
        return f"$ {command}\n{Path(words[1]).read_text(encoding='utf-8')}"
    assert words[0] == "urscript"
    output = CliRunner().invoke(app, words[1:]).output
    return f"$ {command}\n{REAL_TIME.sub('0.1 s of real time', output)}"


def played(session):
    """A session as it is now."""
    commands = [line.removeprefix("$ ") for line in session[0].splitlines() if line.startswith("$ ")]
    return "".join(map(shown, commands))


def table_of_warnings():
    rows = "".join(f"| {rule.code} | {rule.meaning} | {rule.reason} |\n" for rule in RULES)
    return f"| code | what | why it is probably a mistake |\n| -- | -- | -- |\n{rows}"


def rewritten(page):
    """The page with the output of this version; programs are written into the current directory."""
    for name, text in PROGRAM.findall(page):
        Path(name).write_text(text, encoding="utf-8")
    return SESSION.sub(played, TABLE.sub(lambda _: table_of_warnings(), page))


def test_the_page_shows_what_the_command_prints(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = PAGE.read_text(encoding="utf-8")
    assert len(PROGRAM.findall(page)) >= 5
    assert rewritten(page) == page


if __name__ == "__main__":
    old = PAGE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        PAGE.write_text(rewritten(old), encoding="utf-8")
