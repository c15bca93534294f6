"""Every decision about the language that no document answers, in one place, with what is known.

Two kinds: what differs between software generations is a field of `Dialect`; what is only unknown is a
constant. Letters: D documented, O observed, I inferred, U unknown. `docs/fidelity.md`
lists the U rows for users.

Decisions without a constant, and where they are made:

| question (U where nothing stands) | decision | made in |
|---|---|---|
| a result outside 32 bits (I: the controller's C) | wraps around | values |
| 6 / 3 (the maker's driver relies on real division) | a float, as 7 / 3 is | runtime |
| -7 % 3 | -1, as in C | runtime |
| x[4 / 2] (or no index could be computed) | x[2] | variables |
| a bool in arithmetic (O for `*`, a driver up to 3.2; I for the others) | 1 or 0 | runtime |
| a number as a condition (O: the maker's driver tests a float of a socket) | 0 is false | runtime |
| a string, or a pose, `==` a number, or a list | False, no error | runtime |
| the right side of `and` / `or` when the left side decides | is not evaluated | expressions |
| None in a variable of any type, and back | allowed; the type is else fixed (D) | variables |
| six numbers in a variable with a pose, and back (O: a driver for the UR5e) | allowed | variables |
| a bool where a builtin, or a pose, takes a number (O, drivers) | 1 or 0 | catalogue.calls |
| a number where a builtin takes a bool (O, PolyScope) | 0 is False | catalogue.calls |
| a bool in a list of numbers, compared with a number | an error, not equal | variables, runtime |
| `;` (O, a driver for CB2 and CB3) | may end a statement | grammar.lark |
| hexadecimal literals, a line end in a string | refused | grammar.lark |
| a label after a statement, `return` without a value | accepted | grammar.lark |
| list * matrix, matrix / matrix; matrix + matrix | errors; of equal shape by element | runtime |
| the text of a struct | `{a: 1, b: "x"}` | values |
| `insert` behind the last element, `remove` | appends, returns nothing | variables |
| capacity of a slice; of a variable whose first value is a list | its length; that of the list | variables |
| storing by index into a struct | as by the name of the member | variables |
| a sign before a list or matrix | by element | runtime |
| reading a variable before it has a value | run-time error | variables |
| two definitions of one name | the later one counts | resolver |
| `sleep` of a fraction of a cycle, of less than 0 | a whole cycle, none | runtime |
| order of threads | the body, then by age | threads |
| log(b, 0), asin(NaN), floor(1e10) | infinite, NaN, an error | builtins |
| str_find from beyond the ends, to_num("12 "), to_num("5e-4") | -1, an error, a float | builtins |
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

STATEMENT_BUDGET: Final = 110_000
"""Statements a thread may run in one time slice (U): a loop of 100,000 iterations and the code around it.
Exported programs run thousands of assignments at their start without a sync, so real budgets are at least
10^4 to 10^5 (O)."""

LONGEST_NAME: Final = 255
"""Characters of a name (U). The longest in known programs have 56; PolyScope cuts the names of programs to 31
characters (O) and writes each one beyond ASCII as six (O), which makes 186."""

LONGEST_LABEL: Final = 1_023
"""Characters of a `$` line (U)."""

LONGEST_STRING: Final = 65_536
"""Characters of a string: a literal, what `+` makes, what comes from outside, the text of a value (U; that of
str_cat and to_str ends at 1023, D). Without a limit, a string that is added to itself thirty times fills the
memory."""

LONGEST_LIST: Final = 65_536
"""Most elements that a list can have room for (U; a controller allocates no memory at run time, D)."""

LARGEST_STRUCT: Final = 10_000
"""Values in a struct, with those of the structs and lists in it (U). Without a limit, a struct that holds
another twice, and so on, has more values than any text of it can show."""

RECURSION_LIMIT: Final = 200
"""Depth at which a recursive function fails with a run-time error (U; no field script recurses)."""

MAX_CALL_DEPTH: Final = 200
"""Calls inside one another in a thread, recursive ones not counted (U; drivers and exported programs have a
few). A program in which functions call one another deeper is refused before it runs."""

MAX_OPEN_CALLS: Final = 10_000
"""Calls inside one another of all threads of a program together (U): the deepest of each thread that its
functions allow, and its recursive ones as they happen. To end so many takes 2.5 ms."""

MAX_LOOP_DEPTH: Final = 16
"""Nesting of loops that is allowed (U). The oldest Python that runs the box allows 20 blocks; a
recursive function needs one more."""

MAX_THREADS: Final = 200
"""Threads that one program may have running at the same time (U). Driver scripts have a few."""

ListResize = Literal["free", "error", "capacity"]


@dataclass(frozen=True, slots=True)
class Dialect:
    """The language options that one program is compiled with.

    Attributes:
        list_resize: What storing a list of another length into a list variable does. "capacity" since 5.15:
            it keeps its capacity, a list that is longer is an error (D); "error" since 3.14 / 5.9.4 (O for
            5.9.4-5.14.6, I for 3.14-3.15), "free" before (O), "error" before 3.2 (I: a driver of that time
            has a list for each length that it reads).
        array_arithmetic: The arithmetic operators work on lists and matrices: since 3.14 / 5.9 (O).
        has_pause: `pause` is a statement (e-Series 5.x, D); elsewhere it is an ordinary name.
        statement_budget: Statements a thread may run in one cycle.
        recursion_limit: Depth of calls of a recursive function.
    """

    list_resize: ListResize = "error"
    array_arithmetic: bool = True
    has_pause: bool = False
    statement_budget: int = STATEMENT_BUDGET
    recursion_limit: int = RECURSION_LIMIT


def dialect_for(version: Sequence[int]) -> Dialect:
    """The dialect of a software version, e.g. (3, 15)."""
    major, minor = version[0], version[1]
    if major == 3:
        recent = minor >= 14
        return Dialect(list_resize="error" if recent or minor < 2 else "free", array_arithmetic=recent)
    modern = major > 5 or minor >= 15
    resize: ListResize = "capacity" if modern else "error" if minor >= 9 else "free"
    return Dialect(list_resize=resize, array_arithmetic=major > 5 or minor >= 9, has_pause=True)
