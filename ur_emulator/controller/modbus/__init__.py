"""Modbus, as state: the robot's own map, and the signals of other units that programs have added."""
