"""The rules that explain syntax errors: characters, brackets, blocks, statements of other languages."""

import re
from typing import Final, NamedTuple

from urscript.check import words
from urscript.check.tokens import (
    CLOSERS,
    PAIRS,
    Advice,
    Edit,
    Problem,
    Rule,
    Token,
    TokenizedText,
    absent,
    advice_at,
    replacement,
)
from urscript.source import as_utf8
from urscript.values import to_script_text

_DIVISION_AFTER = re.compile(r"//(\d|\(|\w| \d)")
_VALUE_BEFORE = re.compile(r"=.*[\w)\]]\s*$")


def comment(problem: Problem) -> Advice | None:
    """`// text`, `/* text */`: comments of other languages, and the division of whole numbers."""
    text, start = problem.tokenized.text, problem.tokenized.line_start(problem.token.line)
    found = re.compile(r"//|/\*").search(text, start, problem.token.start + 2)
    if found is None:
        return None
    lead = text[start : found.start()]
    if lead.count('"') % 2 or "#" in lead:
        return None
    if found[0] == "/*":
        end = text.find("*/", found.end()) + 2
        end = len(text) if end < found.end() else end
        edit = Edit(found.start(), end, re.sub(r"[^\n]", " ", text[found.start() : end]))
        hint = "begin each line of a comment with '#'"
    elif _VALUE_BEFORE.search(lead) and _DIVISION_AFTER.match(text, found.start()):
        edit = Edit(found.start(), found.end(), "/ ")
        hint = "write floor(a / b)"
    else:
        edit = Edit(found.start(), found.end(), "# ")
        hint = "a comment begins with '#'"
    message = f"there is no '{found[0]}' in URScript"
    return Advice(message, hint, found.start(), found.end(), (edit,))


def quotes(problem: Problem) -> Advice | None:
    """Strings between other quotation marks than `"`."""
    token = problem.token
    mark = as_utf8(token.text)
    if words.SYMBOLS.get(mark, ("", ""))[0] != '"':
        return None
    marks = "|".join(
        re.escape(to_script_text(sign)) for sign, (new, _) in words.SYMBOLS.items() if new == '"'
    )
    start, line = problem.tokenized.line_start(token.line), problem.tokenized.line(token.line)
    edits = [
        Edit(start + match.start(), start + match.end(), '"'.ljust(len(match[0])))
        for match in re.finditer(marks, line)
    ]
    return advice_at(token, f"{mark} does not delimit a string", words.SYMBOLS[mark][1], *edits)


def symbol(problem: Problem) -> Advice | None:
    """Symbols of other languages, and those that editors insert."""
    token, last = problem.token, problem.token
    if not problem.is_lexical or token.kind != "symbol":
        return None
    written = as_utf8(token.text)
    if token.text + problem.following.text in words.SYMBOLS and problem.following.start == token.end:
        last = problem.following
        written = token.text + last.text
    if written not in words.SYMBOLS:
        message = f"unexpected character '{written}'"
        return advice_at(token, message, None, replacement(token, " "), exact=False)
    new, hint = words.SYMBOLS[written]
    if written == "{" and problem.previous.text == ":":
        new = " "
    elif new.isalpha():
        new = f" {new} "
    if written in words.INVISIBLE:
        message = f"unexpected {words.INVISIBLE[written]}"
        return advice_at(token, message, hint, replacement(token, new))
    return absent(written, hint, token, new, last)


def number(problem: Problem) -> Advice | None:
    """Malformed numbers: hexadecimal, with units, with two points."""
    token, following = problem.token, problem.following
    if not problem.is_lexical or token.kind != "number":
        return None
    text = token.text
    if following.start == token.end and as_utf8(following.text) == "\u00b0":
        return absent("\u00b0", f"write d2r({text})", following, " ")
    if re.fullmatch(r"0[xX][0-9a-fA-F]{1,8}", text):
        value = int(text, 16)
        message = f"URScript has no hexadecimal numbers, got {text}"
        hint = f'write {value} or to_num("{text}")'
        return advice_at(token, message, hint, replacement(token, str(value)))
    unit = re.fullmatch(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)([A-Za-z]\w*)", text)
    if unit:
        hint = f"write {unit[1]} alone: lengths are in m, times in s, angles in rad"
        return advice_at(token, f"a number has no unit, got {text}", hint, replacement(token, unit[1]))
    return advice_at(token, f"malformed number {text}", None, replacement(token, "0"), exact=False)


