"""What is built: the wheel does in a fresh environment what the start pages show; the sdist has all the pages."""

import email
import json
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
from fnmatch import fnmatch
from importlib.metadata import distribution
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from page_blocks import APPS, ROOT, blocks_of, commands_of

import ur_hil
from bench.box_process import HOST
from pc_client.movements.library_sets import library_names
from pc_client.movements.movement import Movement

OURS = "ur-hil"
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PACKAGES = (*ur_hil.PACKAGES, "ur_hil")
BARE = ("--no-deps", "--no-index", "--no-compile")
# Does the steps of pages, each as it is done in a terminal, all in one process.
STEPS = """
import json, pathlib, runpy, signal, subprocess, sys, urllib.request
from contextlib import ExitStack, contextmanager

BIN = pathlib.Path(sys.prefix, "bin")

@contextmanager
def served(words):
    with subprocess.Popen([BIN / words[0], *words[1:]], stdout=subprocess.PIPE, text=True) as process:
        try:
            wanted = "window at " if "--pendant" in words else " ready at "
            said = next(line for line in process.stdout if wanted in line)
            if "--pendant" in words:
                assert b"<html" in urllib.request.urlopen(said.split()[-1]).read().lower()
            yield
        finally:
            process.send_signal(signal.SIGINT)
    assert process.returncode in (0, 130)

with ExitStack() as stack:
    names = {"__name__": "page"}
    for kind, given in json.loads(pathlib.Path("steps.json").read_text()):
        print(kind, given, flush=True)
        if kind == "serve":
            stack.enter_context(served(given))
        elif kind == "python":
            exec(given, names)
        elif kind == "pytest":
            import pytest
            assert pytest.main(["-q", "-p", "no:cacheprovider"]) == 0
        else:
            sys.argv = given
            try:
                runpy.run_path(str(BIN / given[0]), run_name="__main__")
            except SystemExit as end:
                # What a page shows with its error is an error.
                assert not end.code or kind == "console" and end.code == 1
for name in {"pc_client", "protocol", "urscript", "ur_emulator"} & set(sys.modules):
    assert pathlib.Path(sys.modules[name].__file__).is_relative_to(sys.prefix), name
"""
# A box has an address of its own, and waits for its client; a movement is short, and so is a look.
SHORTER = {
    ("ur-emulator", "serve"): ["--host", "HOST", "--pace", "lockstep"],
    ("ur-client", "doctor"): ["--seconds", "0.1"],
}


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


def test_every_file_of_the_packages_is_asked_for():
    patterns = PYPROJECT["tool"]["setuptools"]["package-data"]["*"]
    names = [
        path.name
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.*")
        if path.is_file() and path.suffix not in (".py", ".pyc")
    ]
    assert names
    assert [name for name in names if not any(fnmatch(name, pattern) for pattern in patterns)] == []


def run(*words, cwd=None, **more):
    keep = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"} | more
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, cwd=cwd, env=keep)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.nightly
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


@pytest.mark.nightly
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


def metadata(wheel):
    with ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        return email.message_from_bytes(archive.read(name))


PAGE_FOR_INDEX = runpy.run_path(str(ROOT / "setup.py"))["page_for_index"]


def test_links_and_images_of_a_readme_become_text():
    text = "![arm](docs/arm.svg)\n\nSee [the box](docs/box.md#options), [a.md](a.md), [UR](https://example.com/x)."
    assert PAGE_FOR_INDEX(text) == "See the box (`docs/box.md`), `a.md`, [UR](https://example.com/x)."
    page = PAGE_FOR_INDEX((ROOT / "README.md").read_text(encoding="utf-8"))
    targets = re.findall(r"\]\(([^)]*)\)", page)
    assert [target for target in targets if not target.startswith("https://")] == []
    named = re.findall(r"`([\w./-]+\.md)`", page)
    assert len(named) > 10
    assert [path for path in named if not (ROOT / path).is_file()] == []


@pytest.mark.nightly
def test_the_page_of_the_index_is_the_readme(wheel):
    facts = metadata(wheel)
    assert facts["Description-Content-Type"] == "text/markdown"
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert facts.get_payload(decode=True).decode().strip() == PAGE_FOR_INDEX(readme).strip()


def requirements(wanted, wheel):
    """Names of all distributions that an install brings, as pip would choose them; `wheel` stands for ours."""
    ours = metadata(wheel).get_all("Requires-Dist")
    found, left = set(), [Requirement(text) for text in wanted]
    while left:
        one = left.pop()
        for extra in {"", *one.extras}:
            if (one.name, extra) in found:
                continue
            found.add((one.name, extra))
            texts = ours if one.name == OURS else distribution(one.name).requires or ()
            for next_one in map(Requirement, texts):
                if next_one.marker is None or next_one.marker.evaluate({"extra": extra}):
                    left.append(next_one)
    return {name for name, _ in found} - {OURS}


