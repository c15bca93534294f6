"""The page of a window: where it listens, and who may open it.

viser serves the page and its websocket on one port. It looks neither at the `Origin` of a connection nor at
its `Host`, listens on the next port when one is taken, and can publish a page through its maker's servers.
The websockets library underneath is asked to look first, and to listen on the socket that was opened here;
nothing is published.
"""

from __future__ import annotations

import http
import logging
import re
import socket
from collections.abc import Callable
from hashlib import sha256
from http.cookies import SimpleCookie
from secrets import compare_digest
from typing import Any
from unittest.mock import patch
from urllib.parse import parse_qs, urlsplit

import numpy as np
import rich
import viser
import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ur_emulator.host.box_options import check_token, is_loopback

MOST_PAGES = 20
"""Pages that may be open at once."""

_LOOK_AT = (0.2, 0.0, 0.3)
_NARROW, _BELOW = 600, 0.8  # pixels, m

_COOKIE = "ur_pendant"
_HOST = re.compile(r"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9.-]+)(?::[0-9]{1,5})?")


class WindowError(Exception):
    """The window cannot be opened; one line for people."""


class PageServer(viser.ViserServer):  # type: ignore[misc]  # viser has no types that mypy can use
    """viser's server that nobody can ask to publish the page."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Do nothing: a box is not for the world."""
        return None


def open_server(host: str, port: int, token: str | None, title: str) -> PageServer:
    """Open the port of a window.

    Args:
        host: address of this machine; one that others reach needs a token.
        port: 0 takes a free one.
        token: what a page must show once, as `/?token=...`.

    Raises:
        WindowError: another address without a token, or the port is taken.
    """
    try:
        check_token(token)
    except Exception as error:
        raise WindowError(str(error)) from None
    if not is_loopback(host) and token is None:
        raise WindowError(
            f"{host} can be reached by other machines: give it a --token, or open the window here and look "
            f"at it through a tunnel: ssh -L {port}:127.0.0.1:{port} THIS_MACHINE"
        )
    try:
        listening = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET
        )
    except OSError as error:
        raise WindowError(
            f"port {port} of {host} cannot be opened ({error.strerror}): give another --port or --listen "
            "(of `ur-emulator serve`: --window-port or --window-host)"
        ) from None
    serve = websockets.asyncio.server.serve
    pages: set[Any] = set()  # also those that have not said yet how they look at the scene

    def serve_checked(
        handler: Any, host: str, port: int, *, process_request: Callable[..., Any], **options: Any
    ) -> Any:
        def look_first(connection: Any, request: Request) -> Response | None:
            refusal = _refusal(request, token, is_full=len(pages) >= MOST_PAGES)
            if refusal is not None:
                return refusal
            response: Response | None = process_request(connection, request)
            if response is not None:
                response.headers.update(_headers(token))
            return response

        async def count(page: Any) -> None:
            pages.add(page)
            try:
                await handler(page)
            finally:
                pages.remove(page)

        return serve(count, sock=listening, process_request=look_first, logger=quiet, **options)

    quiet = logging.getLogger(__name__)  # of connections that send what is no message
    quiet.disabled = True
    rich.get_console().quiet = True  # on which viser tells what the caller tells better
    with patch.object(websockets.asyncio.server, "serve", serve_checked):
        server = PageServer(host=host, port=port, label=title, verbose=False)
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    # Shadows and a sky of pictures take most of a core where there is no graphics card.
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.configure_environment_map(None)
    server.scene.add_light_hemisphere("/sky", ground_color=(150, 150, 160), intensity=2.5)
    server.gui.main_panel.dock_right()
    server.initial_camera.position, server.initial_camera.look_at = (1.5, -1.1, 0.9), _LOOK_AT
    server.on_client_connect(_look_below)
    return server


def _look_below(client: viser.ClientHandle) -> None:
    """Let a phone look below the arm, which is then above the panel."""
    if client.camera.image_width < _NARROW:
        client.camera.look_at = np.subtract(_LOOK_AT, (0.0, 0.0, _BELOW))


def _refusal(request: Request, token: str | None, *, is_full: bool) -> Response | None:
    """Return why a request is refused; None if it may go on."""
    headers = request.headers
    host, origin = headers.get("Host", ""), headers.get("Origin")
    named = _HOST.fullmatch(host)
    if named is None or (token is None and not is_loopback(named[1].strip("[]"))):
        return _refuse(f"host {ascii(host)[:60]} given: open the page by 127.0.0.1 or localhost")
    if origin is not None and origin != f"http://{host}":
        return _refuse(f"pages of {ascii(origin)[:60]} may not use this window")
    if token is not None and not _shows(request, token):
        return _refuse("this window needs its token: open it as /?token=...")
    if is_full and headers.get("Upgrade", "").lower() == "websocket":
        return _refuse(f"{MOST_PAGES} pages are open: close one")
    return None


def _shows(request: Request, token: str) -> bool:
    """Whether a request shows the token: in its query the first time, then in a cookie by its digest."""
    given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
    kept = SimpleCookie(request.headers.get("Cookie", "")).get(_COOKIE)
    digest = "" if kept is None else kept.value
    return compare_digest(given.encode(), token.encode()) or compare_digest(digest, _digest(token))


def _digest(token: str) -> str:
    return sha256(token.encode()).hexdigest()


def _refuse(text: str) -> Response:
    body = f"{text}\n".encode()
    headers = Headers({"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))})
    return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", headers, body)


def _headers(token: str | None) -> dict[str, str]:
    """What the page's answers say beside viser's own: no other page may show it, and the token is kept."""
    said = {"X-Frame-Options": "SAMEORIGIN", "Referrer-Policy": "no-referrer", "Cache-Control": "no-cache"}
    if token is not None:
        said["Set-Cookie"] = f"{_COOKIE}={_digest(token)}; HttpOnly; SameSite=Strict; Path=/"
    return said
