"""Cuts a byte stream into frames that begin with their own length (`i32`, big-endian, counts itself).

Used for the realtime, primary and secondary ports, at both ends. The content of a frame is not read.
"""

from protocol.errors import RemoteProtocolError

__all__ = ["LENGTH_SIZE", "FrameBuffer"]

LENGTH_SIZE = 4
"""Bytes of the length prefix."""


class FrameBuffer:
    """Bytes in, whole frames of valid sizes out.

    A longer one means that the frame boundary is lost or that the peer uses another protocol. The usual case
    on a live port, one `recv` that holds exactly one frame, costs no copy.
    """

    __slots__ = ("_buffer", "_max_size", "_min_size", "_start", "_whole")

    def __init__(self, max_size: int, min_size: int = LENGTH_SIZE) -> None:
        self._max_size = max_size
        self._min_size = max(min_size, LENGTH_SIZE)
        self._buffer = bytearray()
        self._start = 0  # consumed bytes at the start of the buffer; removed when new data comes
        self._whole: bytes | None = None  # one complete frame that never went through the buffer

    @property
    def pending(self) -> int:
        """Bytes that are not returned yet; more than 0 at the end of the stream means an incomplete frame."""
        return len(self._buffer) - self._start + (len(self._whole) if self._whole is not None else 0)

    def feed(self, data: bytes) -> None:
        """Add received bytes, split anywhere."""
        if self._whole is None and not self._buffer:
            size = len(data)
            if self._min_size <= size <= self._max_size and int.from_bytes(data[:LENGTH_SIZE], "big") == size:
                self._whole = bytes(data)
                return
        elif self._whole is not None:
            self._buffer += self._whole
            self._whole = None
        if self._start:
            del self._buffer[: self._start]
            self._start = 0
        self._buffer += data

    def next_frame(self) -> bytes | None:
        """The next complete frame, length prefix included, or None when more bytes are needed.

        RemoteProtocolError: the length is invalid. The stream is lost, every further call raises again.
        """
        whole = self._whole
        if whole is not None:
            self._whole = None
            return whole
        start, buffer = self._start, self._buffer
        available = len(buffer) - start
        if available < LENGTH_SIZE:
            return None
        size = int.from_bytes(buffer[start : start + LENGTH_SIZE], "big", signed=True)
        if not self._min_size <= size <= self._max_size:
            raise RemoteProtocolError(
                f"frame length {size} is not within {self._min_size} to {self._max_size} bytes: "
                "not this protocol, or the frame boundary is lost"
            )
        if available < size:
            return None
        frame = bytes(buffer[start : start + size])
        if available == size:
            buffer.clear()
            self._start = 0
        else:
            self._start = start + size
        return frame
