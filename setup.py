"""The page of the package index: README.md without links that lead nowhere. All else: pyproject.toml."""

import re
from pathlib import Path

from setuptools import setup

_IMAGE = re.compile(r"!\[[^\]]*\]\((?!https?:)[^)]*\)\n*")
_LINK = re.compile(r"\[([^\]]*)\]\((?!https?:)([^)#]*)[^)]*\)")


def page_for_index(readme: str) -> str:
    """Return a README as an index shows it: no files stand beside it, the project has no address yet.

    Images of the repository are left out; a link to one of its files becomes the path of the file, which the
    source distribution contains.
    """

    def named(link: re.Match[str]) -> str:
        text, path = link.groups()
        return f"`{path}`" if text == path else f"{text} (`{path}`)"

    return _LINK.sub(named, _IMAGE.sub("", readme))


if __name__ == "__main__":
    setup(
        long_description=page_for_index(Path(__file__).with_name("README.md").read_text(encoding="utf-8")),
        long_description_content_type="text/markdown",
    )
