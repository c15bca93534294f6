"""Warnings about control flow: busy loops, unchecked reads, unreachable code."""

from collections.abc import Iterator
from typing import Final

from urscript.catalogue import Catalogue
from urscript.check import warnings
from urscript.check.tokens import TokenizedText
from urscript.check.unused import Variable, expressions_read, owner
from urscript.check.warnings import ScriptWarning
from urscript.names.scopes import FunctionScope, ResolvedProgram
from urscript.source import Source, Span
from urscript.syntax import nodes
from urscript.syntax.nodes import Block, Expression, Statement

COUNTED_READS: Final = frozenset(
    {"socket_read_ascii_float", "socket_read_binary_integer", "socket_read_byte_list"}
)
"""Builtins whose list starts with the number of values that came. Source: script manual, interfaces."""


def flow_warnings(program: ResolvedProgram, catalogue: Catalogue) -> Iterator[ScriptWarning]:
    """Everything this module warns about, in no order."""
    for scope in program.scopes():
        yield from _unreachable(scope.body)
        for statement in nodes.all_statements(scope.body):
            if isinstance(statement, nodes.While) and _is_busy(statement, scope, catalogue):
                message = "this loop takes no time and never ends by itself: the controller stops the program"
                place = _head(statement.span, statement.condition)
                yield ScriptWarning(warnings.BUSY_LOOP, message, place, "put a sync() into it")
            elif isinstance(statement, nodes.If):
                yield from _dead_branches(statement)
    yield from _unchecked_reads(program)
    yield from _semicolons(program.source)
    for call in program.calls_after:
        message = f"'{program.name}' runs when it is defined; this call is a program of its own and fails"
        yield ScriptWarning(warnings.CALL_OF_PROGRAM, message, call.span, "leave it out")


def _semicolons(source: Source) -> Iterator[ScriptWarning]:
    text = TokenizedText(source.text)
    for token in text.tokens if ";" in source.text else ():
        if token.text == ";":
            line, column = text.place(token.start)
            place = Span(line, column, line, column + 1)
            message, hint = "no manual has a ';'", "leave it out"
            yield ScriptWarning(warnings.IN_NO_MANUAL, message, place, hint)


def constant_truth(expression: Expression) -> bool | None:
    """The value of a constant condition; None if it is not evidently constant."""
    match expression:
        case nodes.BoolLiteral(value=truth):
            return truth
        case nodes.StringLiteral(value=text):
            return text != ""
        case nodes.UnaryOperation(operator="not", operand=operand):
            inner = constant_truth(operand)
            return None if inner is None else not inner
        case nodes.BinaryOperation(operator="==", left=left, right=right) if isinstance(left, _LITERALS):
            return left == right if type(left) is type(right) else None
        case nodes.BinaryOperation(operator="or", left=left, right=right):
            return True if True in (constant_truth(left), constant_truth(right)) else None
    return None


_LITERALS = (nodes.IntLiteral, nodes.BoolLiteral, nodes.StringLiteral)


def _head(span: Span, condition: Expression) -> Span:
    """From the keyword of a loop or branch to the end of its condition."""
    return span._replace(end_line=condition.span.end_line, end_column=condition.span.end_column)


# --- busy loops ------------------------------------------------------------------------------------------


def _is_busy(loop: nodes.While, scope: FunctionScope, catalogue: Catalogue) -> bool:
    """Whether the loop, from its second iteration on, never ends and never lets a cycle pass."""
    statements = list(nodes.all_statements(loop.body))
    expressions = [loop.condition, *(item for each in statements for item in nodes.own_expressions(each))]
    parts = [part for expression in expressions for part in nodes.all_expressions(expression)]
    if any(isinstance(item, nodes.Join) or _is_pause(item) for item in statements):
        return False
    if any(_takes_time(part, scope, catalogue) for part in parts):
        return False
    truth = constant_truth(loop.condition)
    if truth is False:
        return False
    if truth and not _can_leave(loop.body):
        return True
    changes = any(isinstance(item, (nodes.Assign, nodes.Kill)) for item in statements)
    leaves_at_once = any(map(_end_of, loop.body))
    has_effect = any(_has_effect(part, scope, catalogue) for part in parts)
    return not (changes or leaves_at_once or has_effect)


def _is_pause(statement: Statement) -> bool:
    return isinstance(statement, nodes.ExpressionStatement) and statement.value == nodes.Name("pause")


def _takes_time(part: Expression, scope: FunctionScope, catalogue: Catalogue) -> bool:
    if isinstance(part, nodes.Call):
        callee = scope.find_function(part.function)
        if callee is not None:
            return callee.blocks
        builtin = catalogue.lookup(part.function)
        return builtin is None or builtin.may_wait
    return isinstance(part, nodes.MethodCall)


def _has_effect(part: Expression, scope: FunctionScope, catalogue: Catalogue) -> bool:
    """Whether a second evaluation in the same cycle may give another result."""
    if isinstance(part, nodes.Call):
        builtin = None if scope.find_function(part.function) else catalogue.lookup(part.function)
        return builtin is None or builtin.returns == "None" or builtin.name == "random"
    return isinstance(part, nodes.RunThread)


