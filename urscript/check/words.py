"""Words and symbols of other languages, and what URScript has instead: tables, and hints made from them."""

import re
from collections.abc import Mapping
from typing import Final, NamedTuple, TypeVar

from urscript.errors import ScriptCompileError, ScriptNameError, ScriptTypeError

T = TypeVar("T")


class ForeignWord(NamedTuple):
    """A word that begins a statement in another language.

    Attributes:
        new: Replacement with which the rest of the text can be checked: a word, or, ending in ":", the
            whole head of a block; empty: the line is removed.
        exact: The replacement keeps the meaning.
    """

    hint: str
    new: str = ""
    exact: bool = False


def _by_word(rows: Mapping[str, T]) -> dict[str, T]:
    """A table with a row for each word, from one with a row for several, which blanks separate."""
    return {word: row for words, row in rows.items() for word in words.split(" ")}


_IMPORT: Final = "all functions are available; remove the line"
_UNTIL: Final = "write while True: ... if done: break end ... end"
_NO_EXCEPTIONS: Final = "an error ends the program; check conditions before"

STATEMENTS: Final[dict[str, ForeignWord]] = _by_word(
    {
        "elseif elsif elsf": ForeignWord("write elif", "elif", True),
        "function func fn sub procedure void": ForeignWord("write def", "def", True),
        "for foreach": ForeignWord("write i = 0, then while i < n: ... i = i + 1 end", "while True:"),
        "loop": ForeignWord("write while True:", "while True:", True),
        "repeat do": ForeignWord(_UNTIL, "while True:"),
        "until": ForeignWord("write while not done:", "while True:"),
        "unless": ForeignWord("write if not ...:", "if True:"),
        "switch match": ForeignWord("write if, elif and else", "if True:"),
        "case": ForeignWord("write if, elif and else"),
        "default": ForeignWord("write else"),
        "try": ForeignWord(_NO_EXCEPTIONS, "if True:"),
        "except catch": ForeignWord(_NO_EXCEPTIONS, "else:"),
        "finally": ForeignWord(_NO_EXCEPTIONS),
        "with": ForeignWord("call the open and close functions", "if True:"),
        "class": ForeignWord("write functions", "if True:"),
        "import from include": ForeignWord(_IMPORT),
        "var let const": ForeignWord("write x = 1, global x = 1 or local x = 1"),
    }
)

BLOCK_ENDS: Final = frozenset(
    {"endif", "endwhile", "endfor", "enddef", "endfunction", "endthread", "endloop", "fi", "done", "wend"}
)
"""Words that end a block in other languages."""

WORDS_AFTER_END: Final = frozenset({"if", "while", "def", "thread", "for", "function", "sec"})
"""Words that follow `end` in other languages."""

OPERATORS: Final[dict[str, tuple[str, str]]] = {
    "**": ("*", "write pow(a, b)"),
    "<>": ("!=", "write !="),
    "=>": (">=", "write >="),
    "=<": ("<=", "write <="),
}
"""Operators of two symbols: replacement and hint."""

WORD_OPERATORS: Final[dict[str, tuple[str, str]]] = {
    "is": ("==", "write =="),
    "isnt": ("!=", "write !="),
    "in": ("==", "write a while loop"),
    "mod": ("%", "write %"),
    "div": ("/", "write floor(a / b)"),
}
"""Operators that are words: replacement and hint."""

RESERVED: Final = frozenset(
    {"def", "sec", "thread", "end", "if", "elif", "else", "while", "break", "continue", "halt", "return"}
    | {"enter_critical", "exit_critical", "join", "kill", "run", "global", "local"}
    | {"or", "xor", "and", "not", "None", "True", "False", "true", "false"}
)
"""Reserved words."""

NAMES: Final[dict[str, str]] = _by_word(
    {
        "print printf println echo log_message": "write textmsg(...)",
        "len count": "write length(...)",
        "str string": "write to_str(...)",
        "int": "write floor(...), ceil(...), or to_num(...) for a string",
        "float": "write to_num(...) for a string; numbers need no conversion",
        "abs fabs": "write norm(...)",
        "max min": "write an if",
        "round": "write floor(x + 0.5)",
        "fmod": "write a % b",
        "range": "count in a while loop",
        "append": "a list has a fixed length; write one that is long enough",
        "input": "write request_string_from_primary_client(...)",
        "time": "count with get_steptime()",
        "null nil none NULL": "write None",
        "TRUE on": "write True",
        "FALSE off": "write False",
        "pi PI M_PI": "write 3.141592653589793",
        "math np": "mathematical functions have no prefix: sqrt(x), sin(x)",
        "self this": "URScript has no objects",
        "pass": "a block may be empty; remove it",
        "wait delay": "write sleep(...)",
        "usleep": "write sleep(...), in seconds",
        "pause": "write sleep(...) to wait, halt to end",
        "stop": "write stopj(2) for the arm, halt for the program",
        "exit quit": "write halt",
        "goto": "write a while loop",
        "degrees rad2deg": "write r2d(...)",
        "radians deg2rad": "write d2r(...)",
        "random_float rand": "write random()",
        "moveJ MoveJ": "write movej(...)",
        "moveL MoveL": "write movel(...)",
        "move": "write movej(...) or movel(...)",
        "double bool char auto": "remove it: x = 1 is enough",
        "import from include": _IMPORT,
    }
)
"""Names of other languages: hint."""