def unterminated_string(problem: Problem) -> Advice | None:
    """A string without its closing quote."""
    token = problem.token
    if not problem.is_lexical or token.kind != "string" or token.text.count('"') != 1:
        return None
    text = token.text.rstrip()
    n_open = len(problem.open_brackets())
    while n_open and text.endswith(")"):
        text, n_open = text[:-1], n_open - 1
    end = token.start + len(text)
    return advice_at(
        token, "unterminated string: no closing '\"'", "close it on the same line", Edit(end, end, '"')
    )


def pose_elements(problem: Problem) -> Advice | None:
    """`p[x, y, z, rx, ry]`: a pose without exactly six elements."""
    letter, bracket = problem.token, problem.following
    if problem.error.unexpected or letter.text != "p" or bracket.text != "[":
        return None
    depth, n_parts = 0, 1
    for token in problem.tokenized.tokens[problem.index + 1 :]:
        depth += (token.text in ("(", "[")) - (token.text in (")", "]"))
        n_parts += token.text == "," and depth == 1
        if depth == 0:
            message = f"a pose has 6 elements, not {n_parts}"
            filling = ", 0" * (6 - n_parts)
            edits = (Edit(token.start, token.start, filling),) if n_parts < 6 else ()
            return advice_at(letter, message, "write p[x, y, z, rx, ry, rz]", *edits, last=token)
    return None


# --- brackets and commas: unclosed, unmatched, missing --------------------------------------------------

_VALUE_WORDS = frozenset({"True", "False", "true", "false", "None", "not", "run"})


def unmatched_closer(problem: Problem) -> Advice | None:
    """`textmsg(1))`, `[1, 2)`."""
    token = problem.token
    if token.text not in CLOSERS:
        return None
    brackets = problem.open_brackets()
    if not brackets:
        message = f"this '{token.text}' has no '{CLOSERS[token.text]}'"
        return advice_at(token, message, "remove it", replacement(token, " "))
    opener = brackets[-1]
    right = PAIRS[opener.text]
    if right == token.text:
        return None
    if len(brackets) > 1 and PAIRS[brackets[-2].text] == token.text:
        message = f"this '{opener.text}' is never closed"
        return advice_at(
            opener, message, f"write {right} before {token.text}", Edit(token.start, token.start, right)
        )
    line, column = problem.tokenized.place(opener.start)
    message = f"'{token.text}' does not close the '{opener.text}' of {line}:{column}"
    return advice_at(token, message, f"write {right}", replacement(token, right))


def unclosed_bracket(problem: Problem) -> Advice | None:
    """A bracket that is still open where the next statement begins."""
    brackets = problem.open_brackets()
    if not brackets:
        return None
    opener, last = brackets[-1], problem.previous
    message = f"this '{opener.text}' is never closed"
    comma = problem.neighbor(-2)
    if problem.token.text == "=" and opener.text == "[" and last.kind == "word" and comma.text == ",":
        return advice_at(
            opener, message, f"write ] before ', {last.text}='", Edit(comma.start, comma.start, "]")
        )
    if not problem.starts_line or not problem.accepts("COMMA", "RPAR", "RSQB", "RUN"):
        return None
    missing = "".join(PAIRS[bracket.text] for bracket in reversed(brackets))
    hint = f"write {missing} at the end of line {last.line}"
    if last.text == ",":
        return advice_at(opener, message, f"{hint}, in place of ','", replacement(last, missing))
    if last.kind == "symbol" and last.text not in CLOSERS and last != opener:
        return None  # a value is missing as well: that comes first
    return advice_at(opener, message, hint, Edit(last.end, last.end, missing))


def decimal_comma(problem: Problem) -> Advice | None:
    """`x = 0,5`."""
    before, comma, after = problem.previous, problem.token, problem.following
    if comma.text != "," or before.kind != "number" or after.kind != "number":
        return None
    if before.end != comma.start or comma.end != after.start or "." in before.text + after.text:
        return None
    hint = f"write {before.text}.{after.text}"
    return advice_at(comma, "the decimal separator is '.', not ','", hint, replacement(comma, "."))


