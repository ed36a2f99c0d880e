"""Serve the page and the tiles of one array to browsers on this machine, and nothing else.

A request never becomes a file name: it names one of the page's files, or is parsed as key, camera and light.
"""

import json
import re
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason
from framearray_cli.base.hashing import line_digest

from .contents import CONTENTS_FILE
from .page import content_type, page_files
from .tiles import INDEX_FILE, Tiles

HOST = "127.0.0.1"
TILE = re.compile(r"/tiles/([\w-]+)/c(\d{4,9})(?:\.l(\d{3,9}))?\.jpg", re.ASCII)
# Names of this machine. Under another name a page from elsewhere may be asking, whose domain points here.
HOSTS = ("127.0.0.1", "localhost")


class PageServer(ThreadingHTTPServer):
    """Answer requests, each connection in its own thread, until shut down."""

    daemon_threads = True
    request_queue_size = 64  # browsers open several connections at once

    def __init__(self, tiles: Tiles, port: int) -> None:
        """Listen.

        Args:
            port: 0 takes a free one.

        Raises:
            OutputError: the port cannot be used.
        """
        self.tiles, self.page, self._lock = tiles, page_files(), threading.Lock()
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            why = reason(error) if isinstance(error, OSError) else str(error)
            raise OutputError(f"port {port}: cannot be used: {why}; --port 0 takes one that is free") from error

    @property
    def url(self) -> str:
        return f"http://{HOST}:{self.server_port}/"

    def contents(self) -> bytes:
        """Return `contents.json` as of now; renew the tiles if the array has changed too much for them.

        Raises:
            OutputError: the array cannot be read any more.
        """
        with self._lock:
            self.tiles = self.tiles.renewed()
            return json.dumps(self.tiles.contents(live=True)).encode()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report nothing: a browser that leaves closes its connections in the middle of answers."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    protocol_version = "HTTP/1.1"  # keeps connections open: a drag requests hundreds of files
    disable_nagle_algorithm = True  # or else the end of an answer waits 40 ms for an acknowledgement
    wbufsize = -1  # sends head and body together

    def do_GET(self) -> None:
        self._answer(body=True)

    def do_HEAD(self) -> None:
        self._answer(body=False)

    def _answer(self, body: bool) -> None:
        host = self.headers.get("Host", "").rpartition(":")[0] or self.headers.get("Host", "")
        if host not in HOSTS:
            self._send(HTTPStatus.MISDIRECTED_REQUEST, b"not this host\n", "text/plain", body=body)
            return
        path = urlsplit(self.path).path
        try:
            data, kind = self._find(path)
        except (OutputError, OSError) as error:
            self._send(HTTPStatus.NOT_FOUND, f"{error}\n".encode(errors="replace"), "text/plain", body=body)
            return
        tag = f'"{line_digest(data).decode()}"'
        if self.headers.get("If-None-Match") == tag:
            self._send(HTTPStatus.NOT_MODIFIED, b"", kind, tag, body=False)
        else:
            self._send(HTTPStatus.OK, data, kind, tag, body=body)

    def _find(self, path: str) -> tuple[bytes, str]:
        """Return content and its type."""
        tiles = self.server.tiles
        if match := TILE.fullmatch(path):
            key, c, l = match.groups()
            file = tiles.ensure_tile(key, int(c), None if l is None else int(l))
            return file.read_bytes(), "image/jpeg"
        if path == f"/{INDEX_FILE}":
            return (tiles.folder / INDEX_FILE).read_bytes(), "application/json"
        if path == f"/{CONTENTS_FILE}":
            return self.server.contents(), "application/json"
        name = path.removeprefix("/") or "index.html"
        if name in tiles.views.files:
            return tiles.views.files[name], content_type(name)
        if name not in self.server.page:
            raise OutputError(f"{path}: no such file")
        return self.server.page[name], content_type(name)

    def _send(self, status: HTTPStatus, data: bytes, kind: str, tag: str = "", *, body: bool = True) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-cache")  # ask each time: the array may have been rendered again
        self.send_header("X-Content-Type-Options", "nosniff")
        if tag:
            self.send_header("ETag", tag)
        if status != HTTPStatus.NOT_MODIFIED:
            self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if body:
            self.wfile.write(data)

    def log_message(self, format: str, *args: Any) -> None:
        """Report nothing: the terminal shows the progress of the tiles."""
