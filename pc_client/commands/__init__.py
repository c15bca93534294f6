"""The commands of `ur-client`, one module a theme. Heavy libraries are imported when a command runs."""
