"""Resolved program to Python code: static types, expressions, statements."""
