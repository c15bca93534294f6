"""Makes the pages that come from tables: one module a page."""
