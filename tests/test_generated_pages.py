"""Pages that are made from tables are up to date."""

import pytest

from docs.generate.__main__ import DOCS, PAGES, page


@pytest.mark.parametrize("path", PAGES)
def test_a_page_is_what_its_tables_make(path):
    assert (DOCS / path).read_text(encoding="utf-8") == page(path), "run: make docs"
