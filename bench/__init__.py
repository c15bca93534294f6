"""Measurements of the whole thing, over real sockets between processes: `make bench`."""