def tuples(problem: Problem) -> Advice | None:
    """`x = (1, 2)`, `a, b = 1, 2`."""
    comma = problem.token
    if comma.text != ",":
        return None
    brackets = problem.open_brackets()
    if brackets and brackets[-1].text == "(":
        opener = brackets[-1]
        edits = [replacement(opener, "[")]
        close = _partner(problem, opener)
        if close is not None:
            edits.append(replacement(close, "]"))
        return advice_at(opener, "a list is written in [ ]", "write [a, b]", *edits)
    index, head = problem.line_head(comma.line)
    if not brackets and head.kind == "word" and index + 1 == problem.index:
        end = problem.tokenized.line_end(comma.line)
        edit = Edit(head.start, end, " " * (end - head.start))
        hint = "write one assignment for each"
        return advice_at(head, "an assignment sets one variable", hint, edit, last=comma, exact=False)
    return None


def _partner(problem: Problem, opener: Token) -> Token | None:
    """The bracket that closes `opener`, counting its own kind only."""
    depth = 0
    for token in problem.tokenized.tokens[problem.tokenized.token_at(opener.start) :]:
        depth += (token.text == opener.text) - (token.text == PAIRS[opener.text])
        if not depth:
            return token
    return None


def missing_comma(problem: Problem) -> Advice | None:
    """`[1, 2 3]`, `movej(q a=1)`; and strings that end too early."""
    token, before = problem.token, problem.previous
    if problem.starts_line or not problem.accepts("COMMA"):
        return None
    if token.kind not in ("word", "number", "string") and token.text not in PAIRS:
        return None
    if token.text in words.RESERVED - _VALUE_WORDS:
        return None
    if before.kind == "string" and before.text.endswith('\\"'):
        start = problem.tokenized.line_start(token.line)
        end = max(before.end, start + problem.tokenized.line(token.line).rfind('"') + 1)
        edit = Edit(before.start, end, '""'.ljust(end - before.start))
        message, hint = 'a string cannot contain \\": it ends here', "remove the quotation marks"
        return Advice(message, hint, before.end - 2, before.end, (edit,))
    if token.kind == "string" and before.text in ("f", "r", "b") and before.end == token.start:
        hint = "write textmsg(text, x) or str_cat(text, x)" if before.text == "f" else "remove the letter"
        return advice_at(before, f"a string has no prefix '{before.text}'", hint, replacement(before, " "))
    return advice_at(
        token, f"a ',' is missing before '{token.text}'", None, Edit(before.end, before.end, ",")
    )


def trailing_comma(problem: Problem) -> Advice | None:
    """`[1, 2,]`."""
    comma = problem.previous
    if comma.text != "," or problem.token.text not in CLOSERS:
        return None
    return advice_at(comma, "nothing follows this ','", "remove it", replacement(comma, " "))


_NOT_IN_BRACKETS: Final = {
    ":": ("slices x[a:b] and no pairs a: b", "write a while loop"),
    "for": ("list comprehensions", "write a while loop"),
    "if": ("conditional expressions", "write if ...: x = a else: x = b end"),
    "else": ("conditional expressions", "write if ...: x = a else: x = b end"),
}


def inside_brackets(problem: Problem) -> Advice | None:
    """`x[1:2]`, `[i for i in x]`: what is not allowed in brackets."""
    token = problem.token
    if problem.starts_line or not problem.open_brackets() or not problem.accepts("COMMA", "RPAR", "RSQB"):
        return None
    what, hint = _NOT_IN_BRACKETS.get(token.text, ("", ""))
    return advice_at(token, f"URScript has no {what}", hint) if what else None


# --- blocks; the indentation shows where an `end` is missing or superfluous -----------------------------

_OPENERS = frozenset({"def", "sec", "thread", "if", "while"})
_BRANCHES = frozenset({"else", "elif"})


class _Opener(NamedTuple):
    token: Token
    indent: int


def foreign_end(problem: Problem) -> Advice | None:
    """`endif`, `end if`: ends of other languages, anywhere above the error."""
    tokenized = problem.tokenized
    if not problem.starts_line:
        return None
    for index, token in enumerate(tokenized.tokens[: problem.index]):
        if not tokenized.is_first(index) or token.kind != "word":
            continue
        second = tokenized.tokens[index + 1]
        third = tokenized.tokens[min(index + 2, len(tokenized.tokens) - 1)]
        if token.text in words.BLOCK_ENDS and _is_elsewhere(second, token):
            return absent(token.text, "write end", token, "end")
        alone = not _is_elsewhere(second, token) and _is_elsewhere(third, token)
        if token.text == "end" and second.text in words.WORDS_AFTER_END and alone:
            message = f"a block ends with 'end', not 'end {second.text}'"
            return advice_at(token, message, "write end", replacement(second, " "), last=second)
    return None


