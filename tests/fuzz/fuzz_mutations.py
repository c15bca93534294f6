"""What is done to valid bytes and files: to any bytes, and along the structure of XML, TOML, MCAP and ZIP.

Everything follows from the generator of random numbers that is given.
"""

import gzip
import io
import re
import struct
import zipfile
import zlib
from itertools import pairwise
from xml.etree import ElementTree

from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC as MAGIC

_LENGTHS = (
    0,
    1,
    2,
    3,
    5,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0x8000,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    2**64 - 1,
)
_TEXTS = ("", "0", "-1", "1e999", "nan", "True", "9" * 400, "1, 2, 3", "x" * 5000, "../../evil", "/etc/passwd", "../" * 50,
          '"', "\n", "\x85", "\u202e", "end\ndef x():\n", "HI", "é", "[[[[", "9223372036854775808", "\N{ARABIC-INDIC DIGIT THREE}")  # fmt: skip
_TOML_VALUES = ("nan", "inf", "-inf", "1e308", "5e-324", "-1", "0", "9" * 5000, '""', '"x"', "[]", "{}", "[[1]]", "[1, 2, 3]",
                "true", "1979-05-27", '"\\u0000"', '"../../evil"', "[" * 300 + "]" * 300, "[" + "0.1," * 2000 + "]", "1e-300")  # fmt: skip
_NUMBERS = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, 0.0, -1.0)
_MEMBERS = ("../../evil", "/evil", "a/" * 200 + "b", "é\x01")
_DEPTHS = (3, 40, 300, 3000)
_RECORD = struct.Struct("<BQ")
_CHUNK_HEAD = 9 + 40  # of a chunk that is not compressed
_CRC_PLACE = 9 + 24  # in a chunk record: opcode, length, two times, size


