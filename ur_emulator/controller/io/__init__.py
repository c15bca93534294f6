"""What comes in and goes out: digital and analogue lines, registers, watchdogs, encoders, Modbus."""