def _is_elsewhere(token: Token, other: Token) -> bool:
    return token.line != other.line or token.kind == "end"


def missing_end(problem: Problem) -> Advice | None:
    """The text ends inside a block."""
    if problem.error.unexpected != "$END" or problem.open_brackets():
        return None
    found = _unclosed(problem.tokenized)
    if found is None:
        return None
    opener, index = found
    message = f"this '{opener.token.text}' has no 'end'"
    following = problem.tokenized.tokens[index]
    if following.kind == "end":
        edit = Edit(following.end, following.end, f"\n{' ' * opener.indent}end")
        return advice_at(opener.token, message, "add 'end' at the end of the program", edit)
    # After the last token before it: there it moves no other token and is not in a comment.
    last = problem.tokenized.tokens[index - 1]
    hint = f"it seems to belong before line {following.line}"
    return advice_at(opener.token, message, hint, Edit(last.end, last.end, " end"))


def _unclosed(tokenized: TokenizedText) -> tuple[_Opener, int] | None:
    """The block that has no end, and the index of the token before which it is missing.

    A statement that is indented no deeper than an open block shows that the block should have ended.
    """
    stack: list[_Opener] = []
    for index, token in enumerate(tokenized.tokens):
        if tokenized.is_first(index) and stack and token.kind == "word":
            indent, top = tokenized.indent(token.line), stack[-1]
            may_follow = token.text == "end" or token.text in _BRANCHES
            if indent < top.indent or (indent == top.indent and not may_follow):
                return top, index
        if token.kind == "word" and token.text in _OPENERS:
            stack.append(_Opener(token, tokenized.indent(token.line)))
        elif token.text == "end" and stack:
            stack.pop()
    return (stack[-1], len(tokenized.tokens) - 1) if stack else None


def extra_end(problem: Problem) -> Advice | None:
    """There are more `end`s than blocks."""
    wrong, tokenized = problem.token, problem.tokenized
    if wrong.text != "end" or problem.accepts("END") or not problem.accepts("WHILE", "$END"):
        return None
    stack: list[_Opener] = []
    for index, token in enumerate(tokenized.tokens[: problem.index]):
        if token.kind == "word" and token.text in _OPENERS:
            stack.append(_Opener(token, tokenized.indent(token.line)))
        elif token.text == "end" and stack:
            opener = stack.pop()
            if tokenized.is_first(index) and tokenized.indent(token.line) != opener.indent:
                wrong = token
                break
    return advice_at(wrong, "this 'end' has no block", "remove it", replacement(wrong, " "))


def else_if(problem: Problem) -> Advice | None:
    """`else if x:`."""
    token, before = problem.token, problem.previous
    if token.text != "if" or before.text != "else" or problem.starts_line:
        return None
    return absent("else if", "write elif", before, "elif", token)


def missing_colon(problem: Problem) -> Advice | None:
    """`if x == 1` and no colon before the next statement."""
    token, before = problem.token, problem.previous
    if not problem.accepts("COLON"):
        return None
    if token.text in ("then", "do"):
        return absent(token.text, "write ':'", token, ":")
    if not problem.starts_line and token.kind != "word":
        return None
    _, head = problem.line_head(before.line)
    shown = re.sub(r"\s+", " ", problem.tokenized.text[head.start : before.end])
    hint = f"write {shown}:" if len(shown) <= 40 else None
    message = f"a ':' is missing after '{before.text}'"
    return Advice(message, hint, before.end - 1, before.end, (Edit(before.end, before.end, ":"),))


# --- statements -----------------------------------------------------------------------------------------

_COMPARES: Final = frozenset({"==", "!=", "<", ">", "<=", ">="})
_CONDITIONS: Final = frozenset({"if", "elif", "while"})
_ALONE: Final = frozenset({"halt", "return", "break", "continue", "enter_critical", "exit_critical"})
_NEED_THREADS: Final = frozenset({"kill", "join"})


