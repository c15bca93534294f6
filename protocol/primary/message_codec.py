"""Bytes of robot messages: reads and writes the records of `primary.messages` by their tables."""

from __future__ import annotations

import struct
from datetime import datetime

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.primary.messages import MESSAGES, RobotMessage, UnknownMessage, VersionMessage
from protocol.ur_types import SoftwareVersion
from protocol.wire_codec import codec_for
from protocol.wire_record import OLDEST, since

__all__ = ["decode_message", "encode_message", "version_message"]

# First software whose version message has the third number, and the first with the new form of the date.
_THIRD_NUMBER = since((3, 3))
_NEW_FORM = SoftwareVersion(3, 10)
_BY_TYPE = {message.MESSAGE_TYPE: message for message in MESSAGES}
_HEADER = struct.Struct(">QbB")  # timestamp, source, message type


def version_message(
    version: SoftwareVersion, built: datetime = datetime(2019, 5, 3, 6, 39)
) -> VersionMessage:
    """Return the version message of a controller.

    Up to 3.2 the build number is in the place of the third number; from 3.10 on it is 0. The date has two
    forms. Source: captures of 3.3 and 3.10; that both changes came with 3.10 is assumed.

    Args:
        version: four numbers.
        built: date and time of the build.
    """
    is_new = version >= _NEW_FORM
    return VersionMessage(
        major=version.major,
        minor=version.minor,
        bugfix=version.bugfix if _THIRD_NUMBER.covers(version) else version.build,
        build=0 if is_new else version.build,
        build_date=built.strftime("%d-%m-%Y, %H:%M:%S" if is_new else "%b %d %Y, %H:%M:%S"),
    )


def encode_message(message: RobotMessage, version: SoftwareVersion) -> bytes:
    """Body of a message package, from the timestamp on, as software `version` sends it.

    Raises:
        LocalProtocolError: a value does not fit its field, or the message has no table.
    """
    if message.MESSAGE_TYPE not in _BY_TYPE:
        raise LocalProtocolError(f"{type(message).__name__} has no table and cannot be sent")
    try:
        header = _HEADER.pack(message.timestamp, message.source, message.MESSAGE_TYPE)
    except struct.error as problem:
        raise LocalProtocolError(
            f"timestamp {message.timestamp} or source {message.source} cannot be sent: {problem}"
        ) from None
    return header + codec_for(type(message), version).encode(message)


def decode_message(body: bytes, version: SoftwareVersion) -> RobotMessage:
    """The inverse of `encode_message`; a version message is decoded for the version that it contains.

    Raises:
        RemoteProtocolError: the body ends before the fields do.
    """
    if len(body) < _HEADER.size:
        raise RemoteProtocolError(f"a robot message of {len(body)} bytes is shorter than its header")
    timestamp, source, message_type = _HEADER.unpack_from(body)
    data = body[_HEADER.size :]
    record = _BY_TYPE.get(message_type)
    if record is None:
        return UnknownMessage(timestamp=timestamp, source=source, message_type=message_type, body=data)
    if record is VersionMessage:
        name_end = 1 + data[0] if data else 0
        if len(data) >= name_end + 2:
            version = SoftwareVersion(data[name_end], data[name_end + 1])
    fields = codec_for(record, max(version, OLDEST)).decode_fields(data)
    return record(timestamp=timestamp, source=source, **fields)
