"""What the screen of a box does: the loaded program, start-up, reports for people."""