def _can_leave(block: Block, in_loop: bool = False) -> bool:
    """Whether a statement in `block` ends the loop around it, or the function, or the program."""
    for statement in block:
        match statement:
            case nodes.Return() | nodes.KeywordStatement(keyword="halt"):
                return True
            case nodes.KeywordStatement(keyword="break") if not in_loop:
                return True
        inside = in_loop or isinstance(statement, nodes.While)
        if any(_can_leave(inner, inside) for inner in nodes.own_blocks(statement)):
            return True
    return False


# --- unreachable code ------------------------------------------------------------------------------------


def _unreachable(block: Block) -> Iterator[ScriptWarning]:
    """The first unreachable statement of each block; definitions and labels are allowed anywhere."""
    ended_by = ""
    for statement in block:
        if ended_by and not isinstance(statement, (nodes.Function, nodes.Label, nodes.Declaration)):
            message = f"unreachable code: it follows {ended_by}"
            yield ScriptWarning(warnings.UNREACHABLE, message, _first_line(statement))
            break
        ended_by = ended_by or _end_of(statement)
    for statement in block:
        for inner in nodes.own_blocks(statement):
            yield from _unreachable(inner)


def _end_of(statement: Statement) -> str:
    """Why control never passes `statement`, in words; empty if it may."""
    match statement:
        case nodes.Return():
            return "return"
        case nodes.KeywordStatement(keyword="halt" | "break" | "continue" as word):
            return word
        case nodes.While(condition=condition, body=body):
            endless = constant_truth(condition) is True and not _breaks(body)
            return "an endless loop" if endless else ""
        case nodes.If(branches=branches, else_body=else_body) if else_body is not None:
            blocks = [*(branch.body for branch in branches), else_body]
            all_end = all(any(_end_of(inner) for inner in block) for block in blocks)
            return "an if whose branches all leave" if all_end else ""
    return ""


def _breaks(block: Block) -> bool:
    """Whether a `break` in `block` ends the loop around it."""
    return any(
        statement == nodes.KeywordStatement("break")
        or (isinstance(statement, nodes.If) and any(map(_breaks, nodes.own_blocks(statement))))
        for statement in block
    )


def _first_line(statement: Statement) -> Span:
    """The statement, or its head if it is a block."""
    match statement:
        case nodes.While(condition=condition):
            return _head(statement.span, condition)
        case nodes.If(branches=branches):
            return _head(statement.span, branches[0].condition)
    return statement.span


def _dead_branches(statement: nodes.If) -> Iterator[ScriptWarning]:
    earlier: list[nodes.Branch] = []
    for branch in statement.branches:
        always = next((other for other in earlier if constant_truth(other.condition) is True), None)
        same = next((other for other in earlier if _is_same(other.condition, branch.condition)), None)
        if always or same:
            line = (always or same or branch).span.line
            why = f"the condition of line {line} is {'always true' if always else 'the same'}"
            yield _dead(branch.span, why)
        earlier.append(branch)
    last = earlier[-1]
    if statement.else_body and constant_truth(last.condition) is True:
        why = f"the condition of line {last.span.line} is always true"
        yield _dead(_first_line(statement.else_body[0]), why)


def _dead(place: Span, why: str) -> ScriptWarning:
    return ScriptWarning(warnings.DEAD_BRANCH, f"this branch is never reached: {why}", place)


def _is_same(first: Expression, second: Expression) -> bool:
    """Whether two conditions read the same values; a call may give another value the second time."""
    calls = (nodes.Call, nodes.MethodCall, nodes.RunThread)
    return first == second and not any(isinstance(part, calls) for part in nodes.all_expressions(first))


# --- socket reads ----------------------------------------------------------------------------------------


def _unchecked_reads(program: ResolvedProgram) -> Iterator[ScriptWarning]:
    """Reads whose values are used without reading element 0 or the list as a whole."""
    numbers_used: set[Variable] = set()
    checked: set[Variable] = set()
    indexed: set[int] = set()
    for scope, part in expressions_read(program):
        match part:
            case nodes.Subscript(target=nodes.Name(name=name) as target, indices=indices):
                is_count = indices == (nodes.IntLiteral(0),)
                (checked if is_count else numbers_used).add(owner(name, scope))
                indexed.add(id(target))
            case nodes.Name(name=name) if id(part) not in indexed:
                checked.add(owner(name, scope))
            case nodes.Subscript(target=nodes.Call() as call, indices=indices) if _is_read(
                call, scope
            ) and indices != (nodes.IntLiteral(0),):
                yield _unchecked(call, "its count")
    for scope in program.scopes():
        for statement in nodes.all_statements(scope.body):
            match statement:
                case nodes.Assign(target=nodes.Name(name=name), value=nodes.Call() as call):
                    variable = owner(name, scope, statement.scope)
                    if _is_read(call, scope) and variable in numbers_used - checked:
                        yield _unchecked(call, f"{name}[0]")


def _is_read(call: nodes.Call, scope: FunctionScope) -> bool:
    return call.function in COUNTED_READS and scope.find_function(call.function) is None


def _unchecked(call: nodes.Call, what: str) -> ScriptWarning:
    message = f"the number of received values is never checked: {what} is not read"
    hint = "after a timeout it is 0 and the values are invalid"
    return ScriptWarning(warnings.UNCHECKED_READ, message, call.span, hint)
