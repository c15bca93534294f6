"""The library: two sets of ten movements, and their files."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

from pc_client.errors import MovementError

LIBRARY_FOLDER = Path(__file__).parent / "library"
#: The ten movements of the paper's Table I, in its order.
_TEN = tuple(
    f"{kind}_{number}" for kind in ("uniform", "lognorm") for number in ("4_1", "4_2", "5_1", "5_2", "5_3")
)
#: The set that is run when none is named; its movements go by their bare names.
DEFAULT_SET = "paper"
#: Every named set of the library: what `Movement.library` takes for its movements, in the order of Table I.
LIBRARY_SETS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {DEFAULT_SET: _TEN, "arcs": tuple(f"arcs/{name}" for name in _TEN)}
)


def library_names(set_name: str = DEFAULT_SET) -> list[str]:
    """What `Movement.library` takes for the movements of a set, in the order of Table I.

    Args:
        set_name: "paper", the ten by the paper's own recipe; "arcs", ten of arcs that overlap in time.

    Raises:
        MovementError: there is no such set.
    """
    if set_name not in LIBRARY_SETS:
        raise MovementError(f'no set of movements "{set_name}": give one of {", ".join(LIBRARY_SETS)}')
    return list(LIBRARY_SETS[set_name])


def library_path(name: str) -> Path | None:
    """The file of a movement of the library, or None if there is none of that name."""
    if not any(name in names for names in LIBRARY_SETS.values()):
        return None
    return LIBRARY_FOLDER / (f"{name}.toml" if "/" in name else f"{DEFAULT_SET}/{name}.toml")


def library_name_of(text: str) -> str | None:
    """Which movement of the library has this file; None: none."""
    return _names_by_text().get(text)


@cache
def _names_by_text() -> Mapping[str, str]:
    names = [name for names in LIBRARY_SETS.values() for name in names]
    paths = ((name, library_path(name)) for name in names)
    return {path.read_text(encoding="utf-8"): name for name, path in paths if path}
