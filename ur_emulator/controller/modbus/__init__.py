"""The robot's own Modbus map: its rows, and how an address is read and written."""
