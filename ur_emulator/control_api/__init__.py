"""What people and tests do to a box: a table of operations, how they are done, and how they are called."""