TYPES: Final = frozenset(
    {"int", "float", "double", "bool", "boolean", "string", "char", "auto", "var", "let", "const"}
)
"""Words before the name in a declaration of another language."""

KEYWORDS: Final[dict[str, str]] = _by_word(
    {
        "acc accel acceleration": "a",
        "vel speed velocity": "v",
        "time duration": "t",
        "radius blend blend_radius": "r",
    }
)
"""Guessed names of arguments: the name in URScript."""

SYMBOLS: Final[dict[str, tuple[str, str]]] = _by_word(
    {
        "&&": ("and", "write and"),
        "||": ("or", "write or"),
        "&": ("and", "write and; bits are in integer_to_binary_list(...)"),
        "|": ("or", "write or; bits are in integer_to_binary_list(...)"),
        "{": (":", "a block begins with ':' and ends with 'end'"),
        "}": ("end", "a block begins with ':' and ends with 'end'"),
        "^": ("*", "write pow(a, b)"),
        "?": (" ", "write if ...: x = a else: x = b end"),
        "\u201c \u201d \u201e \u00ab \u00bb \u2018 \u2019 \u00b4 ` '": ('"', 'write "'),
        "\u2013 \u2014 \u2212": ("-", "write -"),
        "\u00d7 \u00b7": ("*", "write *"),
        "\u00f7": ("/", "write /"),
        "\u2264": ("<=", "write <="),
        "\u2265": (">=", "write >="),
        "\u2260": ("!=", "write !="),
        "\u00a0 \u202f \u2009": (" ", "write a space"),
        "\u200b \ufeff": (" ", "remove it"),
        "\\": (" ", "remove it; a statement may continue on the next line"),
    }
)
"""Characters without meaning in URScript: replacement and hint."""

INVISIBLE: Final = {
    "\u00a0": "no-break space",
    "\u202f": "narrow no-break space",
    "\u2009": "thin space",
    "\u200b": "zero-width space",
    "\ufeff": "byte order mark",
}
"""Names of characters that cannot be seen."""


# --- hints ----------------------------------------------------------------------------------------------


def with_hint(error: ScriptCompileError) -> ScriptCompileError:
    """Improve the hint and the place of an error where possible; returns the same error."""
    text = error.source.line(error.line) if error.source else ""
    if isinstance(error, ScriptNameError):
        hint = _hint_for_thread(error, text) or _hint_for_name(error.name, text, error.column)
        error.hint = hint or error.hint
    elif isinstance(error, ScriptTypeError):
        _point_at_keyword(error, text)
    return error


def concerns_whole_line(error: ScriptCompileError) -> bool:
    """Whether the error concerns all of its line, so that other errors in it are consequences."""
    text = error.source.line(error.line).lstrip() if error.source else ""
    head = re.match(r"\w*", text)
    return text.startswith("--") or (head is not None and head[0] in STATEMENTS.keys() | TYPES)


def _hint_for_name(name: str, text: str, column: int) -> str | None:
    rest = text[column - 1 + len(name) :]
    if text.lstrip().startswith("--"):
        return "a comment begins with '#'"
    if name in TYPES and (variable := re.match(r"\s+([A-Za-z_]\w*)\s*=", rest)):
        return f"URScript has no type declarations: write {variable[1]} = ..."
    if name in ("math", "np") and (function := re.match(r"\.(\w+)\s*\(", rest)):
        return f"mathematical functions have no prefix: write {function[1]}(...)"
    if name in STATEMENTS and not text[: column - 1].strip():
        return STATEMENTS[name].hint
    return NAMES.get(name)


def _hint_for_thread(error: ScriptNameError, text: str) -> str | None:
    """`kill watch`, `kill w()`: the name of a thread in place of its handle, the handle called."""
    word = re.search(r"\b(kill|join)\s*\(?\s*$", text[: error.column - 1])
    program = error.source.text if error.source else ""
    if word is None:
        return None
    if re.search(rf"\b{error.name}\s*=\s*run\b", program):
        return f"write {word[1]} {error.name}"
    if not re.search(rf"\bthread\s+{error.name}\s*\(", program):
        return None
    handle = re.search(rf"(\w+)\s*=\s*run\s+{error.name}\b", program)
    if handle is not None:
        return f"write {word[1]} {handle[1]}, the handle of this thread"
    return f"write t = run {error.name}(), then {word[1]} t"


def _point_at_keyword(error: ScriptTypeError, text: str) -> None:
    """Underline the argument that does not exist instead of the call."""
    unknown = re.search(r"unexpected keyword argument '(\w+)'", error.message)
    if unknown is None:
        return
    place = re.compile(rf"\b{unknown[1]}\s*=(?!=)").search(text, error.column - 1)
    if place is not None:
        error.column, error.width = place.start() + 1, len(unknown[1])
    signature = error.hint or ""
    parameter = KEYWORDS.get(unknown[1].lower(), unknown[1].lower())
    if re.search(rf"[(,]\s*{parameter}\b", signature):
        error.hint = f"write {parameter}=, {signature}"
