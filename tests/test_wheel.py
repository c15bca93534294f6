"""What is built: the wheel, installed into a fresh environment, moves an arm; the sdist has all the pages."""

import email
import os
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest

import ur_hil

ROOT = Path(__file__).parents[1]
PACKAGES = (*ur_hil.PACKAGES, "ur_hil")
BARE = ("--no-deps", "--no-index", "--no-compile")
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
    ur.plan(ur.Movement.library("lognorm_4_1"), arm)
    short = ur.Movement.through([(0.35, -0.05, 0.25), (0.35, 0.05, 0.28)], durations=[1.5])
    run = arm.run(short, ur.Controller.preview(), out="out")
assert run.snr > 20
assert ur_client(["report", "out"]) == 0
assert pathlib.Path("out/report.html").stat().st_size > 10_000
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A copy to build from: a build leaves folders behind, which would get into the next one."""
    source = tmp_path_factory.mktemp("source")
    for folder in (*PACKAGES, "docs", "examples"):
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy(path, source)
    return source


@pytest.fixture(scope="module")
def built(source, tmp_path_factory):
    """The folder with the sdist and the wheel, made by setuptools as pip asks it to."""
    out = tmp_path_factory.mktemp("built")
    code = f"from setuptools import build_meta as b; b.build_sdist({str(out)!r}); b.build_wheel({str(out)!r})"
    run(sys.executable, "-c", code, cwd=source)
    return out


@pytest.fixture(scope="module")
def sdist(built):
    (made,) = built.glob("*.tar.gz")
    return made


@pytest.fixture(scope="module")
def wheel(built):
    (made,) = built.glob("*.whl")
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
def test_the_sdist_has_the_packages_the_pages_the_examples_and_the_changelog(sdist):
    with tarfile.open(sdist) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
    files = {
        path.relative_to(ROOT).as_posix()
        for folder in (*PACKAGES, "docs", "examples")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert files - packed == set()
    assert {"CHANGELOG.md", "LICENSE", "README.md", "SECURITY.md", "setup.py"} <= packed
    assert not any(name.startswith("tests/") for name in packed)


@pytest.mark.slow
def test_the_page_of_the_index_has_no_link_that_leads_nowhere(wheel):
    with ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        facts = email.message_from_bytes(archive.read(name))
    page = facts.get_payload()
    assert facts["Description-Content-Type"] == "text/markdown"
    assert page.startswith("# ur-hil")
    targets = re.findall(r"\]\(([^)]*)\)", page)
    assert [target for target in targets if not target.startswith("https://")] == []
    named = re.findall(r"`([\w./-]+\.md)`", page)
    assert len(named) > 10
    for path in named:
        assert (ROOT / path).is_file()


def test_links_and_images_of_a_readme_become_text():
    page_for_index = runpy.run_path(str(ROOT / "setup.py"))["page_for_index"]
    text = "![arm](docs/arm.svg)\n\nSee [the box](docs/box.md#options), [a.md](a.md), [UR](https://example.com/x)."
    assert page_for_index(text) == "See the box (`docs/box.md`), `a.md`, [UR](https://example.com/x)."


@pytest.mark.slow
def test_a_fresh_environment_with_the_wheel_moves_an_arm(wheel, tmp_path):
    home = tmp_path / "venv"
    venv.create(home, symlinks=True)
    python = home / "bin" / "python"
    run(sys.executable, "-m", "pip", "--python", python, "install", "-q", *BARE, wheel)
    # The dependencies are those of this environment: its paths alone, so that its editable install is not seen.
    (own,) = (home / "lib").glob("python*/site-packages")
    (own / "dependencies.pth").write_text(
        "\n".join(path for path in sys.path if "site-packages" in Path(path).parts)
    )
    run(python, "-c", PROGRAM, cwd=tmp_path)
    for script in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]:
        assert "Usage" in run(home / "bin" / script, "--help", cwd=tmp_path)
