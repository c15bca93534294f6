"""The page of a window: where it listens, and who may open it.

viser serves the page and its websocket on one port. It looks neither at the `Origin` of a connection nor at
its `Host`, listens on the next port when one is taken, and can publish a page through its maker's servers. So
it listens on an inner port, behind a gate that looks at each request before it passes the connection on. It
takes no websocket that did not come through the gate, and nothing is published.
"""

from __future__ import annotations

import asyncio
import re
import socket
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import redirect_stdout, suppress
from functools import partial
from hashlib import sha256
from http import HTTPStatus
from http.cookies import SimpleCookie
from queue import Empty, SimpleQueue
from secrets import compare_digest, token_hex
from threading import Thread
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import viser
from viser._messages import ShareUrlDisconnect, ShareUrlRequest
from websockets.datastructures import MultipleValuesError
from websockets.http11 import Request
from websockets.server import ServerProtocol

from ur_emulator.errors import EmulatorError
from ur_emulator.host.box_options import check_token, is_loopback

MOST_PAGES = 20
"""Pages that may be open at once."""

_LONGEST, _PATIENCE = 1 << 14, 10.0  # of a request [bytes], and until it is there [s]
_CHUNK = 1 << 16  # bytes
_PASSED = "X-Ur-Pendant-Passed"  # Header with which the gate passes a request on.

_LOOK_AT = (0.2, 0.0, 0.3)
_NARROW, _BELOW = 600, 0.8  # pixels, m

_COOKIE = "ur_pendant"
_HOST = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9.-]+)(?::[0-9]{1,5})?")


class WindowError(Exception):
    """The window cannot be opened; one line for people."""


class Events:
    """What happens at the pages of a window, in one queue.

    Callbacks of viser only put; the thread of the window takes, and alone changes what the window knows.
    """

    def __init__(self) -> None:
        self._queue: SimpleQueue[Callable[[], object]] = SimpleQueue()

    def put(self, handle: Callable[[], object]) -> None:
        """Have something done by the window's thread."""
        self._queue.put(handle)

    def entry(
        self, handle: Callable[..., object], read: Callable[[Any], tuple[Any, ...]] = lambda event: ()
    ) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """Return a callback: `handle` gets the client, and what `read` finds when the event happens.

        viser awaits such a callback before the next event, and would call plain functions in any order. What
        the window changes itself has no client, and is no event.
        """

        async def enter(event: Any) -> None:
            client = getattr(event, "client", event)  # a client that connects is the event
            if client is not None:
                self.put(partial(handle, client, *read(event)))

        return enter

    def until(self, end: float) -> Iterator[Callable[[], object]]:
        """Yield what is to be done: all that waits, and what comes until a time of `time.monotonic`."""
        for _ in range(self._queue.qsize()):
            yield self._queue.get()
        while (left := end - time.monotonic()) > 0.0:
            with suppress(Empty):
                yield self._queue.get(timeout=left)


