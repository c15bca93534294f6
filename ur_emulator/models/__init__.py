"""What is known about each arm: numbers with their sources, no behaviour."""
