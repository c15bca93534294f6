"""Ports 30001 and 30002: robot states and messages."""
