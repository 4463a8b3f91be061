"""Requests to servers of others: only to public hosts, to the address that was checked, within time and size. The host
is resolved here, every address is checked, and the connection goes to one of them: a name that resolves otherwise a
moment later (DNS rebinding) changes nothing. TLS still proves the name. Redirects are not followed, proxies of the
environment are not used, and bodies are not decompressed."""

import asyncio
import json
import socket
import ssl
from collections.abc import Awaitable, Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cache
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import Any

import httpx2

from grader.domain.addresses import Endpoint, read_literal, refuse_address, resolve_endpoint
from grader.platforms.sending.failures import Oversized, TooSlow, Unreachable

TIME_MAX_S = 20.0
"""For a whole request, with resolving the name [s]."""

CONNECT_S = 5.0
"""For one address to take the connection [s]."""

BODY_MAX = 1_000_000
"""Bytes of a response."""

HEADERS = {"Accept-Encoding": "identity", "User-Agent": "mujoco-grader", "Connection": "close"}
"""Of every request."""

Address = IPv4Address | IPv6Address
Resolve = Callable[[str, int], Awaitable[list[Address]]]
"""The addresses of a host and port. Raises OSError."""


@dataclass(frozen=True)
class Response:
    """What a server answered. Names of headers are in lower case."""

    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def text(self) -> str:
        """The beginning of the body, for a message to the operator."""
        return self.body[:300].decode(errors="replace")

    def json(self) -> Any:
        """Returns the body as JSON. Raises Unreachable if it is none."""
        try:
            return json.loads(self.body)
        except (ValueError, RecursionError) as error:
            raise Unreachable("The server answered something else than JSON.") from error


async def resolve(host: str, port: int) -> list[Address]:
    """Asks the system's resolver."""
    entries = await asyncio.get_running_loop().getaddrinfo(host, port, type=socket.SOCK_STREAM)
    return list(dict.fromkeys(ip_address(str(entry[4][0]).partition("%")[0]) for entry in entries))


@cache
def load_certificates() -> ssl.SSLContext:
    """Returns the authorities that the system trusts; to read them takes longer than a request."""
    return ssl.create_default_context()


@dataclass(frozen=True)
class Outgoing:
    """Sends requests. `private_hosts` are names or addresses that are allowed although they are not public."""

    private_hosts: Collection[str] = ()
    resolve: Resolve = resolve
    tls: Callable[[], ssl.SSLContext] = load_certificates
    time_max_s: float = TIME_MAX_S
    body_max: int = field(default=BODY_MAX)

    async def request(
        self, method: str, url: str, *, headers: Mapping[str, str] | None = None, body: bytes | None = None,
        reads: bool = True,
    ) -> Response:  # fmt: skip
        """Sends one request; without `reads` only the status and headers of the answer are read. Raises RefusedURL for
        a URL that is not allowed, and Unreachable."""
        endpoint = resolve_endpoint(url, self.private_hosts)
        try:
            async with asyncio.timeout(self.time_max_s):
                addresses = await self._addresses(endpoint)
                return await self._first_of(addresses, endpoint, self._request(method, url, headers, body), reads)
        except socket.gaierror as error:
            raise Unreachable(f"The name {endpoint.host} has no address.") from error
        except TimeoutError as error:
            raise TooSlow(f"The server did not answer within {self.time_max_s:g} s.") from error
        except httpx2.TimeoutException as error:
            raise TooSlow(f"The request failed: {type(error).__name__}.") from error
        except (httpx2.HTTPError, httpx2.InvalidURL, OSError) as error:
            raise Unreachable(f"The request failed: {type(error).__name__}.") from error

    async def _addresses(self, endpoint: Endpoint) -> list[Address]:
        """Returns every address of the host. Raises RefusedURL if one of them is not public."""
        known = read_literal(endpoint.host)
        addresses = [known] if known is not None else await self.resolve(endpoint.host, endpoint.port)
        if not addresses:
            raise Unreachable("The host of the URL has no address.")
        if not endpoint.is_private:
            for address in addresses:
                refuse_address(address)
        return addresses

    def _request(self, method: str, url: str, headers: Mapping[str, str] | None, body: bytes | None) -> httpx2.Request:
        return httpx2.Request(method, url, headers=HEADERS | dict(headers or {}), content=body)

    async def _first_of(
        self, addresses: list[Address], endpoint: Endpoint, request: httpx2.Request, reads: bool
    ) -> Response:
        """Renders the answer of the first address that takes a connection."""
        for address in addresses[:-1]:
            try:
                return await self._send(address, endpoint, request, reads)
            except (httpx2.ConnectError, httpx2.ConnectTimeout):
                continue
        return await self._send(addresses[-1], endpoint, request, reads)

    async def _send(self, address: Address, endpoint: Endpoint, request: httpx2.Request, reads: bool) -> Response:
        pinned = httpx2.Request(
            request.method,
            request.url.copy_with(host=str(address)),
            headers=request.headers,  # with the name in `Host`
            content=request.content,
            extensions={
                "sni_hostname": endpoint.host,
                "timeout": httpx2.Timeout(self.time_max_s, connect=CONNECT_S).as_dict(),
            },
        )
        async with httpx2.AsyncHTTPTransport(verify=self.tls(), trust_env=False) as transport:
            response = await transport.handle_async_request(pinned)
            try:
                body = await self._body(response) if reads else b""
            finally:
                await response.aclose()
        return Response(response.status_code, dict(response.headers.items()), body)

    async def _body(self, response: httpx2.Response) -> bytes:
        read = bytearray()
        async for part in response.aiter_raw():
            read += part
            if len(read) > self.body_max:
                raise Oversized(f"The server answered more than {self.body_max} bytes.")
        return bytes(read)
