"""What is public: `__all__` of each package, what `dir()` shows, and what the reference has."""

import ast
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = {"pc_client": "client", "ur_emulator": "emulator", "urscript": "urscript"}


@pytest.mark.parametrize("name", PAGES)
def test_dir_shows_the_public_names_and_each_can_be_had(name):
    package = importlib.import_module(name)
    assert [public for public in dir(package) if not public.startswith("__")] == sorted(package.__all__)
    assert all(getattr(package, public) is not None for public in package.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        package.nothing  # noqa: B018


@pytest.mark.parametrize("name", PAGES)
def test_the_reference_names_what_is_public_and_nothing_else(name):
    lines = (DOCS / "api" / f"{PAGES[name]}.md").read_text(encoding="utf-8").splitlines()
    named = {line.removeprefix("::: ") for line in lines if line.startswith("::: ")}
    plugin = {f"ur_emulator.pytest_plugin.{fixture}" for fixture in ("ur_box", "ur_box_factory")}
    assert named - plugin == {f"{name}.{public}" for public in importlib.import_module(name).__all__}


@pytest.mark.parametrize("name", PAGES)
def test_every_public_name_has_a_docstring(name):
    package = importlib.import_module(name)
    classes = [value for public in package.__all__ if isinstance(value := getattr(package, public), type)]
    bare = [
        f"{cls.__name__}.{public}"
        for cls in classes
        for public, value in vars(cls).items()
        if not public.startswith("_") and callable(value) and not (value.__doc__ or "").strip()
    ]
    assert bare == []


def test_what_only_its_own_module_uses_has_an_underscore():
    """Functions and values of a module; types may be what a public function returns."""
    texts = {
        path: path.read_text(encoding="utf-8")
        for folder in ("pc_client", "ur_emulator", "ur_pendant", "docs", "examples", "tests", "bench")
        for pattern in ("*.py", "*.md", "*.ipynb")
        for path in (ROOT / folder).rglob(pattern)
    }
    words = {path: set(re.findall(r"\w+", text)) for path, text in texts.items()}
    wrong = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in texts
        if path.suffix == ".py" and path.is_relative_to(ROOT / "pc_client") and path.stem != "__init__"
        for name in module_names(ast.parse(texts[path]))
        if not name.startswith("_") and not any(name in words[other] for other in texts if other != path)
    ]
    assert wrong == []


def module_names(tree):
    """Functions without a decorator (that would register them) and values at the top of a module."""
    for node in tree.body:
        match node:
            case ast.FunctionDef(name=name, decorator_list=[]):
                yield name
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                if not ast.unparse(value).startswith("TypeVar("):
                    yield name
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield name


def test_the_glossary_has_one_line_a_term_in_alphabetical_order():
    rows = [
        line for line in (DOCS / "glossary.md").read_text(encoding="utf-8").splitlines() if line[:1] == "|"
    ]
    terms = [row.split("|")[1].strip().lower() for row in rows[2:]]
    assert len(set(terms)) == len(terms) > 50
    assert terms == sorted(terms)
    assert [row for row in rows if row.count("|") != 3] == []
