"""The distribution ur-hil: its version, and the check that its packages are its own.

Two of them, `protocol` and `urscript`, have names that a user's own folder or another distribution may have,
too. Python takes the first that it finds; what fails then is an import deep inside. So the packages call
`check_packages` first.
"""

from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("protocol", "urscript", "ur_emulator", "pc_client")
_HOME = Path(__file__).resolve().parents[1]


def tool_version() -> str:
    """The version of the installed distribution; "unknown" in a source tree that is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("ur-hil")
    except PackageNotFoundError:
        return "unknown"


def check_packages() -> None:
    """Look where Python finds the packages of this distribution; nothing is imported.

    Raises:
        ImportError: another package or module of the same name stands before one of ours.
    """
    for name in PACKAGES:
        spec = find_spec(name)
        place = None if spec is None or spec.origin is None else Path(spec.origin).resolve()
        if place != _HOME / name / "__init__.py":
            raise ImportError(
                f"Python finds {name!r} at {place or 'no file'}, ur-hil needs its own in {_HOME}: rename the "
                "other one, or install ur-hil into a virtual environment of its own"
            )
