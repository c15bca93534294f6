"""The event loop, and what runs in it: pacers, the served box, connections, steps, the worker process."""
