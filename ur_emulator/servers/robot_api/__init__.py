"""The Robot API of PolyScope X over HTTP; it takes the place of the dashboard server."""
