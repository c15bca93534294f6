"""Documentation: pages for people, and what makes those that come from tables and pictures."""
