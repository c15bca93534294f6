"""The README's examples of the control API, run as they stand there."""

import re
import shlex
from pathlib import Path

from control_support import control_box

from ur_emulator.control.command_line import main

README = (Path(__file__).parents[2] / "README.md").read_text()

pytest_plugins = ["pytester"]


def block(title, language):
    """Return the first block of code below a title."""
    section = README.partition(f"### {title}\n")[2]
    found = re.search(rf"```{language}\n(.*?)```", section, re.DOTALL)
    assert found, title
    return found[1]


def test_the_test_of_the_readme_passes(pytester, monkeypatch):
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    driver = "import socket\n\ndef connect_my_driver(host, ports):\n    socket.create_connection((host, ports.primary), 20).close()\n\n"
    pytester.makepyfile(driver + block("In your tests", "python"))
    pytester.runpytest_inprocess("-p", "no:cacheprovider").assert_outcomes(passed=2)


def test_the_commands_of_the_readme_work(capsys):
    first, *lines = block("Poke the box", "sh").splitlines()
    assert first.startswith("ur-emulator serve --control-port ")
    assert len(lines) > 5
    with control_box() as box:
        for line in lines:
            program, ctl, *words = shlex.split(line)
            assert (program, ctl) == ("ur-emulator", "ctl")
            assert main([*words, "--control-port", str(box.control_port)]) == 0, line
        box.wait_until(robot_mode="RUNNING")
    out, err = capsys.readouterr()
    assert err == ""
    assert "Safety mode: ROBOT_EMERGENCY_STOP" in out
