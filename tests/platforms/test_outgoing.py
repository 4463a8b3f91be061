"""Requests go to public hosts alone, to the address that was checked, within time and size."""

import asyncio
import os
import socket
import ssl
import time
from ipaddress import ip_address
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.domain.addresses import RefusedURL, refuse_address, resolve_endpoint
from grader.platforms.sending.failures import Unreachable
from grader.platforms.sending.outgoing import Address, Outgoing, Response
from platforms.certificates import contexts
from platforms.receivers import HERE, Answer, Asked, receiving, resolving

PUBLIC = "93.184.215.14"


def ask(outgoing: Outgoing, url: str, method: str = "GET", body: bytes | None = None) -> Response:
    return asyncio.run(outgoing.request(method, url, headers={"X-Test": "1"}, body=body))


REFUSED = {
    "loopback": "https://127.0.0.1/",
    "loopback beyond .1": "https://127.255.255.254/",
    "loopback of IPv6": "https://[::1]/",
    "any address": "https://0.0.0.0/",
    "any address of IPv6": "https://[::]/",
    "private 10": "https://10.0.0.1/",
    "private 172.16": "https://172.16.0.1/",
    "private 192.168": "https://192.168.1.1/",
    "private IPv6": "https://[fd00::1]/",
    "site-local IPv6": "https://[fec0::1]/",
    "link-local": "https://169.254.169.254/latest/meta-data",
    "link-local IPv6": "https://[fe80::1]/",
    "carrier-grade NAT": "https://100.64.0.1/",
    "benchmarks": "https://198.18.0.1/",
    "documentation": "https://192.0.2.1/",
    "multicast": "https://224.0.0.1/",
    "multicast IPv6": "https://[ff0e::1]/",
    "broadcast": "https://255.255.255.255/",
    "reserved": "https://240.0.0.1/",
    "mapped IPv6": "https://[::ffff:127.0.0.1]/",
    "mapped IPv6, private": "https://[::ffff:a00:1]/",
    "compatible IPv6": "https://[::127.0.0.1]/",
    "NAT64": "https://[64:ff9b::7f00:1]/",
    "NAT64 of a network": "https://[64:ff9b:1::a00:1]/",
    "6to4": "https://[2002:7f00:1::]/",
    "Teredo": "https://[2001:0:7f00:1::]/",
    "zone": "https://[fe80::1%25eth0]/",
    "decimal": "https://2130706433/",
    "hex": "https://0x7f000001/",
    "hex label": "https://0x7f.0.0.1/",
    "octal": "https://0177.0.0.1/",
    "short": "https://127.1/",
    "decimal of a public host": "https://134744072/",
    "numeric end": "https://hooks.example.0x1/",
    "dot": "https://127.0.0.1./",
    "user": "https://user@hooks.example/",
    "user and password": "https://hooks.example:443@127.0.0.1/",
    "http": "http://hooks.example/",
    "file": "file:///etc/passwd",
    "gopher": "gopher://hooks.example/",
    "javascript": "javascript:alert(1)",
    "no scheme": "hooks.example/path",
    "no host": "https:///path",
    "port that is none": "https://hooks.example:99999/",
    "backslash": "https://hooks.example\\@127.0.0.1/",
    "blank": "https://hooks.example /",
    "line end": "https://hooks.example/\r\nHost: inside",
    "name of this machine": "https://localhost/",
    "below a name of this machine": "https://hooks.LOCALHOST.:8443/",
    "other script": "https://ⓛocalhost/",
    "full-width dots": "https://127。0。0。1/",
    "too long": "https://hooks.example/" + "a" * 2000,
}  # fmt: skip


@pytest.mark.parametrize("url", REFUSED.values(), ids=REFUSED)
def test_a_url_that_leads_inside_or_is_none_is_refused_without_a_connection(url: str) -> None:
    def never(_host: str, _port: int) -> "asyncio.Future[list[Address]]":
        pytest.fail("the host was resolved")

    with pytest.raises(RefusedURL):
        ask(Outgoing(resolve=never), url)


