"""Reports that the screen of a box writes into files."""
