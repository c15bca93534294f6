"""Ports 30001 and 30002: robot states, messages and variables, as tables and as bytes."""
