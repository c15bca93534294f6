"""Who may open the page of a window."""

import http.client
import socket
from contextlib import suppress
from functools import partial
from queue import SimpleQueue
from time import monotonic

import msgspec
import numpy as np
import pytest
import viser
from viser._messages import ShareUrlDisconnect, ShareUrlRequest
from websockets.exceptions import ConnectionClosed, ConnectionClosedError
from websockets.sync.client import connect

from ur_pendant.server import PageServer, WindowError

UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec-WebSocket-Protocol": "viser-v1.1.1",
}

X, Y, Z = np.eye(3).tolist()
CAMERA = {
    "wxyz": [1.0, 0.0, 0.0, 0.0], "position": X, "look_at": Y, "up_direction": Z, "fov": 1.0, "near": 0.1, "far": 9.0,
    "image_width": 390, "image_height": 844,
}  # fmt: skip


def get(server, path="/", **headers):
    connection = http.client.HTTPConnection(*server.address, timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    if answer.status == 101:
        connection.close()
        return 101, "", answer
    body = answer.read().decode()
    connection.close()
    return answer.status, body, answer


@pytest.mark.parametrize("upgrade", [{}, UPGRADE], ids=["page", "websocket"])
@pytest.mark.parametrize(
    ("headers", "problem"),
    [
        ({}, ""),
        ({"Host": "localhost:8000"}, ""),
        ({"Host": "[::1]:29980", "Origin": "http://[::1]:29980"}, ""),
        ({"Host": "evil.example"}, "host 'evil.example' given"),
        ({"Host": "127.0.0.1.evil.example"}, "host '127.0.0.1.evil.example' given"),
        ({"Host": ""}, "host '' given"),
        ({"Origin": "http://evil.example"}, "pages of 'http://evil.example' may not"),
        ({"Origin": "null"}, "pages of 'null' may not"),
        ({"Host": "localhost:1", "Origin": "http://localhost:2"}, "pages of 'http://localhost:2' may not"),
        ({"Host": "localhost:1", "Origin": "https://localhost:1"}, "pages of 'https://localhost:1' may not"),
    ],
)
def test_only_pages_of_this_machine_open_it(server, headers, upgrade, problem):
    status, body, answer = get(server, **headers, **upgrade)
    if problem:
        assert (status, problem in body) == (403, True)
    elif upgrade:
        assert status == 101
    else:
        assert (status, answer.headers["X-Frame-Options"]) == (200, "SAMEORIGIN")


def test_a_token_is_shown_once_and_kept_as_its_digest():
    server = PageServer("127.0.0.1", 0, 'a"to;ken', "test")
    try:
        for path, cookie in (
            ("/", ""),
            ("/?token=b", ""),
            ("/?token=", ""),
            ("/", "ur_pendant=a"),
            ("/", '"'),
        ):
            assert get(server, path, Cookie=cookie)[0] == 403, (path, cookie)
        status, _, answer = get(server, "/?token=a%22to%3Bken", Host="box.example")
        cookie = answer.headers["Set-Cookie"]
        assert (status, "HttpOnly" in cookie, "SameSite=Strict" in cookie) == (200, True, True)
        assert 'a"to;ken' not in cookie
        assert get(server, Cookie=cookie.partition(";")[0], **UPGRADE)[0] == 101
        assert get(server, Cookie=cookie.partition(";")[0], Origin="http://evil.example", **UPGRADE)[0] == 403
    finally:
        server.stop()


def test_other_addresses_need_a_token_and_a_taken_port_is_an_error(server):
    with pytest.raises(WindowError, match=r"--token.*ssh -L 29980:127.0.0.1:29980"):
        PageServer("0.0.0.0", 29980, None, "test")
    with pytest.raises(WindowError, match="no blanks"):
        PageServer("127.0.0.1", 0, "a b", "test")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(WindowError, match=f"port {port} of 127.0.0.1 cannot be opened.*in use.*--port "):
            PageServer("127.0.0.1", port, None, "test")
    with pytest.raises(WindowError, match=r"cannot be opened.*--listen.*--window-host"):
        PageServer("192.0.2.1", 0, "token", "test")


def test_nobody_can_publish_the_page(server):
    assert not {ShareUrlRequest, ShareUrlDisconnect} & set(server._websock_server._incoming_handlers)


def page(address):
    """A page's websocket, as its script opens it."""
    host, port = address
    return connect(
        f"ws://{host}:{port}", subprotocols=[f"viser-v{viser.__version__}"], max_size=None, proxy=None
    )


def test_a_websocket_that_did_not_come_through_the_gate_is_closed_before_anything_is_sent(server):
    with page(server.address) as one:
        assert one.recv()
    status, body, _ = get(server, **UPGRADE | {"Sec-WebSocket-Protocol": "viser-v0.1"})
    assert (status, body) == (403, "the page is of another version of viser: load it again\n")
    with page(("127.0.0.1", server.get_port())) as one, pytest.raises(ConnectionClosedError):
        one.recv()


def test_a_server_that_stops_closes_its_pages_without_a_word(caplog):
    server = PageServer("127.0.0.1", 0, None, "test")
    with page(server.address) as one:
        assert one.recv()
        server.stop()
        with suppress(ConnectionClosed):
            while True:
                one.recv(timeout=20.0)
    assert not [record for record in caplog.records if record.name == "asyncio"]


def test_so_many_pages_may_be_open_at_once(server, monkeypatch):
    monkeypatch.setattr("ur_pendant.server.MOST_PAGES", 2)
    with page(server.address) as one, page(server.address) as other:
        assert one.recv()
        assert other.recv()
        status, body, _ = get(server, **UPGRADE)
        assert (status, body) == (403, "2 pages are open: close one\n")
        assert get(server)[0] == 200


def test_events_of_a_page_come_in_their_order_and_the_end_of_a_drag_with_its_pose(server):
    frame = server.scene.add_transform_controls("/frame")
    taken = SimpleQueue()
    enter = server.events.entry(
        lambda _, *what: taken.put(what), lambda event: (event.phase, frame.position[0])
    )
    frame.on_update(enter)

    def send(kind, **more):
        one.send(msgspec.msgpack.encode({"type": kind, **more}))

    with page(server.address) as one:
        send("ViewerCameraMessage", **CAMERA)
        send("TransformControlsDragStartMessage", name="/frame")
        for x in range(100):
            send(
                "TransformControlsUpdateMessage",
                name="/frame",
                wxyz=(1.0, 0.0, 0.0, 0.0),
                position=(float(x), 0.0, 0.0),
            )
        send("TransformControlsDragEndMessage", name="/frame")
        for handle in server.events.until(monotonic() + 20.0):
            handle()
            if taken.qsize() == 102:
                break
            client = next(iter(server.get_clients().values()), None)
        assert client.camera.look_at.tolist() == [0.2, 0.0, -0.5]  # it is a phone
    got = [taken.get() for _ in range(taken.qsize())]
    assert got == [("start", 0.0), *(("update", float(x)) for x in range(100)), ("end", 99.0)]


def test_events_that_wait_are_taken_also_by_a_window_that_is_late(server):
    taken = []
    for k in range(3):
        server.events.put(partial(taken.append, k))
    for handle in server.events.until(monotonic() - 1.0):
        handle()
        server.events.put(handle)  # others do not wait for a page that sends without pause
    assert taken == [0, 1, 2]
