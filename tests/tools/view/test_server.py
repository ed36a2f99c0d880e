"""The server of the page: who may ask, and what clients can do to it that are slow, many or hostile."""

import http.client
import json
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest
from support import handmade

from framearray_cli.base.errors import OutputError
from framearray_cli.tools.view import server as module
from framearray_cli.tools.view.server import Access, Place, access_to, find_place, page_files, shown_address
from framearray_cli.tools.view.show import open_server, open_tiles

EVERYWHERE = "0.0.0.0"  # what is tested


@pytest.fixture(scope="module")
def tiles(tmp_path_factory):
    folder = tmp_path_factory.mktemp("array")
    handmade.plain(folder, n_c=2, n_l=2, layers=False)
    (folder / "secret.txt").write_text("secret")
    return open_tiles(folder, None, 1)


@pytest.fixture(scope="module")
def shared(tiles):
    """A server for the whole network."""
    with open_server(tiles, host=EVERYWHERE) as running:
        yield running


def ask(server, path, method="GET", **headers):
    """Status, headers and body of an answer."""
    with closing(http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)) as connection:
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()


def raw(server, data):
    """Send bytes; return all that comes until the server closes the connection."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=5.0) as connection:
        connection.sendall(data)
        connection.shutdown(socket.SHUT_WR)
        found = b""
        while part := connection.recv(65536):
            found += part
        return found


def test_on_this_machine_the_name_of_the_host_decides():
    access = access_to(find_place("localhost"))
    for host in ("127.0.0.1:80", "localhost", "localhost:8000", "[::1]:80", "[::1]"):
        assert access.refusal(host, "/", "", "c") == ""
    for host in ("", "example.org", "127.0.0.1.example.org:80", "localhost.example.org", "[::2]:80", ":", "user@x:1"):
        assert access.refusal(host, "/?token=", "", "c") == "not this host\n"
    assert access_to(find_place("127.0.0.2")).refusal("127.0.0.2:80", "/", "", "c") == ""


def test_elsewhere_the_token_decides():
    access = Access(token="a-token")
    assert access.refusal("example.org", "/x?token=a-token", "", "c") == ""
    assert access.refusal("", "/x?y=1&token=a-token", "", "c") == ""
    assert access.refusal("", "/x", "other=1; c=a-token", "c") == ""
    for target, cookies in (
        ("/", ""), ("/?token=", ""), ("/?token=a-toke", ""), ("/?token=a-token1", ""), ("/?token=A-TOKEN", ""),
        ("/?token=%C3%A4", ""), ("/#token=a-token", ""), ("/token=a-token", ""), ("/", "c="), ("/", "c=a-toke"),
        ("/", "d=a-token"), ("/", "\x00;;=c=a-token"), ("/?token=b&token=a-token", ""), ("//[?token=a", ""),
        ("/?" + "a=1&" * 5000 + "token=a-token", ""),
    ):  # fmt: skip
        assert "token" in access.refusal("localhost", target, cookies, "c"), (target, cookies)
    tokens = {access_to(Place(socket.AF_INET, EVERYWHERE)).token for _ in range(20)}
    assert len(tokens) == 20 and all(len(token) >= 22 for token in tokens)


def test_an_address_that_is_none_is_reported(tiles):
    for host in ("no such name", "x" * 300, "\x00", "256.1.1.1"):
        with pytest.raises(OutputError, match=r"--host .*expected an address of this machine"):
            find_place(host)
    said = r"--host 192\.0\.2\.1: this machine has no such address; expected an address of"
    with pytest.raises(OutputError, match=said), open_server(tiles, host="192.0.2.1"):
        pass
    assert shown_address(Place(socket.AF_INET, "192.0.2.1")) == "192.0.2.1"
    assert shown_address(Place(socket.AF_INET6, "2001:db8::7")) == "[2001:db8::7]"
    assert shown_address(Place(socket.AF_INET, EVERYWHERE)) not in ("", EVERYWHERE)


def test_a_shared_page_needs_the_token_for_everything(shared):
    assert shared.url.endswith(f":{shared.server_port}/?token={shared.access.token}")
    paths = ("/", "/main.js", "/index.json", "/contents.json", "/tiles/light/c0000.jpg", "/tiles/light/c0001.l001.jpg")
    for path in (*paths, "/none", "/../secret.txt"):
        status, headers, body = ask(shared, path)
        assert (status, "Set-Cookie" in headers) == (403, False) and b"token" in body and len(body) < 100
        assert ask(shared, f"{path}?token=wrong")[0] == 403
    status, headers, _ = ask(shared, f"/?token={shared.access.token}", Host="any.example.org")
    cookie = headers["Set-Cookie"]
    assert status == 200 and "HttpOnly" in cookie and "SameSite=Strict" in cookie
    assert headers["Referrer-Policy"] == "no-referrer" and "Python" not in headers["Server"]
    for path in paths:
        status, headers, _ = ask(shared, path, Cookie=cookie.partition(";")[0])
        assert status == 200 and "Set-Cookie" not in headers
    assert ask(shared, "/none", Cookie=cookie.partition(";")[0])[0] == 404


@pytest.mark.parametrize(
    "path",
    [
        "/secret.txt", "/%2e%2e/secret.txt", "/%252e%252e/secret.txt", "/..%2fsecret.txt", "/..%5csecret.txt",
        "/..\\secret.txt", "//secret.txt", "///etc/passwd", "/tiles/light/../../../secret.txt", "/C:/secret.txt",
        "/tiles/%2e%2e/c0000.jpg", "/tiles/../c0000.jpg", "/tiles/light/c0000.jpg/../../secret.txt", "/%00.js",
        "/tiles/light/c\u0660\u0660\u0660\u0660.jpg", "/coarse/tiles/light/c0000.jpg", "/coarse/../secret.txt", "http://x/secret.txt",
        "/manifest.toml", "/tiles/", "/tiles/light/", "/tiles/none/c0000.jpg", "/__init__.py", "/page/main.js",
        "/tiles/light/c0002.jpg", "/tiles/light/c0000.l002.jpg", "/tiles/light/c0000000000001.jpg",
        "/../secret.txt", "/tiles/../../secret.txt", "/tiles/light/c999999999.jpg",
        "/tiles/light/c0000.l999999999.jpg", "/.view/index.json", "*", "//[",
    ],
)  # fmt: skip
def test_no_path_leads_to_a_file(shared, path):
    cookie = f"framearray-{shared.server_port}={shared.access.token}"
    answer = raw(shared, f"GET {path} HTTP/1.1\r\nCookie: {cookie}\r\nConnection: close\r\n\r\n".encode())
    assert answer.startswith((b"HTTP/1.1 404", b"HTTP/1.1 400")) and not answer.endswith(b"secret")


@pytest.mark.parametrize(
    ("data", "status"),
    [
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(256)), (400,)),  # TLS
        (b"GET\r\n\r\n", (400,)),
        (b"GET / HTTP/9.9\r\n\r\n", (505,)),
        (b"GET / HTTP/1.1.1\r\n\r\n", (400,)),
        (b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n", (414,)),
        (b"GET / HTTP/1.1\r\n" + b"".join(b"X-%d: 1\r\n" % i for i in range(200)) + b"\r\n", (431,)),
        (b"GET / HTTP/1.1\r\nX: " + b"a" * 70_000 + b"\r\n\r\n", (431,)),
        (b"POST / HTTP/1.1\r\nContent-Length: 4\r\n\r\nabcd", (501,)),
        (b"DELETE /index.json HTTP/1.1\r\n\r\n", (501,)),
        (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", (400, 505)),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 40\r\n\r\nGET /index.json HTTP/1.1\r\n\r\n", (400,)),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", (400,)),
        (b"\r\n\r\n", ()),
        (b"", ()),
    ],
)
def test_garbage_is_refused_and_the_connection_closed(shared, data, status):
    answer = raw(shared, data)
    first = answer.split(b"\r\n")[0]
    assert answer.count(b"Server: ") <= 1 and (not status or int(first.split()[1]) in status), first
    assert ask(shared, f"/?token={shared.access.token}", "HEAD")[0] == 200, "the server goes on"


def test_silent_clients_are_closed(tiles, monkeypatch):
    monkeypatch.setattr(module._Handler, "timeout", 0.5)
    with open_server(tiles) as server:
        with socket.create_connection(("127.0.0.1", server.server_port), timeout=10) as connection:
            connection.sendall(b"GET / HTTP/1.1\r\nX: ")
            assert connection.recv(1) == b"", "closed"
        assert ask(server, "/")[0] == 200


def test_many_clients_at_once(shared):
    """All are answered, and their threads end."""
    n, path = 200, f"/tiles/light/c0001.l001.jpg?token={shared.access.token}"
    before = threading.active_count()
    with ThreadPoolExecutor(n) as pool:
        barrier = threading.Barrier(n)

        def one(_):
            barrier.wait(30)
            return ask(shared, path)[0]

        assert list(pool.map(one, range(n))) == [200] * n
    end = time.monotonic() + 10
    while threading.active_count() > before + 5 and time.monotonic() < end:
        time.sleep(0.05)
    assert threading.active_count() <= before + 5


def test_the_server_makes_tiles_that_are_asked_for(tiles):
    with open_server(tiles) as server:
        status, headers, body = ask(server, "/tiles/light/c0001.l000.jpg")
        assert (status, headers["Content-Type"], body[:2]) == (200, "image/jpeg", b"\xff\xd8")
        again = ask(server, "/tiles/light/c0001.l000.jpg", **{"If-None-Match": headers["ETag"]})
        assert (again[0], again[2]) == (304, b"")
        assert ask(server, "/tiles/light/c0000.jpg?x=1")[0] == 200
        status, headers, nothing = ask(server, "/", "HEAD")
        assert (status, nothing) == (200, b"") and int(headers["Content-Length"]) > 1000
        assert ask(server, "/main.js")[1]["Content-Type"].startswith("text/javascript")
        index, contents = (json.loads(ask(server, f"/{name}.json")[2]) for name in ("index", "contents"))
        assert (index["n_cameras"], contents["live"], contents["lacking"]) == (2, True, [0, ""])
        assert index["digest"] == contents["index"]
        assert ask(server, "/", Host=f"localhost:{server.server_port}")[0] == 200
        assert ask(server, "/index.json", Host=f"example.org:{server.server_port}")[0] == 421
        port = server.server_port
        with pytest.raises(OutputError, match=rf"port {port}: cannot be used"), open_server(server.tiles, port):
            pass


def test_the_page_is_in_the_package():
    page = page_files()
    assert {"index.html", "main.js", "style.css", "icon.svg"} <= set(page)
    assert not [name for name, data in page.items() if b"@import {" in data or b"@type {(" in data], "types stay here"
    foreign = [name for name, data in page.items() if b"http://" in data.replace(b"http://www.w3.org/2000/svg", b"")]
    assert not foreign, "the page requests nothing from elsewhere"


def test_what_is_there_is_counted(tmp_path):
    manifest = handmade.plain(tmp_path, n_c=3, n_l=2)
    for file in manifest.directory.glob("*c0001.l*"):
        file.unlink()
    with open_server(open_tiles(tmp_path, None, 1)) as server:
        contents = json.loads(ask(server, "/contents.json")[2])
        assert contents["images"] == [4, 6] and contents["coarse"] is None
