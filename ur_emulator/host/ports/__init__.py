"""What clients call: a module for each port, and the set of them that a box opens."""
