"""The distribution ur-hil: its version, its commands, and the check that its packages are its own.

Two of them, `protocol` and `urscript`, have names that a user's own folder or another distribution may have,
too. Python takes the first that it finds; what fails then is an import deep inside. So the packages call
`check_packages` first.
"""

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("protocol", "urscript", "ur_emulator", "pc_client", "ur_pendant")
PENDANT_PORT = 29980
"""Of the window on a box, an arm or recordings."""

_HOME = Path(__file__).resolve().parents[1]


def tool_version() -> str:
    """The version of the installed distribution; "unknown" in a source tree that is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("ur-hil")
    except PackageNotFoundError:
        return "unknown"


def run_command(module: str) -> None:
    """Run a command of the distribution: `main` of a module, which takes a moment to be loaded.

    Ctrl-C ends it with one line and exit code 130, also in that moment.
    """
    try:
        import_module(module).main()
    except (KeyboardInterrupt, ImportError) as error:
        if not _is_interrupt(error):
            raise
        sys.stderr.write(f"{Path(sys.argv[0]).name}: interrupted\n")
        sys.exit(130)


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether it is Ctrl-C, or the error that a module in C has made of it while it was loaded."""
    return isinstance(error, KeyboardInterrupt) or (error is not None and _is_interrupt(error.__cause__))


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
