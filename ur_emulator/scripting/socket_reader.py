"""How a program reads a socket: texts are found in the inbox without looking at a byte twice."""

from __future__ import annotations

from ur_emulator.scripting.network import ScriptSocket


class SocketReader:
    """A socket that a program has opened.

    Attributes:
        socket: the connection.
        n_taken: bytes that were read.
    """

    def __init__(self, socket: ScriptSocket) -> None:
        self.socket = socket
        self.n_taken = 0

    def take(self, size: int) -> bytes:
        """Take bytes out of the inbox."""
        inbox = self.socket.inbox
        data = bytes(inbox[:size])
        del inbox[:size]
        self.n_taken += len(data)
        return data


class TextSearch:
    """A search for one text in an inbox that grows.

    Attributes:
        n_searched: bytes that it has looked at.
    """

    def __init__(self, start: bytes, end: bytes, most: int = 0) -> None:
        """Begin a search.

        Args:
            start: the text begins behind it; what stands before it is taken too.
            end: the text ends with it; without one it is all there is, at least a byte.
            most: bytes of a text without an end.
        """
        self._start, self._end, self._most = start, end, most
        self.n_searched = 0
        self._n_taken = 0
        self._begin = -1  # of the text, once it is known
        self._at = 0
        self._size = 0  # once the end is known

    def find(self, reader: SocketReader) -> int:
        """Return the number of bytes up to the end of the text; 0 while it is not complete."""
        if reader.n_taken != self._n_taken:
            # Another thread has read from this socket.
            self._n_taken, self._begin, self._at, self._size = reader.n_taken, -1, 0, 0
        inbox = reader.socket.inbox
        if self._begin < 0:
            self._begin = self._after(self._start, inbox)
            if self._begin < 0:
                return 0
        if not self._end:
            return min(len(inbox), self._begin + self._most) if len(inbox) > self._begin else 0
        if not self._size:
            self._size = max(0, self._after(self._end, inbox))
        return self._size

    def _after(self, mark: bytes, inbox: bytearray) -> int:
        """Return where what follows a mark begins; -1 if there is none behind what was searched."""
        found = inbox.find(mark, self._at)
        # Of a mark that has not come whole, all bytes but the last may be there.
        end = max(self._at, len(inbox) - len(mark) + 1) if found < 0 else found + len(mark)
        self.n_searched += end - self._at
        self._at = end
        return -1 if found < 0 else end