def install(wanted, wheel, folder):
    """Make a folder of packages that has what an install brings, and nothing else of this environment.

    They are links to what is installed here. With REAL_INSTALLS in the environment pip gets them from the index.
    """
    if os.environ.get("REAL_INSTALLS"):
        words = [word.replace(OURS, str(wheel)) for word in wanted]
        run(sys.executable, "-m", "pip", "install", "-q", "--target", folder, *words)
        return
    folder.mkdir()
    for name in requirements(wanted, wheel):
        found = distribution(name)
        for top in {path.parts[0] for path in found.files or ()} - {"..", "__pycache__"}:
            if not (folder / top).exists():
                (folder / top).symlink_to(found.locate_file(top))


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory):
    """A fresh environment with the wheel; the other packages are those of the folder DEPENDENCIES."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, symlinks=True)
    run(sys.executable, "-m", "pip", "--python", home / "bin" / "python", "install", "-q", *BARE, wheel)
    (own,) = (home / "lib").glob("python*/site-packages")
    (own / "dependencies.pth").write_text('import os, site; site.addsitedir(os.environ["DEPENDENCIES"])\n')
    return home


def install_of(line):
    """What a line of pip installs, () for others; a folder of a copy stands for the name."""
    words = shlex.split(line, comments=True)
    if words[:2] != ["pip", "install"]:
        return ()
    return tuple(sorted(re.sub(r"^\.(/ur-hil)?(?=\[|$)", OURS, word) for word in words[2:]))


def steps_of(page):
    """What a page shows, in its order: (install that stands last above it, kind of step, what is done)."""
    text = page.read_text(encoding="utf-8")
    blocks = {block.line: block for block in blocks_of(page)}
    wanted = ()
    for shown in re.finditer(r"^```\w.*?^```$|`(p[^`]+|ur[^`]+)`", text, re.DOTALL | re.MULTILINE):
        block = blocks.get(text.count("\n", 0, shown.start()) + 1)
        if block is None and shown[1]:
            lines = [shown[1].replace("\n", " ")] * (shown[1].count(" ") > 1)
        elif block.name or block.language == "python":
            yield wanted, block.language, block
            continue
        elif block.language == "sh":
            lines = commands_of(block.text)
        else:
            lines = [line[2:] for line in block.text.splitlines() if line.startswith("$ ")]
        for line in lines:
            wanted = install_of(line) or wanted
            words = shlex.split(line, comments=True)
            # Of what no page runs, a box and its window begin and end here.
            if words and words[0] in APPS and not (block and block.reason and words[1] != "serve"):
                yield wanted, block.language if block else "sh", words


def shortened(words):
    """A command of a page as it is run here."""
    words = ["short.toml" if word in library_names() else word for word in words]
    words = [re.sub(r"^(127\.0\.0\.1|192\.168\.0\.10)$", "HOST", word) for word in words]
    more = ["--window-port", "0"] if "--pendant" in words else []
    return [HOST if word == "HOST" else word for word in words + SHORTER.get(tuple(words[:2]), []) + more]


def box_of(steps):
    """One box is enough for all pages, that with a window if one has it."""
    if HOST not in str(steps):
        return []
    boxes = [words for _, words in steps if words[:2] == ["ur-emulator", "serve"]]
    boxes.append(shortened(["ur-emulator", "serve"]))
    return [("serve", min(boxes, key=lambda words: "--pendant" not in words))]


def once(steps):
    """The same steps, but `run` and `doctor` only once, and without the boxes of each page."""
    seen = {("ur-emulator", "serve")}
    for kind, words in steps:
        if (first := tuple(words[:2])) not in seen:
            yield kind, words
        if first in (("ur-client", "run"), ("ur-client", "doctor")):
            seen.add(first)


STEPS_OF_PAGES = [
    step
    for page in (ROOT / "README.md", *sorted((ROOT / "docs" / "start").glob("*.md")))
    for step in steps_of(page)
]


def test_the_start_pages_show_no_command_without_an_install_above_it():
    assert len(STEPS_OF_PAGES) > 20
    assert [what for wanted, _, what in STEPS_OF_PAGES if not wanted] == []


@pytest.mark.nightly
@pytest.mark.parametrize("wanted", sorted({wanted for wanted, _, _ in STEPS_OF_PAGES}), ids=" ".join)
def test_the_commands_of_a_page_need_no_more_than_its_install(wanted, wheel, environment, tmp_path):
    packages, here = tmp_path / "packages", tmp_path / "here"
    install(wanted, wheel, packages)
    here.mkdir()
    points = [(0.35, -0.05, 0.25), (0.35, 0.05, 0.28)]
    Movement.through(points, durations=[1.2]).save(here / "short.toml")
    (here / "my_program.script").write_text('def hello():\n  textmsg("hello")\nend\n')
    steps = []
    for _, kind, what in (step for step in STEPS_OF_PAGES if step[0] == wanted):
        if kind in ("sh", "console"):
            words = shortened(what)
            steps.append(("serve" if words[1] == "serve" else kind, words))
        elif what.name or "def test_" in what.text:
            path = here / (what.name or f"test_{Path(what.page).stem.replace('-', '_')}_{what.line}.py")
            path.parent.mkdir(exist_ok=True, parents=True)
            path.write_text(what.text)
        else:
            text = re.sub(r'library\("\w+"\)', 'from_toml("short.toml")', what.text)
            steps.append(("python", re.sub(r"\b(127\.0\.0\.1|192\.168\.0\.10)\b", HOST, text)))
    if any(here.glob("test_*.py")):
        steps.append(("pytest", ""))
    (here / "steps.json").write_text(json.dumps([*box_of(steps), *once(steps)]))
    run(environment / "bin" / "python", "-c", STEPS, cwd=here, DEPENDENCIES=str(packages))


@pytest.mark.nightly
def test_the_commands_of_the_wheel_start(wheel, environment, tmp_path):
    install([OURS], wheel, tmp_path / "packages")
    for script in PYPROJECT["project"]["scripts"]:
        said = run(
            environment / "bin" / script, "--help", cwd=tmp_path, DEPENDENCIES=str(tmp_path / "packages")
        )
        assert "Usage" in said