INSIDE = ("127.0.0.1", "10.1.2.3", "169.254.169.254", "100.100.0.1", "::1", "::ffff:192.168.0.1", "fd12::1",
          "fe80::2", "64:ff9b::a00:1", "2002:a00:1::", "0.0.0.0", "224.0.0.9")  # fmt: skip


@pytest.mark.parametrize("address", INSIDE)
def test_a_name_with_one_address_inside_is_refused(address: str) -> None:
    for addresses in ((address,), (PUBLIC, address)):
        with pytest.raises(RefusedURL, match="not on the public internet"):
            ask(Outgoing(resolve=resolving(*addresses)), "https://hooks.example/")


@pytest.mark.parametrize("url", ["https://93.184.215.14/", "https://[2606:4700::1111]:8443/a?b", "https://a-b.example"])
def test_public_urls_are_allowed(url: str) -> None:
    resolve_endpoint(url)


@given(st.ip_addresses(v=4))
def test_an_ipv4_address_is_allowed_only_where_no_form_of_ipv6_hides_a_refused_one(address: Address) -> None:
    """Mapped, an address is allowed as it is by itself; embedded in any other way it never is."""

    def allowed(one: str) -> bool:
        try:
            refuse_address(ip_address(one))
        except RefusedURL:
            return False
        return True

    assert allowed(f"::ffff:{address}") == allowed(str(address))
    number = int(address)
    words = f"{number >> 16:x}:{number & 0xFFFF:x}"
    assert not any(map(allowed, (f"64:ff9b::{words}", f"2002:{words}::", f"2001::{words}", f"::{words}")))


def test_a_host_that_the_operator_allows_may_be_private_and_use_http() -> None:
    seen: list[Asked] = []

    def respond(asked: Asked) -> Answer:
        seen.append(asked)
        return Answer(201, b"done", {"X-Told": "yes"})

    with receiving(respond) as port:
        response = ask(Outgoing([HERE]), f"http://{HERE}:{port}/a/b?c=%2Fd", "POST", b"body")
        by_name = ask(Outgoing(["Campus.example"], resolving(HERE)), f"http://campus.EXAMPLE:{port}/")
        for other in (f"http://localhost:{port}/", f"https://localhost:{port}/"):
            with pytest.raises(RefusedURL):
                ask(Outgoing([HERE]), other)
    assert (response.status, response.headers["x-told"], response.body) == (201, "yes", b"done")
    assert by_name.status == 201
    assert [(one.method, one.path, one.body) for one in seen] == [("POST", "/a/b?c=%2Fd", b"body"), ("GET", "/", b"")]
    assert [one.headers["host"] for one in seen] == [f"{HERE}:{port}", f"campus.example:{port}"]
    assert seen[0].headers["x-test"] == "1"


def test_a_redirect_is_not_followed() -> None:
    seen = []

    def respond(asked: Asked) -> Answer:
        seen.append(asked.path)
        return Answer(302, b"", {"Location": "/inside"})

    with receiving(respond) as port:
        assert ask(Outgoing([HERE]), f"http://{HERE}:{port}/").status == 302
    assert seen == ["/"]


def test_a_large_answer_is_cut_off_and_none_is_decompressed() -> None:
    bomb = b"\x1f\x8b" + b"a" * 100

    def respond(asked: Asked) -> Answer:
        assert asked.headers["accept-encoding"] == "identity"
        return Answer(200, bomb if asked.path == "/bomb" else b"a" * 5000, {"Content-Encoding": "gzip"})

    with receiving(respond) as port:
        outgoing = Outgoing([HERE], body_max=4999)
        with pytest.raises(Unreachable, match="more than 4999 bytes"):
            ask(outgoing, f"http://{HERE}:{port}/")
        assert ask(outgoing, f"http://{HERE}:{port}/bomb").body == bomb
        unread = asyncio.run(outgoing.request("GET", f"http://{HERE}:{port}/", reads=False))
        assert (unread.status, unread.body) == (200, b"")


