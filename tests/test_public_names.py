"""What is public: `__all__` of each package, what `dir()` shows, and what the reference has."""

import importlib
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
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
