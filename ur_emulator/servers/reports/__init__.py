"""Reports for people: the log, flight reports, support files; for the dashboard server and the Robot API."""
