"""Port 30003: the columns of its frames in every software version, and their codec."""
