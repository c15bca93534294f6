"""What can go wrong on the wire, and whose fault it was.

    ProtocolError
    ├── LocalProtocolError    we were asked to send something that the protocol does not allow
    └── RemoteProtocolError   the other end sent something that the protocol does not allow

A `RemoteProtocolError` means that the byte stream cannot be trusted any more: close the connection.
A `LocalProtocolError` leaves the connection as it was: nothing has been sent.
"""

__all__ = ["LocalProtocolError", "ProtocolError", "RemoteProtocolError"]


class ProtocolError(Exception):
    """Root of every error of this package; the message is one line."""


class LocalProtocolError(ProtocolError):
    """Our side asked for something that cannot be put on the wire."""


class RemoteProtocolError(ProtocolError):
    """The other side sent bytes that no conforming peer sends."""
