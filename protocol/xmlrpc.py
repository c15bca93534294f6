"""XML-RPC: calls as bytes, and calls and answers read piece by piece.

    call:    <methodCall> <methodName> <params> <param> <value> ...
    answer:  <methodResponse> <params> <param> <value> ... or <methodResponse> <fault> <value> <struct> ...

| type                   | value                        |
|------------------------|------------------------------|
| int, i4, i8            | int                          |
| double                 | float                        |
| boolean                | bool                         |
| string, no type at all | str                          |
| array                  | list                         |
| struct                 | dict                         |
| nil                    | None, only read              |

dateTime.iso8601 and base64 are refused: no value of a robot's program is one. The standard library's
`xmlrpc.client` takes these and document types, bounds neither the depth nor the number of values, and imports
HTTP and sockets; tests have it at the other end.
Source: xmlrpc.com, XML-RPC specification; i8 and nil: extensions of Apache's library.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NoReturn
from xml.parsers.expat import ExpatError, ParserCreate

from protocol.errors import LocalProtocolError, RemoteProtocolError

__all__ = ["AnswerReader", "CallReader", "RemoteFaultError", "encode_call"]

DEEPEST: Final = 32
"""Elements inside each other; an array of arrays has eleven."""

_ENCODINGS: Final = ("utf-8", "us-ascii", "iso-8859-1", "utf-16")
"""Those of the parser itself; it looks for others in Python, which keeps the names that it has not found."""

_ESCAPED: Final = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "\r": "&#13;"})
_NO_XML: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class RemoteFaultError(Exception):
    """The answer is a fault; the text is the server's."""


def encode_call(method: str, arguments: Sequence[Any]) -> bytes:
    """Return the body of a call; arguments are int, float, bool, str, lists and dicts of them.

    Raises:
        LocalProtocolError: a text has a character that XML has not.
    """
    params = "".join(f"<param>{_value(argument)}</param>" for argument in arguments)
    call = f"<methodName>{_text(method)}</methodName><params>{params}</params>"
    return f"<?xml version='1.0'?>\n<methodCall>{call}</methodCall>\n".encode()


def _value(value: Any) -> str:
    match value:
        case bool():
            return f"<value><boolean>{value:d}</boolean></value>"
        case int():
            return f"<value><int>{value}</int></value>"
        case float():
            return f"<value><double>{value!r}</double></value>"
        case str():
            return f"<value><string>{_text(value)}</string></value>"
        case Mapping():
            members = (f"<member><name>{_text(name)}</name>{_value(v)}</member>" for name, v in value.items())
            return f"<value><struct>{''.join(members)}</struct></value>"
        case _:
            return f"<value><array><data>{''.join(map(_value, value))}</data></array></value>"


def _text(text: str) -> str:
    wrong = _NO_XML.search(text)
    if wrong is not None:
        raise LocalProtocolError(
            f"a text with character {ord(wrong[0])} cannot be sent: XML does not have it"
        )
    return text.translate(_ESCAPED)


# --- reading


def _boolean(text: str) -> bool:
    if text not in ("0", "1"):
        raise ValueError
    return text == "1"


def _none(text: str) -> None:
    if text:
        raise ValueError


_SCALARS: Final[Mapping[str, Callable[[str], Any]]] = {
    "int": int,
    "i4": int,
    "i8": int,
    "double": float,
    "boolean": _boolean,
    "nil": _none,
}
_CONTENT: Final[Mapping[str, frozenset[str]]] = {
    "methodCall": frozenset({"methodName", "params"}),
    "methodResponse": frozenset({"params", "fault"}),
    "params": frozenset({"param"}),
    "param": frozenset({"value"}),
    "fault": frozenset({"value"}),
    "value": frozenset({*_SCALARS, "string", "array", "struct"}),
    "array": frozenset({"data"}),
    "data": frozenset({"value"}),
    "struct": frozenset({"member"}),
    "member": frozenset({"name", "value"}),
}
"""Element -> elements that may stand in it; those that are not listed have text only."""


class _Element:
    """An element that has begun: its name, its text, and the values of the elements in it."""

    __slots__ = ("name", "text", "values")

    def __init__(self, name: str) -> None:
        self.name = name
        self.text: list[str] = []
        self.values: list[Any] = []