def foreign_statement(problem: Problem) -> Advice | None:
    """`for i in range(3):`, `elseif x:`, `function f():` and the like."""
    lines = {problem.token.line, problem.previous.line if problem.starts_line else problem.token.line}
    for line in sorted(lines):
        index, head = problem.line_head(line)
        word = words.STATEMENTS.get(head.text)
        if word is None or index > problem.index or problem.tokenized.tokens[index + 1].text == "=":
            continue
        if word.new and not word.new.endswith(":"):
            edit = replacement(head, word.new)
        else:
            end = problem.tokenized.line_end(line)
            edit = Edit(head.start, end, word.new.ljust(end - head.start))
        message = f"there is no '{head.text}' in URScript"
        return advice_at(head, message, word.hint, edit, exact=word.exact)
    return None


def reserved_word(problem: Problem) -> Advice | None:
    """`end = 3`, `textmsg(run)`: a reserved word as a name."""
    token, before = problem.token, problem.previous
    if token.text == "=" and before.text in words.RESERVED and before.line == token.line:
        word = before
    elif token.text in words.RESERVED and not problem.starts_line and problem.accepts("NAME"):
        word = token
    elif before.text == "run" and before.line == token.line and token.kind == "symbol":
        word = before
    else:
        return None
    message = f"'{word.text}' is a reserved word and cannot be a name"
    hint = f"choose another name, for example my_{word.text}"
    return advice_at(word, message, hint, replacement(word, "_" * len(word.text)), exact=False)


def augmented_assignment(problem: Problem) -> Advice | None:
    """`i += 1`."""
    token, operator = problem.token, problem.previous
    if token.text != "=" or operator.text not in ("+", "-", "*", "/", "%") or operator.end != token.start:
        return None
    variable = problem.neighbor(-2)
    name = variable.text if variable.kind == "word" else "x"
    hint = f"write {name} = {name} {operator.text} ..."
    return absent(f"{operator.text}=", hint, operator, f"= {name} {operator.text}", token)


def assignment_in_expression(problem: Problem) -> Advice | None:
    """`if x = 1:`, `a = b = 1`, `a := 1`, `a === b`."""
    token, before = problem.token, problem.previous
    if token.text != "=":
        return None
    if before.text == ":" or before.text in _COMPARES:
        sign, new = (":=", "=") if before.text == ":" else (f"{before.text}=", before.text)
        return absent(sign, f"write {new}", before, new, token)
    if problem.line_head(token.line)[1].text in _CONDITIONS:
        return advice_at(token, "'=' assigns; it does not compare", "write ==", replacement(token, "=="))
    if problem.accepts("WHILE"):
        message = "an assignment has no value"
        return advice_at(token, message, "write two assignments", replacement(token, "=="))
    return None


def colon_assignment(problem: Problem) -> Advice | None:
    """`a := 1`."""
    token, following = problem.token, problem.following
    if token.text != ":" or following.text != "=" or following.start != token.end:
        return None
    return absent(":=", "write =", token, "=", following)


def comparison_chain(problem: Problem) -> Advice | None:
    """`0 < x < 2`."""
    token, middle = problem.token, problem.previous
    if token.text not in _COMPARES or middle.text in _COMPARES or not problem.accepts("AND"):
        return None
    name = middle.text if middle.kind in ("word", "number") else "x"
    edit = Edit(token.start, token.start, f"and {name} ")
    hint = f"write ... and {name} {token.text} ..."
    return advice_at(token, "comparisons cannot be chained", hint, edit, exact=name == middle.text)


def foreign_operator(problem: Problem) -> Advice | None:
    """`2 ** 3`, `a <> b`, `a => b`."""
    token, before = problem.token, problem.previous
    both = before.text + token.text
    if before.end != token.start or both not in words.OPERATORS:
        return None
    new, hint = words.OPERATORS[both]
    return absent(both, hint, before, new, token)


def word_operator(problem: Problem) -> Advice | None:
    """`x is None`, `1 in x`."""
    token = problem.token
    if problem.starts_line or token.text not in words.WORD_OPERATORS:
        return None
    new, hint = words.WORD_OPERATORS[token.text]
    return absent(token.text, hint, token, new, exact=token.text != "in")


def conditional_expression(problem: Problem) -> Advice | None:
    """`x = 1 if y else 2`."""
    token = problem.token
    if token.text != "else" or problem.starts_line:
        return None
    line, start = problem.tokenized.line(token.line), problem.tokenized.line_start(token.line)
    found = re.search(r"\bif\b", line)
    if found is None or problem.line_head(token.line)[1].text in _CONDITIONS:
        return None
    edit = Edit(start + found.start(), start + len(line), " " * (len(line) - found.start()))
    message, hint = "URScript has no conditional expressions", "write if ...: x = a else: x = b end"
    return Advice(message, hint, start + found.start(), start + found.end(), (edit,))


