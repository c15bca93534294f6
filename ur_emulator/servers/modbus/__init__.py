"""Modbus TCP: port 502, and the units that programs talk to."""
