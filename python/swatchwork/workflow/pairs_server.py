# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The page of ``prepare pairs`` over HTTP, for this machine and for whoever knows its address.

It listens on 127.0.0.1 only. Every path begins with a random token, so that other users of the machine and
other pages in the browser cannot ask; the Host header is checked, so that no foreign name that resolves to
127.0.0.1 can either. Only the files of ``pairs_page`` are served, from memory.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import Any, cast
from urllib.parse import parse_qsl, urlsplit

from ..errors import InputError, OutputError, SwatchworkError
from .pairs_desk import Desk

MOST_BYTES = 1 << 24
"""Of a request: a hundred thousand pairs."""
IDLE_S = 30.0
"""After which a connection that says nothing is closed."""
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
JSON, JPEG, PNG, BYTES = "application/json", "image/jpeg", "image/png", "application/octet-stream"
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'; object-src 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class PairsServer(ThreadingHTTPServer):
    """Serves one desk until it is shut down.

    Args:
        port: 0 for a free one.

    Raises:
        InputError: the port is taken, or not allowed.
    """

    daemon_threads = True

    def __init__(self, desk: Desk, port: int = 0) -> None:
        self.desk = desk
        self.token = secrets.token_urlsafe(24)
        self.page = page_files()
        try:
            super().__init__(("127.0.0.1", port), _Handler)
        except (OSError, OverflowError) as error:
            raise InputError(
                f"port {port} cannot be used ({getattr(error, 'strerror', None) or error})",
                expected="a free one",
                hint="Leave --port away and one is found",
            ) from error
        self.hosts = {f"{name}:{self.server_port}" for name in ("127.0.0.1", "localhost")}

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self.server_port}/{self.token}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that closes a connection midway is no news; other errors were answered."""


def page_files() -> dict[str, tuple[str, bytes]]:
    """Type and content of the page's files by name; the page itself is ""."""
    folder = files("swatchwork.workflow") / "pairs_page"
    found = {}
    for file in folder.iterdir():
        suffix = "." + file.name.rpartition(".")[2]
        if suffix in TYPES:
            name = "" if file.name == "index.html" else file.name
            found[name] = f"{TYPES[suffix]}; charset=utf-8", file.read_bytes()
    return found


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = IDLE_S
    server_version, sys_version = "swatchwork", ""

    @property
    def _server(self) -> PairsServer:
        return cast(PairsServer, self.server)

    def do_GET(self) -> None:
        """The page's files, its state, the mesh, a photograph."""
        name, query = self._allowed()
        desk = self._server.desk
        if name is None:
            return
        if name in self._server.page:
            self._send(*self._server.page[name])
        elif name == "state":
            self._answer(JSON, desk.state)
        elif name == "mesh":
            self._answer(BYTES, lambda: desk.mesh_buffer)
        elif name == "photograph":
            self._answer(JPEG, lambda: desk.picture(query.get("number"), query.get("stops", 0.0)))
        else:
            self._refuse(HTTPStatus.NOT_FOUND, f"there is no {name!r} here")

    def do_POST(self) -> None:
        """Questions in JSON: a pick, what is hidden, a pose, its outline; and the order to save."""
        name, _ = self._allowed()
        if name is None:
            return
        desk = self._server.desk
        work: dict[str, tuple[str, Callable[[Any], Any]]] = {
            "pick": (JSON, desk.pick),
            "hidden": (JSON, desk.hidden),
            "pose": (JSON, desk.pose),
            "outline": (PNG, desk.outline),
            "save": (JSON, desk.save),
        }
        if name not in work:
            self._refuse(HTTPStatus.NOT_FOUND, f"there is no {name!r} here")
            return
        kind, does = work[name]
        self._answer(kind, lambda: does(self._body()))

    def log_message(self, format: str, *args: Any) -> None:
        """Libraries do not print."""

    def _allowed(self) -> tuple[str | None, dict[str, str]]:
        """Name and query of a request that may be answered; others are refused, and have no name."""
        server, parts = self._server, urlsplit(self.path)
        _, token, *rest = [*parts.path.split("/"), ""]
        if self.headers.get("Host", "") not in server.hosts:
            self._refuse(HTTPStatus.FORBIDDEN, "the Host header is not this server's")
        elif not secrets.compare_digest(token.encode(), server.token.encode()):
            self._refuse(HTTPStatus.FORBIDDEN, "the address lacks this run's token; use the one printed")
        else:
            return "/".join(rest).rstrip("/"), dict(parse_qsl(parts.query))
        return None, {}

    def _body(self) -> dict[str, Any]:
        length = self.headers.get("Content-Length", "")
        if not length.isdigit() or int(length) > MOST_BYTES:
            self.close_connection = True
            raise InputError(f"Content-Length is {length!r}", expected=f"up to {MOST_BYTES} bytes")
        read = self.rfile.read(int(length))
        if len(read) < int(length):
            raise InputError(f"the request ends after {len(read)} bytes", expected=length)
        try:
            found = json.loads(read)
        except (ValueError, RecursionError) as error:
            raise InputError("the request is no JSON", expected="an object") from error
        if not isinstance(found, dict):
            raise InputError(f"the request is a {type(found).__name__}", expected="an object")
        return found

    def _answer(self, kind: str, make: Callable[[], Any]) -> None:
        try:
            made = make()
        except OutputError as error:
            self._refuse(HTTPStatus.INSUFFICIENT_STORAGE, str(error))
        except SwatchworkError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))
        except Exception as error:
            # A defect of ours must reach the person at the page, who sees no terminal.
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, f"{type(error).__name__}: {error}")
            raise
        else:
            self._send(kind, made if isinstance(made, bytes) else json.dumps(made, allow_nan=False).encode())

    def _refuse(self, status: HTTPStatus, reason: str) -> None:
        # What was not read of the request would be taken for the next one.
        self.close_connection = True
        self._send(JSON, json.dumps({"error": reason}).encode(), status)

    def _send(self, kind: str, content: bytes, status: HTTPStatus = HTTPStatus.OK) -> None:
        self.send_response(status)
        headers = {**HEADERS, "Content-Type": kind, "Content-Length": str(len(content))}
        if self.close_connection:
            headers["Connection"] = "close"
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)