def lambda_expression(problem: Problem) -> Advice | None:
    """`f = lambda x: x`."""
    start = problem.line_head(problem.token.line)[0]
    for token in problem.tokenized.tokens[start : problem.index]:
        if token.text == "lambda":
            end = problem.tokenized.line_end(token.line)
            edit = Edit(token.start, end, "0".ljust(end - token.start))
            return advice_at(token, "there is no 'lambda' in URScript", "write a def", edit, exact=False)
    return None


def function_head(problem: Problem) -> Advice | None:
    """`def f:`, `def f() -> int:`, `thread t(x):`, `run t(1)`, `run t`."""
    token, before, tokenized = problem.token, problem.previous, problem.tokenized
    line_end = tokenized.line_start(token.line) + len(tokenized.line(token.line).rstrip())
    if token.text == "-" and problem.following.text == ">":
        edit = Edit(token.start, line_end, ":".ljust(line_end - token.start))
        return advice_at(token, "a function has no return type", "remove it", edit, last=problem.following)
    word = problem.neighbor(-2).text
    if token.text in (":", "{") and word in ("def", "thread", "sec"):
        message = "a definition needs parentheses, also without parameters"
        hint = f"write {word} {before.text}():"
        return advice_at(before, message, hint, Edit(before.end, before.end, "()"))
    if word == "run" and token.text != "(" and before.kind == "word":
        message, hint = "'run' needs parentheses after the name", f"write run {before.text}()"
        return advice_at(before, message, hint, Edit(before.end, before.end, "()"))
    head = problem.line_head(token.line)[1].text
    if token.text == ":" and head == "def" and problem.accepts("COMMA", "RPAR"):
        edit = replacement(token, " ", problem.following)
        return advice_at(token, "a parameter has no type", "remove it", edit, last=problem.following)
    if before.text == "(" and problem.neighbor(-3).text in ("thread", "run") and token.text != ")":
        close = tokenized.text.find(")", token.start, line_end)
        edit = Edit(token.start, max(close, token.end), " ")
        hint = "pass values in global variables"
        return advice_at(token, "a thread takes no parameters", hint, edit, exact=False)
    return None


def called_keyword(problem: Problem) -> Advice | None:
    """`halt()`, `kill()`: keywords that are no functions."""
    close, opener, word = problem.token, problem.previous, problem.neighbor(-2)
    if close.text != ")" or opener.text != "(" or word.kind != "word":
        return None
    if word.text in _NEED_THREADS:
        message, hint = f"'{word.text}' needs a thread", f"write {word.text} t, with t = run name()"
        return advice_at(word, message, hint, replacement(opener, "0", close), last=close)
    if word.text not in _ALONE:
        return None
    message, edit = f"'{word.text}' is a statement, not a function", replacement(opener, " ", close)
    return advice_at(word, message, f"write {word.text}", edit, last=close)


def missing_value(problem: Problem) -> Advice | None:
    """`x = ` at the end of a line, `y = 1 +`."""
    token, before = problem.token, problem.previous
    if not problem.accepts("RUN", "NAME") or problem.accepts("WHILE"):
        return None
    if not problem.starts_line and token.text not in words.RESERVED:
        return None
    what = "a value" if problem.accepts("RUN") else "a name"
    message = f"{what} is missing after '{before.text}'"
    return Advice(
        message, None, before.end - 1, before.end, (Edit(before.end, before.end, " 0"),), exact=False
    )


RULES: Final[tuple[Rule, ...]] = (
    quotes, comment, foreign_statement, number, unterminated_string, symbol, pose_elements, colon_assignment,
    lambda_expression, else_if, augmented_assignment, foreign_operator, function_head, called_keyword,
    reserved_word, decimal_comma, trailing_comma, inside_brackets, conditional_expression, unmatched_closer,
    unclosed_bracket, comparison_chain, word_operator, assignment_in_expression, tuples, missing_comma,
    foreign_end, missing_colon, missing_value, extra_end, missing_end,
)  # fmt: skip
"""In order of priority: the first rule that returns an advice is used."""