def mutate_bytes(rng, data, others=lambda: b""):
    """Return data with something wrong with it; `others` makes another message."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        if not data:
            break
        at = rng.randrange(len(data))
        match rng.randrange(11):
            case 0:
                data[at] ^= 1 << rng.randrange(8)
            case 1:
                del data[at:]
            case 2:
                data[at:at] = data[at : at + rng.randrange(1, 40)]
            case 3:
                data[at:at] = rng.randbytes(rng.randrange(1, 20))
            case 4:
                del data[at : at + rng.randrange(1, 10)]
            case 5:
                size = rng.choice((2, 4))
                place = rng.choice((0, 2, 4, at))
                data[place : place + size] = (rng.choice(_LENGTHS) & (256**size - 1)).to_bytes(size, "big")
            case 6:
                data[min(rng.choice((2, 7, at)), len(data) - 1)] = rng.randrange(256)
            case 7:
                data = data[at:] + data[:at]
            case 8:
                data += data * rng.choice((1, 1, 2, 30)) if len(data) < 2000 else b""
            case 9:
                data[at:at] = others()
            case 10:
                data = data.replace(b"\n", rng.choice((b"\r", b"", b"\n\n", b"\0")))
    return bytes(data)


def mutate_xml(rng, data):
    """Return an XML text in which elements and attributes have changed, sometimes bytes too."""
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError:
        return mutate_bytes(rng, data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        _change_element(rng, root)
    text = ElementTree.tostring(root, "utf-8")
    kind = rng.random()
    if kind < 0.1:
        text = _nest(rng, text)
    elif kind < 0.14:
        text = b'<!DOCTYPE x [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>' + text.replace(b">", b">&b;", 1)
    elif kind < 0.18:
        encoding = rng.choice(("utf-16", "utf-7", "cp037", "idna", "unknown", "latin-1"))
        text = f'<?xml version="1.0" encoding="{encoding}"?>'.encode() + text
    return mutate_bytes(rng, text) if rng.random() < 0.2 else text


def _change_element(rng, root):
    elements = list(root.iter())
    element, other = rng.choice(elements), rng.choice(elements)
    match rng.randrange(9):
        case 0 if len(element):
            element.remove(rng.choice(list(element)))
        case 1 if element is not other and other not in element.iter() and element not in other.iter():
            element.append(other)
        case 2 if len(element):
            copies = min(rng.choice((1, 5, 300)), 3000 // len(list(element.iter())))
            element.extend([rng.choice(list(element))] * copies)
        case 3:
            element.tag = other.tag
        case 4 | 5 if element.attrib:
            name = rng.choice(list(element.attrib))
            element.set(name, rng.choice((*_TEXTS, *other.attrib.values())))
        case 6 if element.attrib:
            del element.attrib[rng.choice(list(element.attrib))]
        case 7:
            element.text = rng.choice(_TEXTS)
        case _:
            steps = rng.choices(("..", "..", other.tag, f"{other.tag}[2]", ".", ""), k=rng.randrange(1, 6))
            element.set("reference", "/".join(steps))


def _nest(rng, text):
    """Put what is within an element into many of its kind."""
    names = re.findall(rb"</(\w+)>", text)
    if not names:
        return text
    name, depth = rng.choice(names), rng.choice(_DEPTHS)
    begin, end = b"<%s>" % name, b"</%s>" % name
    first = re.search(rb"<%s[ >]" % name, text)
    head, tail = text[: first.start()], text[first.start() :]
    inside, _, rest = tail.rpartition(end)
    return head + begin * depth + inside + end * (depth + 1) + rest


def mutate_packed_xml(rng, data):
    """Return a gzip file (or the XML without gzip) in which the XML, or the packing, has changed."""
    text = mutate_xml(rng, gzip.decompress(data))
    kind = rng.random()
    if kind < 0.15:
        return text
    packed = gzip.compress(text, 1, mtime=0)
    if kind < 0.25:
        packed = mutate_bytes(rng, packed)
    return packed + gzip.compress(text, 1, mtime=0) if kind > 0.97 else packed


def mutate_toml(rng, data):
    """Return a TOML text in which values, lines or bytes have changed."""
    if rng.random() < 0.25:
        return mutate_bytes(rng, data)
    lines = data.decode().split("\n")
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(lines))
        key, has_value, value = lines[at].partition("=")
        match rng.randrange(6):
            case 0 | 1 | 2:
                places = [k for k, line in enumerate(lines) if "=" in line] or [at]
                at = rng.choice(places)
                lines[at] = f"{lines[at].partition('=')[0]}= {rng.choice(_TOML_VALUES)}"
            case 3 if has_value:
                numbers = list(re.finditer(r"[-\d.]+(e-?\d+)?", value))
                if numbers:
                    one = rng.choice(numbers)
                    value = value[: one.start()] + rng.choice(_TOML_VALUES) + value[one.end() :]
                lines[at] = f"{key}={value}"
            case 4:
                del lines[at]
                lines = lines or [""]
            case _:
                lines.insert(rng.randrange(len(lines)), lines[at])
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def mutate_table(rng, data):
    """Return a table of numbers in which values, lines or bytes have changed."""
    if rng.random() < 0.3:
        return mutate_bytes(rng, data)
    lines = data.decode().split("\n")
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(lines))
        cells = lines[at].split(",")
        cells[rng.randrange(len(cells))] = rng.choice((*_TEXTS, *map(repr, _NUMBERS), "5", "1.0"))
        lines[at] = rng.choice((",", ",", ",", ";", "\t", " ")).join(cells)
        if rng.random() < 0.2:
            lines[at:at] = lines[at : at + rng.randrange(1, 30)]
    return "\n".join(lines).encode()


def mutate_mcap(rng, data):
    """Return a recording in which records, their lengths, texts or numbers have changed."""
    if rng.random() < 0.15:
        return mutate_bytes(rng, data)
    records = [bytearray(record) for record in _records(data)]
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(records)) if rng.random() < 0.4 else rng.randrange(min(8, len(records)))
        record = records[at]
        match rng.randrange(8):
            case 0:
                del records[at]
                if not records:
                    return MAGIC
            case 1:
                records.insert(rng.randrange(len(records)), bytearray(record))
            case 2:
                record[1:9] = (rng.choice(_LENGTHS)).to_bytes(8, "little")
            case 3 if len(record) > 20:
                size = rng.choice((2, 4, 8))
                place, value = rng.randrange(9, len(record) - size), rng.choice(_LENGTHS) % 256**size
                record[place : place + size] = value.to_bytes(size, "little")
            case 4 if len(record) > 9:
                record[:] = _with_length(record[:1], mutate_bytes(rng, bytes(record[9:])))
            case 5:
                _change_text(rng, record)
            case _:
                _change_rows(rng, rng.choice(records))
    return MAGIC + b"".join(records) + MAGIC


def _records(data):
    at = len(MAGIC)
    while at + _RECORD.size <= len(data) - len(MAGIC):
        end = at + _RECORD.size + _RECORD.unpack_from(data, at)[1]
        yield data[at:end]
        at = end


def _with_length(opcode, body):
    return opcode + len(body).to_bytes(8, "little") + body


def _change_text(rng, record):
    """Change a number or a name in a schema or in the JSON texts of metadata; lengths follow."""
    texts = list(re.finditer(rb"\d+(?:\.\d+)?|true|[a-z_]{4,}", record[9:]))
    if not texts:
        return
    one = rng.choice(texts)
    texts = *_TOML_VALUES, *_TEXTS, "NaN", "[[1, 2]]", "null", '{"a": 1}'
    new = rng.choice(texts).encode("utf-8", "replace")
    start, end = one.start() + 9, one.end() + 9
    for place in range(max(9, start - 400), start - 3):  # the length of the text around it
        size = int.from_bytes(record[place : place + 4], "little")
        if place + 4 <= start and end <= place + 4 + size <= place + 4000:
            record[place : place + 4] = (size + len(new) - (end - start)).to_bytes(4, "little")
            break
    record[start:end] = new
    record[:] = _with_length(record[:1], record[9:])


def _change_rows(rng, record):
    """Change numbers in the rows of a chunk; the checksum follows, or is switched off."""
    if record[0] != Opcode.CHUNK or len(record) < _CHUNK_HEAD + 16:
        return
    for _ in range(rng.choice((1, 3, 20))):
        place = rng.randrange(_CHUNK_HEAD, len(record) - 8)
        value = struct.pack("<d", rng.choice(_NUMBERS)) if rng.random() < 0.8 else rng.randbytes(8)
        record[place : place + 8] = value
    crc = zlib.crc32(record[_CHUNK_HEAD:]) if rng.random() < 0.8 else 0
    record[_CRC_PLACE : _CRC_PLACE + 4] = crc.to_bytes(4, "little")


def mutate_zip(rng, data):
    """Return an archive whose members, names, sizes or bytes have changed."""
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as source, zipfile.ZipFile(packed, "w") as made:
        for number, info in enumerate(source.infolist()):
            content = source.read(info)
            if rng.random() < 0.4:
                content = mutate_table(rng, content)
            name = info.filename
            if rng.random() < 0.2:
                name = f"{rng.choice(_MEMBERS)}{number}.csv"
            methods = zipfile.ZIP_STORED, *[zipfile.ZIP_DEFLATED] * 5, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA
            method = rng.choice(methods)
            if rng.random() < 0.05:
                content, method = bytes(rng.choice((0, 1 << 16, 9 << 20))), zipfile.ZIP_DEFLATED
            made.writestr(zipfile.ZipInfo(name), content, method, compresslevel=1)
    changed = bytearray(packed.getvalue())
    if rng.random() < 0.5:
        for _ in range(rng.randrange(1, 5)):  # in the directory, where a byte means most
            place = rng.randrange(max(0, len(changed) - 200), len(changed))
            changed[place] = rng.choice((0, 1, 0x7F, 0xFF, rng.randrange(256)))
    return mutate_bytes(rng, bytes(changed)) if rng.random() < 0.2 else bytes(changed)


def mutate_http(rng, data):
    """Return an HTTP response whose head or XML body has changed."""
    head, _, body = data.partition(b"\r\n\r\n")
    if rng.random() < 0.8:
        body = mutate_xml(rng, body)
    lines = [*head.split(b"\r\n")[:1], b"Content-Type: text/xml"]
    size = len(body)
    if rng.random() < 0.15:
        body = gzip.compress(body, 1, mtime=0)
        body = mutate_bytes(rng, body) if rng.random() < 0.5 else body
        size = len(body)
        lines.append(b"Content-Encoding: gzip")
    kind = rng.random()
    if kind < 0.1:
        lines.append(b"Transfer-Encoding: chunked")
        cuts = sorted({0, len(body), *(rng.randrange(len(body) + 1) for _ in range(2))})
        chunks = [body[a:b] for a, b in pairwise(cuts)]
        body = b"".join(b"%x\r\n%s\r\n" % (len(chunk), chunk) for chunk in chunks) + b"0\r\n\r\n"
    elif kind < 0.2:
        lines.append(b"Content-Length: %d" % rng.choice((0, 1, size - 1, size + 1, 10**20)))
    elif kind < 0.25:
        lines.append(b"Content-Length: -1")
    elif kind > 0.3:
        lines.append(b"Content-Length: %d" % size)
    if rng.random() < 0.1:
        lines[0] = rng.choice((b"HTTP/1.1 500 no", b"HTTP/1.0 302 go", b"HTTP/1.1 100 Continue", b"HTTP/9 200 OK", b"x", b"HTTP/1.1 200",
                               b"HTTP/1.1 204 \xff\x1b[2J"))  # fmt: skip
    if rng.random() < 0.05:
        lines += [b"X: " + b"y" * rng.choice((100, 70_000))] * rng.choice((1, 150))
    whole = b"\r\n".join(lines) + b"\r\n\r\n" + body
    return mutate_bytes(rng, whole) if rng.random() < 0.15 else whole
