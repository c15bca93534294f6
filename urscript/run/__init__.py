"""A compiled program at work: variables, operators, threads, waits, the budget of a cycle, the host."""