class _Name(str):
    """Text of a <name> or <methodName>, which is not a value."""

    __slots__ = ()


class AnswerReader:
    """Reads an answer as it comes; it may have `most_values` values, arrays and structs included."""

    _what, _root = "the answer", "methodResponse"

    def __init__(self, most_values: int) -> None:
        self._values_left = most_values
        self._open = [_Element("")]
        self._parser = ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._data
        self._parser.XmlDeclHandler = self._declaration
        self._parser.StartDoctypeDeclHandler = self._doctype

    def feed(self, data: bytes) -> None:
        """Take a piece of the body.

        Raises:
            RemoteProtocolError: this is not an answer.
        """
        self._parse(data, False)

    def result(self) -> Any:
        """Return the value of the answer, None if it has none; the whole body has been fed.

        Raises:
            RemoteFaultError: the server reports a fault.
            RemoteProtocolError: this is not an answer.
        """
        self._parse(b"", True)
        return self._open[0].values[0]

    def _parse(self, data: bytes, is_end: bool) -> None:
        try:
            self._parser.Parse(data, is_end)
        except ExpatError as error:
            raise RemoteProtocolError(f"{self._what} is not XML: {error}") from None

    def _declaration(self, _version: str, encoding: str | None, _standalone: int) -> None:
        if encoding is not None and encoding.lower() not in _ENCODINGS:
            raise RemoteProtocolError(f"{self._what} has encoding {encoding[:40]}: use {_ENCODINGS[0]}")

    def _doctype(self, *_: object) -> NoReturn:
        raise RemoteProtocolError(f"{self._what} has a document type, which XML-RPC does not know")

    def _start(self, name: str, attributes: Mapping[str, str]) -> None:
        inside = self._open[-1].name
        if name not in (_CONTENT.get(inside, ()) if inside else (self._root,)):
            raise RemoteProtocolError(f"{self._what} has <{name[:40]}> inside <{inside or 'nothing'}>")
        if len(self._open) > DEEPEST:
            raise RemoteProtocolError(f"{self._what} has more than {DEEPEST} elements inside each other")
        if name == "value":
            self._values_left -= 1
            if self._values_left < 0:
                raise RemoteProtocolError(f"{self._what} has too many values")
        self._open.append(_Element(name))

    def _data(self, text: str) -> None:
        if self._open[-1].name not in _CONTENT or self._open[-1].name == "value":
            self._open[-1].text.append(text)

    def _end(self, name: str) -> None:
        element = self._open.pop()
        try:
            value = _value_of(element)
        except ValueError:
            text = "".join(element.text)[:40]
            raise RemoteProtocolError(f"{self._what} has a <{name}> that is not valid: {text!r}") from None
        self._open[-1].values.append(value)


class CallReader(AnswerReader):
    """Reads a call in the same way; `result` returns the method and its arguments."""

    _what, _root = "the call", "methodCall"


def _value_of(element: _Element) -> Any:
    """Return the value of an element that is complete; ValueError if what is in it has none."""
    name, values = element.name, element.values
    if name in _SCALARS:
        return _SCALARS[name]("".join(element.text).strip())
    if name in ("name", "methodName"):
        return _Name("".join(element.text))
    if name == "string" or (name == "value" and not values):
        return "".join(element.text)
    if name in ("data", "params"):
        return values
    if name == "member":
        key, value = _exactly(2, values)
        if type(key) is not _Name or type(value) is _Name:
            raise ValueError
        return str(key), value
    if name == "struct":
        return dict(values)
    if name == "methodCall":
        method, arguments = values if len(values) > 1 else (*values, [])
        if type(method) is not _Name or type(arguments) is not list:
            raise ValueError
        return str(method), arguments
    value = _exactly(1, values)[0]
    if name == "methodResponse":
        return _exactly(1, value)[0] if value else None
    if name == "fault":
        text = value.get("faultString") if isinstance(value, dict) else None
        raise RemoteFaultError(text if type(text) is str else "a fault without a text")
    return value


def _exactly(number: int, values: list[Any]) -> list[Any]:
    if len(values) != number:
        raise ValueError
    return values
