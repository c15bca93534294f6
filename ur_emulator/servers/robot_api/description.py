"""How the Robot API describes itself: a document for programs, and a page for people."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

from protocol.robot_api import BASE, ApiCall


def openapi(calls: Iterable[ApiCall], version: str) -> dict[str, Any]:
    """Return the OpenAPI document of some calls; `version` is that of the API."""
    paths: dict[str, dict[str, Any]] = {}
    for call in calls:
        paths.setdefault(call.path, {})[call.method.lower()] = _described(call)
    info = {"title": "Robot API", "version": version}
    return {"openapi": "3.0.3", "info": info, "servers": [{"url": BASE}], "paths": paths}


def page(calls: Iterable[ApiCall], version: str) -> bytes:
    """Return the same as a page in HTML."""
    rows = "\n".join(
        f"<tr><td><code>{call.method} {escape(call.path)}</code></td><td>{escape(call.does)}</td>"
        f"<td>{'remote' * call.needs_remote}</td></tr>"
        for call in calls
    )
    return (
        f"<!DOCTYPE html>\n<html lang=en><meta charset=utf-8><title>Robot API {escape(version)}</title>\n"
        f'<h1>Robot API {escape(version)}</h1>\n<p>Below <code>{BASE}</code>; <a href="{BASE}/openapi.json">'
        f"openapi.json</a> is for programs.</p>\n"
        f"<table>\n<tr><th>call</th><th>does</th><th>control</th></tr>\n{rows}\n</table>\n</html>\n"
    ).encode()


def _described(call: ApiCall) -> dict[str, Any]:
    name = call.path.partition("{")[2].rstrip("}")
    parameter = {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
    return {
        "summary": call.does,
        **({"parameters": [parameter]} if name else {}),
        "responses": {"200": {"description": "done"}},
    }
