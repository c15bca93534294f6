"""Event loop, connections, worker processes: nothing of robots."""
