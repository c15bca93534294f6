"""The records of the catalogue: a builtin, its parameters, its time, its support.

`catalogue` reads the rows, one text a chapter of the script manual; `calls` interprets them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple

from urscript.values import Pose, str_form

# --- when a builtin exists: from which release of each generation on, and until which, if it was dropped or
# has another signature now


class Generation(Enum):
    """The controller families whose URScript differs."""

    CB3 = "CB3"
    E_SERIES = "e-Series"
    POLYSCOPE_X = "PolyScope X"


STEP_TIME: Mapping[Generation, float] = {
    Generation.CB3: 0.008,
    Generation.E_SERIES: 0.002,
    Generation.POLYSCOPE_X: 0.002,
}
"""Length of a control cycle [s]. Source: script manuals, get_steptime."""


class Version(NamedTuple):
    """A release of the controller software.

    Without bug-fix numbers: one release is known whose bug fix changed the builtins, 5.25.1 (direct_torque).
    """

    major: int
    minor: int

    @property
    def generation(self) -> Generation:
        """The family this release runs on.

        Raises:
            ValueError: for a major number that no supported controller carries.
        """
        if self.major == 3:
            if self > LAST_CB3:
                raise ValueError(f"no software {self} is known: that of CB3 ends with {LAST_CB3}")
            return Generation.CB3
        if self.major == 5:
            return Generation.E_SERIES
        if self.major >= 10:
            return Generation.POLYSCOPE_X
        raise ValueError(f"no URScript catalogue for software {self}: use 3.x (CB3), 5.x (e-Series) or 10.x")

    @classmethod
    def of(cls, version: str | Sequence[int]) -> Version:
        """Read `"3.15"`, `"3.15.8"`, `(3, 15)` or any longer version tuple.

        Raises:
            ValueError: if there are no two leading numbers.
        """
        parts = version.split(".") if isinstance(version, str) else version
        try:
            return cls(int(parts[0]), int(parts[1]))
        except (IndexError, ValueError):
            raise ValueError(f"not a software version: {version!r}; write it as 3.15 or 5.11") from None

    def __str__(self) -> str:
        return f"{self.major}.{self.minor}"


LAST_CB3 = Version(3, 15)
"""The last minor release of the CB3 series. Source: the maker's download pages, manuals up to 3.15.8."""


class PerGeneration(NamedTuple):
    """One release for each generation; None where it does not apply."""

    cb3: Version | None = None
    e_series: Version | None = None
    polyscope_x: Version | None = None

    def get(self, generation: Generation) -> Version | None:
        """The release of that generation, or None."""
        return self[list(Generation).index(generation)]

    def __str__(self) -> str:
        known = ((g, self.get(g)) for g in Generation)
        return ", ".join(f"{g.value} {version}" for g, version in known if version is not None) or "-"


NEVER = PerGeneration()
EVERYWHERE = PerGeneration(Version(3, 0), Version(5, 0), Version(10, 0))


class TimeClass(Enum):
    """What a call means for the calling thread.

    Source: script manual, chapter "Thread scheduling" and the description of each function.
    """

    ZERO = "no physical time"
    MOTION = "robot motion: the thread waits, physical time passes"
    FRAMES = "uses up control cycles without moving the robot"
    BLOCKING = "waits for something outside; other threads run on"
    SWITCH = "switches the control mode and returns"


class Support(Enum):
    """How closely this box follows the controller."""

    EXACT = "exact"
    APPROXIMATE = "approximate"
    DECLARED_ONLY = "declared only"


class ParamType(Enum):
    """What an argument must be; the value is the phrase used in error messages."""

    ANY = "any value"
    BOOL = "True or False"
    INT = "an integer"
    NUMBER = "a number"
    STRING = "a string"
    STRING_OR_INT = "a string or an integer"
    POSE = "a Pose on the form p[x,y,z,a,b,c]"
    JOINTS = "a list of 6 numbers"
    POSE_OR_JOINTS = "a Pose on the form p[x,y,z,a,b,c] or a list of 6 joint positions"
    VECTOR3 = "a list of 3 numbers"
    VECTOR6 = "a list of 6 numbers or a Pose"
    NUMBERS = "a list of numbers"
    NUMBER_OR_NUMBERS = "a number or a list of numbers"
    LIST = "a list"
    BOOLS = "a list of bools"
    BOOL_OR_BOOLS = "True or False, or a list of them"
    MATRIX = "a matrix"
    ARRAY = "a list or a Pose"
    SIZED = "a list, a string or a Pose"
    SHAPED = "a matrix, a list, a string or a Pose"
    LIST_OR_MATRIX = "a matrix or a list of numbers"
    POSE_OR_MATRIX = "a square matrix or a Pose"
    NORMED = "a number, a list of numbers or a Pose"


