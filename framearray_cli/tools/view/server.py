"""Serve the page and the tiles of one array to browsers, and nothing else.

A request never becomes a file name: it names one of the page's files, or is parsed as key, camera and light. Clients
are not trusted: a connection has a time limit at every stage, and when there are too many, the one that has waited
longest for its client is closed.
"""

import errno
import json
import re
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any
from urllib.parse import urlsplit

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import line_digest, reason

from .access import LOOPBACK, TOKEN, WANTED_HOST, WRONG_HOST, Access, access_to, find_place, shown_address
from .index import CONTENTS_FILE
from .pagefiles import content_type, page_files
from .tiles import COARSE_URL, INDEX_FILE, CoarseTiles, Tiles

MOST_CONNECTIONS = 512  # each has a thread
IDLE_S = 60.0  # until the first line of the next request has come
HEAD_S = 10.0  # for the other lines of a request
ANSWER_S = 120.0  # for making and sending an answer
TILE = re.compile(rf"/({COARSE_URL})?tiles/([\w-]+)/c(\d{{4,9}})(?:\.l(\d{{3,9}}))?\.jpg", re.ASCII)
NO_COOKIE: Mapping[str, str] = {}


@dataclass(slots=True)
class _Stage:
    """Stage of a connection: its deadline, and True if it waits for its client."""

    deadline: float
    waits: bool


class Connections:
    """The open connections of a server. Threads may share it."""

    def __init__(self, most: int = MOST_CONNECTIONS) -> None:
        self._most, self._lock = most, threading.Lock()
        self._stages: dict[socket.socket, _Stage] = {}  # in the order of the last change of stage

    def begin(self, connection: socket.socket, seconds: float, *, waits: bool) -> None:
        """Begin a stage of a connection, which may last that long; a new connection may take the place of another."""
        with self._lock:
            self._stages.pop(connection, None)
            if len(self._stages) >= self._most:
                waiting = (other for other, stage in self._stages.items() if stage.waits)
                self._close(next(waiting, next(iter(self._stages))))
            self._stages[connection] = _Stage(time.monotonic() + seconds, waits)

    def end(self, connection: socket.socket) -> None:
        """Forget a connection that is closed."""
        with self._lock:
            self._stages.pop(connection, None)

    def close_late(self) -> None:
        """Close the connections that are over their time."""
        now = time.monotonic()
        with self._lock:
            for connection in [one for one, stage in self._stages.items() if stage.deadline < now]:
                self._close(connection)

    def _close(self, connection: socket.socket) -> None:
        """End a connection under its thread, which then finds it at its end."""
        del self._stages[connection]
        with suppress(OSError):  # its client was faster
            connection.shutdown(socket.SHUT_RDWR)


