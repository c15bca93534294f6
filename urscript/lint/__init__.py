"""Warnings of `urscript check`: what is allowed but probably a mistake."""
