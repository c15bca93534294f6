"""A controller as a user names it: one of ours, or a TOML file with numbers of their own.

    base = "paper"       # what the file starts from; preview by default
    gain_p = 10.0        # 1/s
    gain_i = 5.0         # 1/s2

Every other key is a field of `ControllerConfig`; `controller_fields` says what it may hold.
"""

from __future__ import annotations

from pathlib import Path

from pc_client.control.controller_config import CONTROLLERS, ControllerConfig
from pc_client.control.controller_fields import FIELDS, changed
from pc_client.errors import ControllerError
from pc_client.input_files import parse_toml, read_text
from pc_client.spelling import check_keys, nearest

DEFAULT = "preview"
"""The controller when none is named."""


def load_controller(name_or_file: str) -> ControllerConfig:
    """Return a named controller, or the one of a file.

    Args:
        name_or_file: a name of `CONTROLLERS`, or a path that ends in .toml.

    Raises:
        ControllerError: no such controller, an unreadable file, or content that makes no sense.
    """
    if name_or_file.endswith(".toml"):
        return read_controller(Path(name_or_file))
    if name_or_file not in CONTROLLERS:
        raise ControllerError(
            f"no controller is called {name_or_file!r}; choose one of {', '.join(CONTROLLERS)}, "
            "or give a file FILE.toml"
        )
    return CONTROLLERS[name_or_file]


def read_controller(path: Path) -> ControllerConfig:
    """Read the file of a controller.

    Raises:
        ControllerError: the file cannot be read, a field does not exist or cannot hold its value.
    """
    values = parse_toml(read_text(path, "controller"), str(path), "controller")
    check_keys(values, ("base", *FIELDS), f"{path}: ", ControllerError)
    base = values.pop("base", DEFAULT)
    if not isinstance(base, str) or base not in CONTROLLERS:
        raise ControllerError(f"{path}: base: {base!r}; {nearest(str(base), CONTROLLERS)}")
    return changed(CONTROLLERS[base], values, lambda name: f"{path}: {name}")
