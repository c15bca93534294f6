"""XML-RPC: calls that the standard library reads, answers that it writes, and answers of nobody's making."""

import encodings
import xmlrpc.client
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.xmlrpc import DEEPEST, AnswerReader, CallReader, RemoteFaultError, encode_call

TEXTS = st.text(
    st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"], exclude_characters="\ufffe\uffff")
)
SCALARS = st.one_of(
    st.integers(-(2**31), 2**31 - 1), st.floats(allow_nan=False, allow_infinity=False), st.booleans(), TEXTS
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=12,
)
TAGS = (
    "methodResponse", "params", "param", "value", "int", "i4", "i8", "double", "boolean", "string", "nil",
    "array", "data", "struct", "member", "name", "fault", "dateTime.iso8601", "base64", "other",
)  # fmt: skip
ODD = st.lists(
    st.one_of(
        st.sampled_from(TAGS).flatmap(lambda tag: st.sampled_from([f"<{tag}>", f"</{tag}>", f"<{tag}/>"])),
        st.sampled_from(
            ["1", "-7.5", "x", "faultCode", "faultString", " ", "&lt;", "&x;", "<!--", "]]>", "<?xml"]
        ),
    ),
    max_size=30,
).map(lambda parts: "".join(parts).encode())


def read(*pieces, most=10_000):
    reader = AnswerReader(most)
    for piece in pieces:
        reader.feed(piece)
    return reader.result()


def answer(inside):
    text = f"<methodResponse><params><param><value>{inside}</value></param></params></methodResponse>"
    return text.encode()


@given(VALUES, st.integers(1, 50))
def test_answers_of_the_standard_library(value, size):
    data = xmlrpc.client.dumps((value,), methodresponse=True).encode()
    assert read(*(data[i : i + size] for i in range(0, len(data), size))) == value


@given(st.lists(VALUES, max_size=4), st.integers(1, 50))
def test_calls_are_read_whole_and_in_pieces_and_not_with_others_behind_them(arguments, size):
    assert xmlrpc.client.loads(encode_call("work", arguments)) == (tuple(arguments), "work")
    for data in (encode_call("work", arguments), xmlrpc.client.dumps(tuple(arguments), "work").encode()):
        reader = CallReader(10_000)
        for i in range(0, len(data), size):
            reader.feed(data[i : i + size])
        assert reader.result() == ("work", arguments)
        with pytest.raises(RemoteProtocolError, match="the call is not XML"):
            CallReader(10_000).feed(data + data)


@pytest.mark.parametrize("text", ["a\0", "\x1b[2J", "\ud800", "\uffff"])
def test_a_text_that_xml_does_not_have_is_not_sent(text):
    with pytest.raises(LocalProtocolError, match="cannot be sent"):
        encode_call("work", [[text]])


def test_a_fault():
    with pytest.raises(RemoteFaultError, match="no paper"):
        read(xmlrpc.client.dumps(xmlrpc.client.Fault(3, "no paper")).encode())


@pytest.mark.parametrize("data", [b"<methodResponse><params/></methodResponse>", answer("<nil/>")])
def test_what_has_no_value_is_none(data):
    assert read(data) is None


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"abc",
        b"<methodResponse/>",
        b"<methodResponse><fault/></methodResponse>",
        b"<methodResponse><fault><value/><value/></fault></methodResponse>",
        b"<methodResponse><params/><params/></methodResponse>",
        b"<methodResponse><params><param/></params></methodResponse>",
        b"<methodCall/>",
        b"<!DOCTYPE a [<!ENTITY b 'c'>]><methodResponse/>",
        b"\x1f\x8b\x08\0\0\0\0\0",
        answer("<int>1</int><int>2</int>"),
        answer("<int>one</int>"),
        answer(f"<i8>{'1' * 5000}</i8>"),
        answer("<boolean>2</boolean>"),
        answer("<nil>1</nil>"),
        answer("<base64>AA==</base64>"),
        answer("<dateTime.iso8601>20260101T00:00:00</dateTime.iso8601>"),
        answer("<struct><member><name>a</name></member></struct>"),
        answer("<struct><member><value/><name>a</name></member></struct>"),
        answer("<struct><member><value><int>1</int></value><value/></member></struct>"),
        answer("<array><value/></array>"),
        answer("<array/>"),
        b"<methodResponse><params><param>" + b"<value><array><data>" * 10_000,
    ],
    ids=lambda data: data[:60].decode("latin-1"),
)
def test_what_is_no_answer(data):
    with pytest.raises(RemoteProtocolError, match="the answer"):
        read(data)


def test_depth_and_number_of_values_are_bounded():
    fits = (DEEPEST - 4) // 3
    for depth in (fits, fits + 1):
        text = "<array><data><value>" * depth + "</value></data></array>" * depth
        if depth == fits:
            assert read(answer(text))
        else:
            with pytest.raises(RemoteProtocolError, match="inside each other"):
                read(answer(text))
    many = answer("<array><data>" + "<value/>" * 9 + "</data></array>")
    assert read(many, most=10) == [""] * 9
    with pytest.raises(RemoteProtocolError, match="too many values"):
        read(many, most=9)


@pytest.mark.parametrize("name", ["UTF-8", "us-ascii", "iso-8859-1", "UTF-16"])
def test_encodings_of_the_parser_are_read(name):
    data = f"<?xml version='1.0' encoding='{name}'?>{answer('a').decode()}".encode(name)
    assert read(data) == read(*(data[i : i + 1] for i in range(len(data)))) == "a"


def test_names_of_other_encodings_are_not_kept():
    kept = len(encodings._cache)
    for name in ("cp037", "rot13", "of-nobody"):
        with pytest.raises(RemoteProtocolError, match=f"encoding {name}: use utf-8"):
            read(f"<?xml version='1.0' encoding='{name}'?><methodResponse/>".encode())
    assert len(encodings._cache) == kept


@given(st.one_of(ODD, ODD.map(lambda data: answer(data.decode())), st.binary(max_size=200)))
def test_odd_answers_have_a_value_or_one_of_two_errors(data):
    with suppress(RemoteProtocolError, RemoteFaultError):
        read(data)