class PageServer(viser.ViserServer):  # type: ignore[misc]  # viser has no types that mypy can use
    """viser's server behind a gate, which looks at the request of each connection.

    Attributes:
        address: of the gate: host and port.
        events: what happens at its pages.
    """

    def __init__(self, host: str, port: int, token: str | None, title: str) -> None:
        """Open the port of a window.

        Args:
            host: address of this machine; one that others reach needs a token.
            port: 0 takes a free one.
            token: what a page must show once, as `/?token=...`.
            title: of the page.

        Raises:
            WindowError: another address without a token, or the port is taken.
        """
        listening = _listening_socket(host, port, token)
        self.address: tuple[str, int] = listening.getsockname()[:2]
        self.events = Events()
        self._token, self._pages, self._secret = token, 0, token_hex()
        with redirect_stdout(None):  # viser tells what the caller tells better
            super().__init__(host="127.0.0.1", port=0, label=title, verbose=False)
        for message in (ShareUrlRequest, ShareUrlDisconnect):  # a box is not for the world
            self._websock_server.unregister_handler(message)
        self._websock_server.on_client_connect(self._check_passed)
        self._websock_server.disconnect_all_clients()
        self.gui.configure_theme(show_logo=False, show_share_button=False)
        # Shadows and a sky of pictures take most of a core where there is no graphics card.
        self.scene.configure_default_lights(cast_shadow=False)
        self.scene.configure_environment_map(None)
        self.scene.add_light_hemisphere("/sky", ground_color=(150, 150, 160), intensity=2.5)
        self.gui.main_panel.dock_right()
        self.initial_camera.position, self.initial_camera.look_at = (1.5, -1.1, 0.9), _LOOK_AT
        self.on_client_connect(self.events.entry(_look_below))
        self._gate, self._ended = asyncio.new_event_loop(), asyncio.Event()
        self._thread = Thread(target=self._listen, args=(listening,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close all pages."""
        self._gate.call_soon_threadsafe(self._ended.set)
        self._thread.join()
        with redirect_stdout(None):
            super().stop()

    async def _check_passed(self, page: Any) -> None:
        """Refuse a websocket that did not come through the gate, before anything of it is read."""
        connection = self._websock_server._live_connections[page.client_id]
        if self._secret not in connection.request.headers.get_all(_PASSED):
            del self._websock_server._live_connections[page.client_id]
            del self._websock_server._client_state_from_id[page.client_id]
            raise ConnectionRefusedError("a websocket that did not come through the gate")

    # --- the gate, in a thread of its own

    def _listen(self, listening: socket.socket) -> None:
        async def listen() -> None:
            server = await asyncio.start_server(self._attend, sock=listening, limit=_LONGEST)
            await self._ended.wait()
            server.close()

        with asyncio.Runner(loop_factory=lambda: self._gate) as runner:  # which ends all of its tasks
            runner.run(listen())

    async def _attend(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Look at the request of a connection, and pass the connection on if it may go on."""
        protocol = ServerProtocol()
        try:
            async with asyncio.timeout(_PATIENCE):
                head = await reader.readuntil(b"\r\n\r\n")
            protocol.receive_data(head)
            for request in protocol.events_received():  # none, or one
                assert isinstance(request, Request)
                is_page = request.headers.get("Upgrade", "").lower() == "websocket"
                refusal = self._refusal(request, is_page=is_page)
                if refusal:
                    protocol.send_response(protocol.reject(HTTPStatus.FORBIDDEN, f"{refusal}\n"))
                    writer.writelines(protocol.data_to_send())
                    return
                self._pages += is_page
                try:
                    await self._pass(head, reader, writer)
                finally:
                    self._pages -= is_page
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError, MultipleValuesError):
            pass  # it is no request, or the page is gone
        except asyncio.CancelledError:
            pass  # the server stops; asyncio would print it
        finally:
            writer.close()

    def _refusal(self, request: Request, *, is_page: bool) -> str:
        """Return why a request is refused; "" if it may go on."""
        headers, token = request.headers, self._token
        host, origin = headers.get("Host", ""), headers.get("Origin")
        named = _HOST.fullmatch(host)
        if named is None or (token is None and not is_loopback(named[1].strip("[]"))):
            return f"host {ascii(host)[:60]} given: open the page by 127.0.0.1 or localhost"
        if origin is not None and origin != f"http://{host}":
            return f"pages of {ascii(origin)[:60]} may not use this window"
        if token is not None and not _shows(request, token):
            return "this window needs its token: open it as /?token=..."
        if is_page and self._pages >= MOST_PAGES:
            return f"{MOST_PAGES} pages are open: close one"
        if is_page and f"viser-v{viser.__version__}" not in headers.get("Sec-WebSocket-Protocol", ""):
            return "the page is of another version of viser: load it again"
        return ""

    async def _pass(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self.get_port())
        try:
            inner_writer.write(head[:-2] + f"{_PASSED}: {self._secret}\r\n\r\n".encode())
            writer.write(await inner_reader.readline() + _headers(self._token))
            await asyncio.gather(_copy(reader, inner_writer), _copy(inner_reader, writer))
        finally:
            inner_writer.close()


def _look_below(client: viser.ClientHandle) -> None:
    """Let a phone look below the arm, which is then above the panel."""
    if client.camera.image_width < _NARROW:
        client.camera.look_at = np.subtract(_LOOK_AT, (0.0, 0.0, _BELOW))


async def _copy(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while data := await source.read(_CHUNK):
            sink.write(data)
            await sink.drain()
    sink.close()


def _listening_socket(host: str, port: int, token: str | None) -> socket.socket:
    try:
        check_token(token)
    except EmulatorError as error:
        raise WindowError(str(error)) from None
    if not is_loopback(host) and token is None:
        raise WindowError(
            f"{host} can be reached by other machines: give it a --token, or open the window here and look "
            f"at it through a tunnel: ssh -L {port}:127.0.0.1:{port} THIS_MACHINE"
        )
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as error:
        raise WindowError(
            f"port {port} of {host} cannot be opened ({error.strerror}): give another --port or --listen "
            "(of `ur-emulator serve`: --window-port or --window-host)"
        ) from None


def _shows(request: Request, token: str) -> bool:
    """Whether a request shows the token: in its query the first time, then in a cookie by its digest."""
    given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
    kept = SimpleCookie(request.headers.get("Cookie", "")).get(_COOKIE)
    digest = "" if kept is None else kept.value
    return compare_digest(given.encode(), token.encode()) or compare_digest(digest, _digest(token))


def _digest(token: str) -> str:
    return sha256(token.encode()).hexdigest()


def _headers(token: str | None) -> bytes:
    """What answers say beside viser's own: no other page may show this one, and the token is kept."""
    said = "X-Frame-Options: SAMEORIGIN\r\nReferrer-Policy: no-referrer\r\nCache-Control: no-cache\r\n"
    if token is not None:
        said += f"Set-Cookie: {_COOKIE}={_digest(token)}; HttpOnly; SameSite=Strict; Path=/\r\n"
    return said.encode()