class PageServer(ThreadingHTTPServer):
    """Answer requests, each connection in its own thread, until shut down.

    Attributes:
        access: who may ask.
        coarse: small pictures of an array that is being rendered.
    """

    daemon_threads = True
    request_queue_size = 256  # browsers open several connections at once

    def __init__(self, tiles: Tiles, port: int, host: str = LOOPBACK, threads: int = 1) -> None:
        """Listen.

        Args:
            port: 0 takes a free one.
            host: an address of this machine, or a name of it; others than this machine need a token.
            threads: that read coarse pictures at once.

        Raises:
            OutputError: host or port cannot be used.
        """
        self.tiles, self.page, self._lock = tiles, page_files(), threading.Lock()
        self.coarse, self.connections = CoarseTiles(threads), Connections()
        self._place = find_place(host)
        self.access, self.address_family = access_to(self._place), self._place.family
        try:
            super().__init__((self._place.address, port), _Handler)
        except (OSError, OverflowError) as error:
            if isinstance(error, OSError) and error.errno == errno.EADDRNOTAVAIL:
                raise OutputError(f"--host {host}: this machine has no such address; {WANTED_HOST}") from error
            why = reason(error) if isinstance(error, OSError) else str(error)
            at = "" if host == LOOPBACK else f"--host {host}, "
            raise OutputError(f"{at}port {port}: cannot be used: {why}; --port 0 takes one that is free") from error
        self.coarse.look(tiles.manifest)

    def server_bind(self) -> None:
        """Take the address, without asking the network for its name, which may take seconds."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self._place.address, self.server_address[1]

    @property
    def url(self) -> str:
        """The address of the page, with the token if it needs one."""
        query = f"?{TOKEN}={self.access.token}" if self.access.token else ""
        return f"http://{shown_address(self._place)}:{self.server_port}/{query}"

    def look_again(self) -> Tiles:
        """Return the tiles of the array as it is now: others if it has changed too much for those before.

        Raises:
            OutputError: the array cannot be read any more.
        """
        with self._lock:
            self.coarse.look(self.tiles.manifest)
            self.tiles = self.tiles.renewed(self.coarse.largest())
            return self.tiles

    def settle(self) -> Tiles:
        """Return the tiles of an array that is whole now, as they stay; the page loads itself again if they differ.

        Raises:
            OutputError: the array cannot be read any more.
        """
        self.look_again()
        with self._lock:
            self.tiles = self.tiles.settled()
            return self.tiles

    def look(self) -> dict[str, Any]:
        """Return the table of `contents.json` as of now.

        Raises:
            OutputError: the array cannot be read any more.
        """
        table = self.look_again().contents(live=True)
        with self._lock:
            return table | {"coarse": None if self.tiles.turning else self.coarse.table()}

    def service_actions(self) -> None:
        """Look after the connections; called several times per second."""
        self.connections.close_late()

    def shutdown_request(self, request: Any) -> None:
        self.connections.end(request)
        super().shutdown_request(request)

    def server_close(self) -> None:
        super().server_close()
        self.coarse.close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report nothing: a browser that leaves closes its connections in the middle of answers."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    connection: socket.socket
    default_request_version = "HTTP/1.0"  # of what cannot be read: so that its answer has a status
    protocol_version = "HTTP/1.1"  # keeps connections open: a drag requests hundreds of files
    server_version, sys_version = "framearray", ""
    disable_nagle_algorithm = True  # or else the end of an answer waits 40 ms for an acknowledgement
    wbufsize = -1  # sends head and body together

    def handle_one_request(self) -> None:
        self.server.connections.begin(self.connection, IDLE_S, waits=True)
        super().handle_one_request()

    def parse_request(self) -> bool:
        self.server.connections.begin(self.connection, HEAD_S, waits=True)
        good = super().parse_request()
        self.server.connections.begin(self.connection, ANSWER_S, waits=False)
        return good

    def do_GET(self) -> None:
        self._answer(body=True)

    def do_HEAD(self) -> None:
        self._answer(body=False)

    def _answer(self, body: bool) -> None:
        if self.headers.get("Content-Length", "0") != "0" or "Transfer-Encoding" in self.headers:
            self.close_connection = True  # its body would be read as the next request
            self._send(HTTPStatus.BAD_REQUEST, b"expected a request without a body\n", "text/plain", body=body)
            return
        cookie = f"framearray-{self.server.server_port}"
        host, cookies = self.headers.get("Host", ""), self.headers.get("Cookie", "")
        if refusal := self.server.access.refusal(host, self.path, cookies, cookie):
            status = HTTPStatus.MISDIRECTED_REQUEST if refusal == WRONG_HOST else HTTPStatus.FORBIDDEN
            self._send(status, refusal.encode(), "text/plain", body=body)
            return
        more = _set_cookie(self.server.access, cookie) if self.server.access.knows(self.path) else NO_COOKIE
        try:
            data, kind = self._find(urlsplit(self.path).path)
        except (OutputError, OSError, ValueError) as error:  # ValueError: a path that is no part of a URL
            self._send(HTTPStatus.NOT_FOUND, f"{error}\n".encode(errors="replace"), "text/plain", body=body)
            return
        more = {"ETag": f'"{line_digest(data).decode()}"', **more}
        if self.headers.get("If-None-Match") == more["ETag"]:
            self._send(HTTPStatus.NOT_MODIFIED, b"", kind, more, body=False)
        else:
            self._send(HTTPStatus.OK, data, kind, more, body=body)

    def _find(self, path: str) -> tuple[bytes, str]:
        """Return content and its type."""
        tiles = self.server.tiles
        if match := TILE.fullmatch(path):
            coarse, key, c, l = match.groups()
            if coarse:
                if self.server.coarse.tiles is None:
                    raise OutputError(f"{path}: there is no coarse array any more")
                tiles = self.server.coarse.tiles
            file = tiles.ensure_tile(key, int(c), None if l is None else int(l))
            return file.read_bytes(), "image/jpeg"
        if path == f"/{INDEX_FILE}":
            return (tiles.folder / INDEX_FILE).read_bytes(), "application/json"
        if path == f"/{CONTENTS_FILE}":
            return json.dumps(self.server.look()).encode(), "application/json"
        name = path.removeprefix("/") or "index.html"
        if name in tiles.views.files:
            return tiles.views.files[name], content_type(name)
        if name not in self.server.page:
            raise OutputError(f"{path}: no such file")
        return self.server.page[name], content_type(name)

    def _send(
        self, status: HTTPStatus, data: bytes, kind: str, more: Mapping[str, str] = NO_COOKIE, *, body: bool = True
    ) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-cache")  # ask each time: the array may have been rendered again
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")  # the address may hold the token
        for name, value in more.items():
            self.send_header(name, value)
        if status != HTTPStatus.NOT_MODIFIED:
            self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if body:
            self.wfile.write(data)

    def log_message(self, format: str, *args: Any) -> None:
        """Report nothing: the terminal shows the progress of the tiles."""


def _set_cookie(access: Access, name: str) -> Mapping[str, str]:
    return {"Set-Cookie": f"{name}={access.token}; Path=/; HttpOnly; SameSite=Strict"}
