"""Addresses that platforms name: what is read of them before anything is done with them."""

from urllib.parse import SplitResult, parse_qsl, urlencode, urlsplit, urlunsplit

URL_CHARACTERS_MAX = 2000
DEFAULT_PORTS = {"http": 80, "https": 443}
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def parse_address(url: object) -> SplitResult | None:
    """The parts of an absolute http or https address; None for anything else, also with user information in it."""
    if not isinstance(url, str) or not 0 < len(url) <= URL_CHARACTERS_MAX or not url.isascii() or not url.isprintable():
        return None
    if any(character in url for character in ' \\<>"'):
        return None
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        return None
    if parts.scheme not in DEFAULT_PORTS or not parts.hostname or "@" in parts.netloc or port == 0:
        return None
    return parts


def read_origin(url: object) -> str:
    """`scheme://host[:port]` in lower case without a default port; empty for any other text."""
    parts = parse_address(url)
    if parts is None or parts.hostname is None:
        return ""
    host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
    port = "" if parts.port in (None, DEFAULT_PORTS[parts.scheme]) else f":{parts.port}"
    return f"{parts.scheme}://{host}{port}"


def is_at(origin: str, url: object) -> bool:
    """Says whether an address is at this origin, which is written in any form."""
    own = read_origin(origin)
    return own != "" and read_origin(url) == own


def is_of_platform(url: object) -> bool:
    """Says whether a platform may have this address: https, or http on the machine itself, for trying out."""
    parts = parse_address(url)
    return parts is not None and (parts.scheme == "https" or parts.hostname in LOOPBACK)


def add_query(url: str, **added: str) -> str:
    """Returns the address with parameters added to those that it has."""
    parts = urlsplit(url)
    query = parse_qsl(parts.query, keep_blank_values=True) + list(added.items())
    return urlunsplit(parts._replace(query=urlencode(query)))
