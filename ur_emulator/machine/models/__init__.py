"""Numbers of arms and generations with their sources; no behaviour."""
