"""Port 29999: the dashboard server's commands, both ends of its line protocol, its replies."""
