"""Port 30004: RTDE's variables, packages and states, both ends of a connection."""
