"""Inputs and outputs: digital and analogue lines, registers, watchdogs, encoders, Modbus."""
