"""Access to the page: for everyone on this machine, and from elsewhere with a token.

On an address of the machine itself a request must name the machine as its host: under another name a page from
elsewhere may be asking, whose domain was made to point here. On all other addresses each request has to bring the
token, in the query of its address or in the cookie that the answer to such a request sets.
"""

import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason

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
        return bool(self.token) and _same(parse_query(target).get(TOKEN, ""), self.token)


def parse_query(target: str) -> Mapping[str, str]:
    """Return the query of a path; of a name that comes twice, the first value; nothing if it cannot be read."""
    try:
        return {name: values[0] for name, values in parse_qs(urlsplit(target).query, max_num_fields=16).items()}
    except ValueError:
        return {}


def find_place(host: str) -> Place:
    """Return the address that a name or an address of this machine stands for.

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
    """Return the address that others reach a server at, as it stands in a URL."""
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
    try:
        found = SimpleCookie(header).get(name)
    except CookieError:
        return ""
    return found.value if found else ""


def _same(text: str, token: str) -> bool:
    """Compare in a time that does not depend on where they differ."""
    return secrets.compare_digest(text.encode(errors="replace"), token.encode())
