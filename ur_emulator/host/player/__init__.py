"""What the screen of a box does with programs: the one that is loaded, External Control."""
