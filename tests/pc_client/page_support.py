"""What all pages have in common: they need nothing else."""

from __future__ import annotations

import re


def own_text(html: str) -> str:
    """A page without what is put into it as a whole: images, the script of all pages."""
    text = re.sub(r"base64,[^\"]+", "", html)
    return re.sub(r"<script>.*?</script>", "", text, count=1, flags=re.S)


def check_needs_nothing(html: str) -> None:
    """No address outside the page, and a rule for the browser that forbids to ask for one."""
    assert "default-src 'none'; img-src data: blob:;" in html
    text = own_text(html)
    assert re.findall(r"(?:https?:)?//|@import|url\(|<script|<link", text) == []
    assert re.findall(r'src="(?!data:image/)', text) == []