FIXED_SIZE: Final = frozenset(
    {
        ParamType.BOOL,
        ParamType.INT,
        ParamType.NUMBER,
        ParamType.POSE,
        ParamType.JOINTS,
        ParamType.POSE_OR_JOINTS,
        ParamType.VECTOR3,
        ParamType.VECTOR6,
    }
)
"""Types whose values have six numbers at most."""


class _Required(Enum):
    REQUIRED = "required"


REQUIRED: Final = _Required.REQUIRED
"""The default of a parameter that has none."""


@dataclass(frozen=True, slots=True)
class Param:
    """One parameter of a builtin.

    Args:
        name: as in keyword calls.
        default: the value when the argument is omitted; None means "the controller fills it
            in" (the active TCP, the present joint positions, another parameter's value), see `shown`.
        unit: SI unit or the meaning of the codes.
        low: smallest value allowed for a number, None for no bound.
        high: largest value allowed.
        choices: the only values allowed, empty for any.
        shown: how the manual prints the default where `default` is None.
    """

    name: str
    type: ParamType
    default: object = REQUIRED
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[object, ...] = ()
    shown: str = ""

    @property
    def is_required(self) -> bool:
        """Whether a call must give it."""
        return self.default is REQUIRED

    def __str__(self) -> str:
        if self.is_required:
            return self.name
        if self.default is None:
            return f"{self.name}={self.shown or 'optional'}"
        return f"{self.name}={default_text(self.default)}"


def default_text(value: object) -> str:
    """A default as the manual prints it."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float):
        return f"{value:.3g}"
    return str_form(value) if isinstance(value, (list, Pose)) else str(value)


@dataclass(frozen=True, slots=True)
class Builtin:
    """One function that URScript programs can call, or a method of values, `list.append`.

    Args:
        params: in positional order.
        returns: type of the result, then after a comma its unit; "None" where there is none. The compiler
            reads the type, so it must hold for every call ("int or list" where it varies).
        time: what a call means for the thread.
        since: first release of each generation that knows this form.
        until: first release that no longer has this form.
        support: how well this box models it.
        summary: one line.
        undocumented: generations whose controllers know the name although their manual does not list it.
        deprecated: the manual advises a successor.
        nan_ok: NaN and infinity do no harm as arguments (sums, texts, registers); else they are errors.
        any_names: takes named arguments of any name, and no others.
        changes: a method that changes the variable, element or member that it is called on.
        note: why the support is not exact.
    """

    name: str
    params: tuple[Param, ...]
    returns: str
    time: TimeClass
    module: str
    since: PerGeneration
    until: PerGeneration = NEVER
    support: Support = Support.DECLARED_ONLY
    summary: str = ""
    undocumented: frozenset[Generation] = frozenset()
    deprecated: bool = False
    nan_ok: bool = False
    any_names: bool = False
    changes: bool = False
    note: str = ""

    @property
    def signature(self) -> str:
        """As the manual heads its section, e.g. `movej(q, a=1.4, v=1.05, t=0, r=0)`."""
        arguments = "name=value, ..." if self.any_names else ", ".join(map(str, self.params))
        return f"{self.name}({arguments})"

    @property
    def may_wait(self) -> bool:
        """Whether a call can take time, so that the host offers it as a generator function."""
        return self.time in (TimeClass.MOTION, TimeClass.FRAMES, TimeClass.BLOCKING)

    def is_in(self, version: Version) -> bool:
        """Whether software of this version knows the function in this form."""
        first = self.since.get(version.generation)
        last = self.until.get(version.generation)
        return first is not None and first <= version and (last is None or version < last)

    def is_documented_in(self, version: Version) -> bool:
        """Whether the script manual of that generation lists it."""
        return self.is_in(version) and version.generation not in self.undocumented


class ModuleVariable(NamedTuple):
    """A constant that programs can read by name, e.g. `a_joint_default`."""

    value: float
    unit: str


class BuiltinArray(NamedTuple):
    """An indexable builtin name: reading `name[n]` calls the getter, assigning calls the setter."""

    name: str
    size: int
    getter: str
    setter: str
