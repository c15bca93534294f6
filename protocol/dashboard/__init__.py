"""Port 29999: the dashboard server's commands, the robot's side of its line protocol."""
