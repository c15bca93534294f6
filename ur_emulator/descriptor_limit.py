"""How many descriptors a process may have: each client takes one, and some systems start with 256."""

from __future__ import annotations

import contextlib

# Enough for hundreds of boxes with hundreds of clients, and a number that every system grants.
WANTED = 65_536


def raise_descriptor_limit() -> int:
    """Raise this process's own limit as far as the system lets it; return it, 0 where there is none."""
    try:
        import resource
    except ImportError:
        return 0
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = WANTED if hard == resource.RLIM_INFINITY else min(WANTED, hard)
    if soft == resource.RLIM_INFINITY or soft >= wanted:
        return soft
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
        return wanted
    return soft
