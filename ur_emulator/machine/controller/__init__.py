"""The control box as a pure cycle: commands in, one snapshot out. No sockets, no threads, no clock."""