def test_a_server_that_dawdles_is_given_up_as_a_whole() -> None:
    """Every byte comes in time, the answer never."""
    with socket.create_server((HERE, 0)) as listener:

        async def drip() -> None:
            taken, _ = await asyncio.get_running_loop().sock_accept(listener)
            with taken:
                for byte in b"HTTP/1.1 200 OK\r\nX-Slow: " + b"a" * 1000:
                    await asyncio.get_running_loop().sock_sendall(taken, bytes([byte]))
                    await asyncio.sleep(0.05)

        async def both() -> None:
            listener.setblocking(False)
            server = asyncio.ensure_future(drip())
            try:
                await Outgoing([HERE], time_max_s=0.4).request("GET", f"http://{HERE}:{listener.getsockname()[1]}/")
            finally:
                server.cancel()

        began = time.monotonic()
        with pytest.raises(Unreachable, match=r"did not answer within 0.4 s"):
            asyncio.run(both())
        assert time.monotonic() - began < 5


def test_a_resolver_that_dawdles_is_given_up() -> None:
    async def slow(_host: str, _port: int) -> list[Address]:
        await asyncio.sleep(30)
        return []

    with pytest.raises(Unreachable, match=r"within 0.2 s"):
        ask(Outgoing(resolve=slow, time_max_s=0.2), "https://hooks.example/")


def test_no_server_and_no_name_are_told_apart_from_refusals() -> None:
    with socket.create_server((HERE, 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(Unreachable, match="ConnectError"):
        ask(Outgoing([HERE]), f"http://{HERE}:{port}/")
    with pytest.raises(Unreachable, match="no address"):
        ask(Outgoing(resolve=resolving()), "https://hooks.example/")

    async def unknown(_host: str, _port: int) -> list[Address]:
        raise socket.gaierror("unknown")

    with pytest.raises(Unreachable, match=r"The name hooks\.example has no address\."):
        ask(Outgoing(resolve=unknown), "https://hooks.example/")


def test_the_connection_goes_to_the_checked_address_and_tls_proves_the_name(tmp_path: Path) -> None:
    """The name resolves once: a second answer that leads elsewhere (DNS rebinding) is never asked for."""
    server, client = contexts("hooks.example", tmp_path)
    asked_for: list[str] = []
    seen: list[str] = []

    async def resolve(host: str, _port: int) -> list[Address]:
        asked_for.append(host)
        return [ip_address(HERE)]

    def respond(asked: Asked) -> Answer:
        seen.append(asked.headers["host"])
        return Answer(200, b"secure")

    def trusting() -> ssl.SSLContext:
        return client

    with receiving(respond, server) as port:
        names = ["hooks.example", "other.example"]
        outgoing = Outgoing(names, resolve, trusting)
        assert ask(outgoing, f"https://hooks.example:{port}/").body == b"secure"
        assert asked_for == ["hooks.example"]
        with pytest.raises(Unreachable, match="ConnectError"):
            ask(outgoing, f"https://other.example:{port}/")  # the certificate is another's
        with pytest.raises(Unreachable, match="ConnectError"):
            ask(Outgoing(names, resolve), f"https://hooks.example:{port}/")  # nobody trusts it
    assert seen == [f"hooks.example:{port}"]


def test_the_next_address_is_tried_where_the_first_takes_no_connection() -> None:
    with receiving(lambda _: Answer(200, b"second")) as port:
        outgoing = Outgoing(["campus.example"], resolving("127.0.0.2", HERE))
        assert ask(outgoing, f"http://campus.example:{port}/").body == b"second"


def test_a_proxy_of_the_environment_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    assert os.environ["http_proxy"]
    with receiving(lambda _: Answer(200)) as port:
        assert ask(Outgoing([HERE]), f"http://{HERE}:{port}/").status == 200
