"""The wheel, installed into a fresh environment: what is in it is enough to connect, to move and to report."""

import os
import shutil
import subprocess
import sys
import tomllib
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("protocol", "urscript", "ur_emulator", "pc_client", "ur_hil")
PROGRAM = """
import pathlib, sys
import pc_client as ur
from pc_client.cli import run as ur_client
from ur_emulator import ControlBox
import protocol, urscript

for package in (ur, protocol, urscript, sys.modules["ur_emulator"]):
    assert pathlib.Path(package.__file__).is_relative_to(sys.prefix), package.__file__
urscript.compile_program("def hello():\\n  movej([0, 0, 0, 0, 0, 0])\\nend\\n")
with ControlBox(pace="lockstep", port_base=None, seed=7) as box:
    arm = ur.connect(box.host, box.ports)
    run = arm.run(ur.Movement.library("lognorm_4_1"), ur.Controller.preview(), out="out")
assert run.snr > 20
assert ur_client(["report", "out"]) == 0
assert pathlib.Path("out/report.html").stat().st_size > 10_000
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built from a copy: a build leaves folders behind, which would get into the next one."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, source / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", out, source)
    (made,) = out.glob("*.whl")
    return made


def run(*words, cwd=None):
    keep = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, cwd=cwd, env=keep)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_every_file_of_the_packages_is_in_the_wheel(wheel):
    packed = set(ZipFile(wheel).namelist())
    files = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert files - packed == set()
    assert {name.partition("/")[0] for name in packed if ".dist-info/" not in name} == set(PACKAGES)


@pytest.mark.slow
def test_a_fresh_environment_with_the_wheel_moves_an_arm(wheel, tmp_path):
    home = tmp_path / "venv"
    venv.create(home, symlinks=True)
    python = home / "bin" / "python"
    run(sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index", wheel)
    # The dependencies are those of this environment: its paths alone, so that its editable install is not seen.
    (own,) = (home / "lib").glob("python*/site-packages")
    (own / "dependencies.pth").write_text(
        "\n".join(path for path in sys.path if "site-packages" in Path(path).parts)
    )
    run(python, "-c", PROGRAM, cwd=tmp_path)
    for script in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]:
        assert "Usage" in run(home / "bin" / script, "--help", cwd=tmp_path)
