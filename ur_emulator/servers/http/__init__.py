"""Ports that speak HTTP: the control API, and the Robot API of PolyScope X."""
