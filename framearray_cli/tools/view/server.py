"""Serve the page and the tiles of one array to browsers, and nothing else.

A request never becomes a file name: it names one of the page's files, or is parsed as key, camera and light.

On an address of the machine itself a request must name the machine as its host: under another name a page from
elsewhere may send the request, whose domain was made to point here. On all other addresses each request needs the
token, in the query of its address or in the cookie that the answer to such a request sets.
"""

import errno
import json
import re
import secrets
import socket
import threading
from contextlib import suppress
from dataclasses import dataclass
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from ipaddress import ip_address
from pathlib import PurePosixPath
from socketserver import TCPServer
from typing import Any, NamedTuple
from urllib.parse import parse_qs, urlsplit

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import line_digest, reason

from .index import CONTENTS_FILE
from .tiles import COARSE_URL, INDEX_FILE, CoarseTiles, Tiles

LOOPBACK = "127.0.0.1"
OWN_NAMES = ("127.0.0.1", "localhost", "[::1]")
TOKEN_BYTES = 16
TOKEN = "token"
REFUSED = "this page needs the whole address that `framearray` printed, with its token\n"
WANTED_HOST = "expected an address of this machine, or 0.0.0.0 for all"
WRONG_HOST = "not this host\n"
_ELSEWHERE = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}  # unused: for documentation [RFC 5737, 3849]


class Place(NamedTuple):
    """The address of this machine that a server listens at, and its family."""

    family: socket.AddressFamily
    address: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """The rule of a server.

    Attributes:
        token: "" on an address that only this machine reaches.
        names: of the host, without a token.
    """

    token: str
    names: tuple[str, ...] = OWN_NAMES

    def refusal(self, host: str, target: str, cookies: str, cookie: str) -> str:
        """Return why a request is refused; "" if it is not.

        Args:
            host: its header Host.
            target: its path with the query.
            cookies: its header Cookie.
            cookie: name of ours.
        """
        if not self.token:
            name = host.rpartition(":")[0] if not host.endswith("]") else host
            return "" if (name or host) in self.names else WRONG_HOST
        return "" if self.knows(target) or _same(_cookie(cookies, cookie), self.token) else REFUSED

    def knows(self, target: str) -> bool:
        """Return whether the query of a path has the token."""
        with suppress(ValueError):
            found = parse_qs(urlsplit(target).query, max_num_fields=16).get(TOKEN, [""])
            return bool(self.token) and _same(found[0], self.token)
        return False


def find_place(host: str) -> Place:
    """Resolve a name or an address of this machine.

    Raises:
        OutputError: there is no such name.
    """
    try:
        family, *_, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    except (OSError, UnicodeError) as error:
        why = reason(error) if isinstance(error, OSError) else "not a name"
        raise OutputError(f"--host {host}: {why}; {WANTED_HOST}") from error
    return Place(family, str(address[0]))


def access_to(place: Place) -> Access:
    """Return the rule for a server at an address: a new token, unless only this machine reaches it."""
    if ip_address(place.address.partition("%")[0]).is_loopback:
        return Access(token="", names=(*OWN_NAMES, shown_address(place)))
    return Access(token=secrets.token_urlsafe(TOKEN_BYTES))


def shown_address(place: Place) -> str:
    """Return the address of a server for other machines, as in a URL."""
    address = place.address
    if ip_address(address.partition("%")[0]).is_unspecified:
        address = _outward(place.family) or socket.gethostname()
    return f"[{address}]" if ":" in address else address


def _outward(family: socket.AddressFamily) -> str:
    """Return the address of this machine in the network that it sends through; "" without a network."""
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((_ELSEWHERE[family], 9))  # of datagrams: nothing is sent
            return str(probe.getsockname()[0])
        except (OSError, KeyError):
            return ""


def _cookie(header: str, name: str) -> str:
    with suppress(CookieError):
        if found := SimpleCookie(header).get(name):
            return found.value
    return ""


def _same(text: str, token: str) -> bool:
    """Compare in a time that does not depend on where they differ."""
    return secrets.compare_digest(text.encode(errors="replace"), token.encode())


TILE = re.compile(rf"/({COARSE_URL})?tiles/([\w-]+)/c(\d{{4,9}})(?:\.l(\d{{3,9}}))?\.jpg", re.ASCII)
SOURCE = re.compile(r"/sources/([\w-]+)/c(\d{4,9})\.l(\d{3,9})\.exr", re.ASCII)
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".json": "application/json",
}

TYPE_LINES = re.compile(rb"^ */\*\*(?:[^*]|\*(?!/))*\*/\r?\n", re.MULTILINE)  # JSDoc comments with lines of their own


