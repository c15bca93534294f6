"""Commands of clients, people and tests: one frozen record each, with its effect."""
