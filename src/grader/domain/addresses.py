"""Which URLs this service may send requests to: those of public hosts, never of the network that it runs in. A name is
judged by the addresses that it resolves to, at every request anew."""

import re
from collections.abc import Collection
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address, IPv6Network, ip_address
from urllib.parse import urlsplit

LENGTH = 2000
"""Longest URL [characters]."""

PORTS = {"https": 443, "http": 80}

GLOBAL_V6 = IPv6Network("2000::/3")
TUNNELS = (IPv6Network("2001::/32"), IPv6Network("2002::/16"))
"""Teredo and 6to4: their addresses hold IPv4 addresses."""

NAME = re.compile(r"(?=.{1,253}$)[a-z0-9]([a-z0-9_-]{0,61}[a-z0-9])?(\.[a-z0-9]([a-z0-9_-]{0,61}[a-z0-9])?)*")
NUMERIC_END = re.compile(r"(^|\.)(0x[0-9a-f]*|[0-9]+)$")
"""A host that ends in such a label is an IPv4 address to some resolvers. Source: URL Standard, "ends in a number"."""

NOT_PUBLIC = "The host of the URL is not on the public internet."


class RefusedURL(ValueError):
    """A URL to which no request is sent; the message says why."""


@dataclass(frozen=True)
class Endpoint:
    """Scheme, host and port of a URL; the host in lower case, without brackets."""

    scheme: str
    host: str
    port: int
    is_private: bool
    """Whether the operator has allowed the host, wherever it is."""


def resolve_endpoint(url: str, private_hosts: Collection[str] = ()) -> Endpoint:
    """Where a URL leads. Hosts in `private_hosts` may be private, and may use http. Raises RefusedURL."""
    if len(url) > LENGTH or not url.isascii() or not url.isprintable() or " " in url or "\\" in url:
        raise RefusedURL(f"A URL has at most {LENGTH} characters of ASCII, and neither blanks nor backslashes.")
    try:
        parts = urlsplit(url)
        host, port = (parts.hostname or "").rstrip("."), parts.port
    except ValueError as error:
        raise RefusedURL("This is no URL.") from error
    is_private = host in {name.lower() for name in private_hosts}
    if parts.scheme != "https" and not (parts.scheme == "http" and is_private):
        raise RefusedURL("The URL must begin with https://.")
    if "@" in parts.netloc:
        raise RefusedURL("The URL must not hold a user name or password.")
    address = read_literal(host)
    if not is_private:
        if address is not None:
            refuse_address(address)
        elif host == "localhost" or host.endswith(".localhost"):  # names of this machine: RFC 6761, 6.3
            raise RefusedURL(NOT_PUBLIC)
    return Endpoint(parts.scheme, host, PORTS[parts.scheme] if port is None else port, is_private)


def read_literal(host: str) -> IPv4Address | IPv6Address | None:
    """The address that a host is, in its usual form; None for a name. Raises RefusedURL for neither."""
    try:
        return ip_address(host)
    except ValueError as error:
        if NAME.fullmatch(host) is None or NUMERIC_END.search(host):
            raise RefusedURL("The host of the URL is neither a name nor an address in its usual form.") from error
        return None


def refuse_address(address: IPv4Address | IPv6Address) -> None:
    """Raises RefusedURL unless an address is a public one of a single host."""
    if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped
    public = address.is_global and not (address.is_multicast or address.is_reserved)
    if isinstance(address, IPv6Address):  # this leaves out NAT64, site-local and IPv4-compatible addresses too
        public = public and address in GLOBAL_V6 and not any(address in tunnel for tunnel in TUNNELS)
    if not public:
        raise RefusedURL(NOT_PUBLIC)
