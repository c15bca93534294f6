"""Event loop, connections, worker processes, memory: nothing of robots."""
