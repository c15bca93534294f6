"""What comes in and goes out: digital and analogue lines, registers, RTDE inputs, encoders."""
