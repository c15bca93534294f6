"""Commands of clients, people and tests, one frozen record each: they act as a cycle begins."""
