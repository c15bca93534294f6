"""An emulated Universal Robots control box.

from ur_emulator import ControlBox

with ControlBox(robot="ur3", pace="lockstep", seed=7) as box:
    print(box.host, box.ports.realtime)
"""

import sys
from typing import TYPE_CHECKING, Any

from ur_hil import check_packages

if TYPE_CHECKING:
    from ur_emulator.emulator import BoxRack, ControlBox

check_packages()

__all__ = ["BoxRack", "ControlBox"]


def check_platform(platform: str = sys.platform) -> None:
    """Raise ImportError on a system without POSIX, which the worker process needs."""
    if platform == "win32":
        raise ImportError("the box needs Linux or macOS: on Windows, run it in WSL 2 (docs/commands.md)")


def __getattr__(name: str) -> Any:
    """Import the box when it is first asked for: tools that only read tables stay light."""
    check_platform()
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from ur_emulator import emulator

    return getattr(emulator, name)


def __dir__() -> list[str]:
    return __all__
