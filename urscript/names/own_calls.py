"""Calls of a program's own functions: whether the arguments fit the parameters.

A wrong number of them is an error when the call is reached, not before: working programs of 3.15.8 have such
calls. A wrong name is an error of the compiler.
"""

from __future__ import annotations

from urscript.catalogue.binding import CallSignature
from urscript.errors import ScriptTypeError
from urscript.names.scopes import FunctionScope
from urscript.syntax import nodes


def shape_of(arguments: tuple[nodes.Argument, ...]) -> tuple[int, tuple[str, ...]]:
    """Number of positional arguments, names of the named ones."""
    keywords = tuple(argument.name for argument in arguments if argument.name is not None)
    return len(arguments) - len(keywords), keywords


def signature_of(callee: FunctionScope) -> CallSignature:
    """Return the signature of a function of the program."""
    assert callee.node is not None
    names = [parameter.name for parameter in callee.node.parameters]
    optional = {parameter.name for parameter in callee.node.parameters if parameter.default is not None}
    return CallSignature(callee.node.name, names, optional)


def wrong_count(call: nodes.Call, callee: FunctionScope) -> str:
    """Return why a call has too many or too few arguments; an empty text if they fit."""
    try:
        signature_of(callee).check(*shape_of(call.arguments))
    except ScriptTypeError as error:
        return error.message
    return ""