def page_files() -> dict[str, bytes]:
    """Read all files: name -> content; JavaScript without its types, which only `deno check` reads."""
    found = {}
    for entry in (files(__package__) / "page").iterdir():
        suffix = PurePosixPath(entry.name).suffix
        if suffix in TYPES:
            data = entry.read_bytes()
            found[entry.name] = TYPE_LINES.sub(b"", data) if suffix == ".js" else data
    return found


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
            port: 0 selects a free one.
            host: an address of this machine, or a name of it; others than this machine need a token.
            threads: that read coarse pictures at once.

        Raises:
            OutputError: host or port cannot be used.
        """
        self.tiles, self.page, self._lock = tiles, page_files(), threading.Lock()
        self.coarse = CoarseTiles(threads)
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
        """Bind the address without a look-up of its name, which may take seconds."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = self._place.address, self.server_address[1]

    @property
    def url(self) -> str:
        """The address of the page, with the token if it needs one."""
        query = f"?{TOKEN}={self.access.token}" if self.access.token else ""
        return f"http://{shown_address(self._place)}:{self.server_port}/{query}"

    def look_again(self) -> Tiles:
        """Return the tiles of the array as it is now: others if it has changed too much for those before."""
        with self._lock:
            self.coarse.look(self.tiles.manifest)
            self.tiles = self.tiles.renewed(self.coarse.largest())
            return self.tiles

    def settle(self) -> Tiles:
        """Return the tiles of an array that is whole now, as they stay; the page loads itself again if they differ."""
        self.look_again()
        with self._lock:
            self.tiles = self.tiles.settled()
            return self.tiles

    def look(self) -> dict[str, Any]:
        """Return the table of `contents.json` as of now."""
        table = self.look_again().contents(live=True)
        with self._lock:
            return table | {"coarse": self.coarse.table()}

    def server_close(self) -> None:
        super().server_close()
        self.coarse.close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Report nothing: a browser that leaves closes its connections in the middle of answers."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    timeout = 60.0  # seconds that a connection waits for its client
    default_request_version = "HTTP/1.0"  # of what cannot be read: so that its answer has a status
    protocol_version = "HTTP/1.1"  # keeps connections open: a drag requests hundreds of files
    server_version, sys_version = "framearray", ""
    disable_nagle_algorithm = True  # or else the end of an answer waits 40 ms for an acknowledgement
    wbufsize = -1  # sends head and body together

    def do_GET(self) -> None:
        """Send an answer, without its body to a request of HEAD."""
        cookie, more, kind = f"framearray-{self.server.server_port}", dict[str, str](), "text/plain"
        access, host, cookies = self.server.access, self.headers.get("Host", ""), self.headers.get("Cookie", "")
        if self.headers.get("Content-Length", "0") != "0" or "Transfer-Encoding" in self.headers:
            self.close_connection = True  # its body would be read as the next request
            status, data = HTTPStatus.BAD_REQUEST, b"expected a request without a body\n"
        elif refusal := access.refusal(host, self.path, cookies, cookie):
            status = HTTPStatus.MISDIRECTED_REQUEST if refusal == WRONG_HOST else HTTPStatus.FORBIDDEN
            data = refusal.encode()
        else:
            try:
                status, (data, kind) = HTTPStatus.OK, self._find(urlsplit(self.path).path)
                more["ETag"] = f'"{line_digest(data).decode()}"'
                if access.knows(self.path):
                    more["Set-Cookie"] = f"{cookie}={access.token}; Path=/; HttpOnly; SameSite=Strict"
                if self.headers.get("If-None-Match") == more["ETag"]:
                    status = HTTPStatus.NOT_MODIFIED
            except (OutputError, OSError, ValueError) as error:  # ValueError: a path that is no part of a URL
                status, data = HTTPStatus.NOT_FOUND, f"{error}\n".encode(errors="replace")
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-cache")  # check each time: the array may have been rendered again
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Referrer-Policy", "no-referrer")  # the address may contain the token
        for name, value in more.items():
            self.send_header(name, value)
        if status != HTTPStatus.NOT_MODIFIED:
            self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if self.command != "HEAD" and status != HTTPStatus.NOT_MODIFIED:
            self.wfile.write(data)

    do_HEAD = do_GET

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
        if match := SOURCE.fullmatch(path):
            return tiles.source_path(match[1], int(match[2]), int(match[3])).read_bytes(), "image/x-exr"
        if path == f"/{INDEX_FILE}":
            return (tiles.folder / INDEX_FILE).read_bytes(), "application/json"
        if path == f"/{CONTENTS_FILE}":
            return json.dumps(self.server.look()).encode(), "application/json"
        name = path.removeprefix("/") or "index.html"
        if name not in self.server.page:
            raise OutputError(f"{path}: no such file")
        return self.server.page[name], TYPES[PurePosixPath(name).suffix]

    def log_message(self, format: str, *args: Any) -> None:
        """Report nothing: the terminal shows the progress of the tiles."""
