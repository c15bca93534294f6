"""What every reader of a stream owes: the same events whole, byte by byte, in pieces, and before other bytes."""


def events_of(connection):
    """Return a function that gives a connection bytes and returns its events."""

    def feed(data):
        connection.receive_data(data)
        events = []
        while (event := connection.next_event()) is not None:
            events.append(event)
        return events

    return feed


def taken_by(take):
    """Return a function that collects bytes and returns what `take` cuts off their beginning."""
    inbox = bytearray()

    def feed(data):
        inbox.extend(data)
        taken = []
        while (one := take(inbox)) is not None:
            taken.append(one)
        return taken

    return feed


def in_pieces(feed, data, size):
    """Feed data in pieces of a size; return all that came of it."""
    return [one for start in range(0, len(data), size) for one in feed(data[start : start + size])]


def check_reading(new_reader, data, expected, trailing=b""):
    """Read data by new readers in every way; `trailing` is the beginning of another message."""
    for sent in (data, data + trailing):
        for size in (1, 7, len(sent)):
            assert in_pieces(new_reader(), sent, size) == expected, f"in pieces of {size} bytes"
