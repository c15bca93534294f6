"""When a cycle begins, and the one loop that everything happens in. Only here is a clock read."""
