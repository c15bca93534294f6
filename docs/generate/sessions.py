"""The sessions of pages: blocks of language `console`, with what their commands print now."""

from __future__ import annotations

import os
import re
import shlex
import tempfile
from pathlib import Path

from typer.testing import CliRunner

_SESSION = re.compile(r"(?<=^```console\n)(\$ (?:urscript|cat) .*?)(?=^```$)", re.MULTILINE | re.DOTALL)
_PROGRAM = re.compile(r"`(\w+\.script)`:\n\n```urscript\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_REAL_TIME = re.compile(r"[\d.]+ s of real time")


def played(session: str) -> str:
    """A session as it is now; its files are in the current folder."""
    return "".join(_shown(line[2:]) for line in session.splitlines() if line.startswith("$ "))


def with_sessions(text: str) -> str:
    """The text of a page with its sessions as they are now."""
    if not _SESSION.search(text):
        return text
    before = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for name, program in _PROGRAM.findall(text):
                Path(name).write_text(program, encoding="utf-8")
            return _SESSION.sub(lambda found: played(found[0]), text)
        finally:
            os.chdir(before)


def _shown(command: str) -> str:
    """A command and its output as on a terminal; how long a run really took is not its own doing."""
    from urscript.cli import app  # the other pages do without it

    words = shlex.split(command)
    if words[0] == "cat":
        return f"$ {command}\n{Path(words[1]).read_text(encoding='utf-8')}"
    if words[0] != "urscript":
        raise ValueError(f"a session of a page runs `urscript` and `cat`, not {command!r}")
    output = CliRunner().invoke(app, words[1:]).output
    return f"$ {command}\n{_REAL_TIME.sub('0.1 s of real time', output)}"
