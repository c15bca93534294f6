"""Boxes of this process. An error that ends a box's loop fails the test that used it."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "ur_emulator"))  # what the tests of the box share
from integration_support import Finished, free_port_base

import ur_emulator.cli
from pc_client import cli
from ur_emulator import ControlBox


@pytest.fixture
def lockstep_box():
    """A box in lockstep on free ports."""
    with ControlBox(in_process=True, pace="lockstep", port_base=None, seed=7) as box:
        yield box


@pytest.fixture
def realtime_box():
    """A box in real time on free ports."""
    with ControlBox(in_process=True, pace="realtime", port_base=None, seed=7) as box:
        yield box


@pytest.fixture
def standard_box():
    """A box in lockstep on ports that `--port-base` can name."""
    with ControlBox(pace="lockstep", port_base=free_port_base(), seed=7) as box:
        yield box


@pytest.fixture
def ur_client(capsys):
    """Run a `ur-client` command in this process: what fails early need not pay for an interpreter each time."""

    def run(*arguments):
        code = cli.run([str(a) for a in arguments])
        told = capsys.readouterr()
        return Finished(code, told.out, told.err)

    return run


@pytest.fixture
def ur_emulator_command(capsys, monkeypatch):
    """The same for `ur-emulator`."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["ur-emulator", *map(str, arguments)])
        with pytest.raises(SystemExit) as left:
            ur_emulator.cli.main()
        told = capsys.readouterr()
        return Finished(left.value.code, told.out, told.err)

    return run
