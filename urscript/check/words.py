"""Words and symbols of other languages, and what URScript has instead: tables, and hints made from them."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

from urscript.errors import ScriptCompileError, ScriptNameError, ScriptTypeError


class ForeignWord(NamedTuple):
    """A word that begins a statement in another language.

    Attributes:
        hint: What to write here.
        new: Replacement with which the rest of the text can be checked: a word, or, ending in ":", the
            whole head of a block; empty: the line is removed.
        exact: The replacement keeps the meaning.
    """

    hint: str
    new: str = ""
    exact: bool = False


_COUNT: Final = "write i = 0, then while i < n: ... i = i + 1 end"
_IMPORT: Final = "all functions are available; remove the line"

STATEMENTS: Final[dict[str, ForeignWord]] = {
    "elseif": ForeignWord("write elif", "elif", True),
    "elsif": ForeignWord("write elif", "elif", True),
    "elsf": ForeignWord("write elif", "elif", True),
    "function": ForeignWord("write def", "def", True),
    "func": ForeignWord("write def", "def", True),
    "fn": ForeignWord("write def", "def", True),
    "sub": ForeignWord("write def", "def", True),
    "procedure": ForeignWord("write def", "def", True),
    "void": ForeignWord("write def", "def", True),
    "for": ForeignWord(_COUNT, "while True:"),
    "foreach": ForeignWord(_COUNT, "while True:"),
    "loop": ForeignWord("write while True:", "while True:", True),
    "repeat": ForeignWord("write while True: ... if done: break end ... end", "while True:"),
    "until": ForeignWord("write while not done:", "while True:"),
    "do": ForeignWord("write while True: ... if done: break end ... end", "while True:"),
    "unless": ForeignWord("write if not ...:", "if True:"),
    "switch": ForeignWord("write if, elif and else", "if True:"),
    "match": ForeignWord("write if, elif and else", "if True:"),
    "case": ForeignWord("write if, elif and else"),
    "default": ForeignWord("write else"),
    "try": ForeignWord("an error ends the program; check conditions before", "if True:"),
    "except": ForeignWord("an error ends the program; check conditions before", "else:"),
    "catch": ForeignWord("an error ends the program; check conditions before", "else:"),
    "finally": ForeignWord("an error ends the program; check conditions before"),
    "with": ForeignWord("call the open and close functions", "if True:"),
    "class": ForeignWord("write functions", "if True:"),
    "import": ForeignWord(_IMPORT),
    "from": ForeignWord(_IMPORT),
    "include": ForeignWord(_IMPORT),
    "var": ForeignWord("write x = 1, global x = 1 or local x = 1"),
    "let": ForeignWord("write x = 1, global x = 1 or local x = 1"),
    "const": ForeignWord("write x = 1, global x = 1 or local x = 1"),
}

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

NAMES: Final[dict[str, str]] = {
    "print": "write textmsg(...)",
    "printf": "write textmsg(...)",
    "println": "write textmsg(...)",
    "echo": "write textmsg(...)",
    "log_message": "write textmsg(...)",
    "len": "write length(...)",
    "count": "write length(...)",
    "str": "write to_str(...)",
    "string": "write to_str(...)",
    "int": "write floor(...), ceil(...), or to_num(...) for a string",
    "float": "write to_num(...) for a string; numbers need no conversion",
    "abs": "write norm(...)",
    "fabs": "write norm(...)",
    "max": "write an if",
    "min": "write an if",
    "round": "write floor(x + 0.5)",
    "fmod": "write a % b",
    "range": "count in a while loop",
    "append": "a list has a fixed length; write one that is long enough",
    "input": "write request_string_from_primary_client(...)",
    "time": "count with get_steptime()",
    "null": "write None",
    "nil": "write None",
    "none": "write None",
    "NULL": "write None",
    "TRUE": "write True",
    "FALSE": "write False",
    "on": "write True",
    "off": "write False",
    "pi": "write 3.141592653589793",
    "PI": "write 3.141592653589793",
    "M_PI": "write 3.141592653589793",
    "math": "mathematical functions have no prefix: sqrt(x), sin(x)",
    "np": "mathematical functions have no prefix: sqrt(x), sin(x)",
    "self": "URScript has no objects",
    "this": "URScript has no objects",
    "pass": "a block may be empty; remove it",
    "wait": "write sleep(...)",
    "delay": "write sleep(...)",
    "usleep": "write sleep(...), in seconds",
    "pause": "write sleep(...) to wait, halt to end",
    "stop": "write stopj(2) for the arm, halt for the program",
    "exit": "write halt",
    "quit": "write halt",
    "goto": "write a while loop",
    "degrees": "write r2d(...)",
    "radians": "write d2r(...)",
    "deg2rad": "write d2r(...)",
    "rad2deg": "write r2d(...)",
    "random_float": "write random()",
    "rand": "write random()",
    "moveJ": "write movej(...)",
    "MoveJ": "write movej(...)",
    "moveL": "write movel(...)",
    "MoveL": "write movel(...)",
    "move": "write movej(...) or movel(...)",
    **dict.fromkeys(("double", "bool", "char", "auto"), "remove it: x = 1 is enough"),
    **dict.fromkeys(("import", "from", "include"), _IMPORT),
}
"""Names of other languages: hint."""

TYPES: Final = frozenset(
    {"int", "float", "double", "bool", "boolean", "string", "char", "auto", "var", "let", "const"}
)
"""Words before the name in a declaration of another language."""

KEYWORDS: Final[dict[str, str]] = {
    **dict.fromkeys(("acc", "accel", "acceleration"), "a"),
    **dict.fromkeys(("vel", "speed", "velocity"), "v"),
    **dict.fromkeys(("time", "duration"), "t"),
    **dict.fromkeys(("radius", "blend", "blend_radius"), "r"),
}
"""Guessed names of arguments: the name in URScript."""

SYMBOLS: Final[dict[str, tuple[str, str]]] = {
    "&&": ("and", "write and"),
    "||": ("or", "write or"),
    "&": ("and", "write and; bits are in integer_to_binary_list(...)"),
    "|": ("or", "write or; bits are in integer_to_binary_list(...)"),
    ";": (" ", "remove it; statements need no separator"),
    "{": (":", "a block begins with ':' and ends with 'end'"),
    "}": ("end", "a block begins with ':' and ends with 'end'"),
    "^": ("*", "write pow(a, b)"),
    "?": (" ", "write if ...: x = a else: x = b end"),
    "\u201c": ('"', 'write "'),
    "\u201d": ('"', 'write "'),
    "\u201e": ('"', 'write "'),
    "\u00ab": ('"', 'write "'),
    "\u00bb": ('"', 'write "'),
    "\u2018": ('"', 'write "'),
    "\u2019": ('"', 'write "'),
    "\u00b4": ('"', 'write "'),
    "`": ('"', 'write "'),
    "'": ('"', 'write "'),
    "\u2013": ("-", "write -"),
    "\u2014": ("-", "write -"),
    "\u2212": ("-", "write -"),
    "\u00d7": ("*", "write *"),
    "\u00b7": ("*", "write *"),
    "\u00f7": ("/", "write /"),
    "\u2264": ("<=", "write <="),
    "\u2265": (">=", "write >="),
    "\u2260": ("!=", "write !="),
    "\u00a0": (" ", "write a space"),
    "\u202f": (" ", "write a space"),
    "\u2009": (" ", "write a space"),
    "\u200b": (" ", "remove it"),
    "\ufeff": (" ", "remove it"),
    "\\": (" ", "remove it; a statement may continue on the next line"),
}
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
