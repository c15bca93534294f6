"""Operation: an operation of the control API, declared as a frozen dataclass.

The first sentence of its docstring is its sentence; its fields are its parameters (`parameter`); they are
checked when the record is made. Methods of `ControlBox`, the HTTP API, `ur-emulator ctl` and docs/control.md
follow from that (`control.operations`). The command line imports all of them: nothing heavy here.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, fields
from inspect import getdoc
from typing import ClassVar, Generic, TypeVar, dataclass_transform, get_type_hints

from ur_emulator.commands.parameters import Parameter, parameter
from ur_emulator.controller.command import Box, Result

R_co = TypeVar("R_co", covariant=True)


@dataclass_transform(frozen_default=True, field_specifiers=(parameter,))
class Operation(Generic[R_co]):
    """What is common to all operations; `R_co` is what the method of `ControlBox` returns.

    Attributes:
        parameters: its fields.
        meaning: its sentence.
        result: what the JSON object that it returns holds.
        only_reads: it changes nothing: a property in Python, GET in HTTP.
        is_logged: the box's log shows that it was asked for.

    Raises:
        ArgumentError: when one is made with a value that does not fit.
    """

    parameters: ClassVar[tuple[Parameter, ...]] = ()
    meaning: ClassVar[str] = ""
    result: ClassVar[str] = "`tick`: the cycle in which it was applied"
    only_reads: ClassVar[bool] = False
    is_logged: ClassVar[bool] = True

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        dataclass(frozen=True)(cls)
        types = get_type_hints(cls)
        cls.parameters = tuple(Parameter.of(field, types[field.name]) for field in fields(cls))  # type: ignore[arg-type]
        cls.meaning = (getdoc(cls) or "").partition("\n")[0]

    def __post_init__(self) -> None:
        for row in self.parameters:
            object.__setattr__(self, row.name, row.check(getattr(self, row.name)))
        self.check_together()

    def check_together(self) -> None:
        """Refuse parameters that fit one by one but not together.

        Raises:
            ArgumentError: says which.
        """


class CommandOperation(Operation[int]):
    """An operation that is done at the beginning of a cycle; its method returns the number of that cycle."""

    @abstractmethod
    def apply(self, box: Box) -> Result:
        """Apply the operation.

        Returns:
            What the result holds beside `tick`, if anything.

        Raises:
            RefusedError: the state of the box does not allow it.
        """
