"""What clients, people and tests ask of the box: one frozen record each, with what it does."""
