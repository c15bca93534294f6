"""The event loop and the pacers, which decide when a cycle begins. Only this package reads a clock."""
