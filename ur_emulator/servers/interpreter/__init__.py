"""Port 30020: statements for a program that is in interpreter mode."""
