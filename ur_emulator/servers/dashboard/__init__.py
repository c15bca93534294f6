"""Port 29999: the connection, what each command does, and the files that some write."""
