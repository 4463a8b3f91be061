"""Keys: the platform's, fetched as seldom as possible, and this tool's, with rotation."""

import asyncio
import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from joserfc import jwt
from joserfc.jwk import KeySet

from grader.courses.people.identity import DEFAULT_COURSE
from grader.errors import Unauthorized
from grader.platforms.keys import PUBLISHED, ToolKeys
from grader.platforms.launching.addresses import is_at
from grader.platforms.launching.fetching import COOL_DOWN_S, FRESH_S, PlatformKeys, read_keys
from grader.platforms.sending.outgoing import Response
from grader.store.courses import audit_page
from grader.store.engine.database import Database
from grader.store.tables import now
from platforms.platform import KEYS
from support.databases import BACKENDS, database_url

URL = "https://platform.example/keys"
RSA = {"kty": "RSA", "n": "AQAB", "e": "AQAB"}


@dataclass
class Network:
    """A platform that publishes these key ids; None: it cannot be reached."""

    kids: list[str] | None
    asked: int = 0
    clock: float = 0.0

    async def request(
        self, method: str, url: str, *, headers: Mapping[str, str] | None = None, body: bytes | None = None
    ) -> Response:
        assert (method, url) == ("GET", URL)
        self.asked += 1
        await asyncio.sleep(0)
        if self.kids is None:
            raise OSError("no route")
        return Response(200, {}, json.dumps({"keys": [RSA | {"kid": kid} for kid in self.kids]}).encode())

    def keys(self) -> PlatformKeys:
        return PlatformKeys(self, lambda: self.clock)


def get(keys: PlatformKeys, kid: str) -> dict[str, Any]:
    return asyncio.run(keys.key(URL, kid))


async def all_of(keys: PlatformKeys, kids: list[str]) -> list[Any]:
    return list(await asyncio.gather(*(keys.key(URL, kid) for kid in kids), return_exceptions=True))


def test_keys_are_fetched_once() -> None:
    network = Network(["a", "b"])
    keys = network.keys()
    fetched = asyncio.run(all_of(keys, ["a", "b"] * 10))
    assert [one["kid"] for one in fetched] == ["a", "b"] * 10
    assert network.asked == 1
    network.clock += FRESH_S
    assert asyncio.run(all_of(keys, ["a"]))[0]["kid"] == "a"
    assert network.asked == 2


def test_twenty_unknown_keys_cause_two_fetches_at_most() -> None:
    network = Network(["a"])
    keys = network.keys()
    errors = asyncio.run(all_of(keys, [f"unknown-{number}" for number in range(20)]))
    assert all(isinstance(one, Unauthorized) and "does not publish" in str(one) for one in errors)
    assert network.asked == 2


def test_a_new_key_of_the_platform_is_found_at_once() -> None:
    network = Network(["a"])

    async def rotate() -> None:
        keys = network.keys()
        await keys.key(URL, "a")
        network.kids = ["a", "b"]
        assert (await keys.key(URL, "b"))["kid"] == "b"
        network.kids = ["b", "c"]
        with pytest.raises(Unauthorized, match="does not publish"):
            await keys.key(URL, "c")  # the cool-down
        network.clock += COOL_DOWN_S
        assert (await keys.key(URL, "c"))["kid"] == "c"
        with pytest.raises(Unauthorized, match="does not publish"):
            await keys.key(URL, "a")

    asyncio.run(rotate())


def test_a_platform_that_cannot_be_reached_is_left_alone_for_a_while() -> None:
    network = Network(None)

    async def fail() -> None:
        keys = network.keys()
        for _ in range(5):
            with pytest.raises(Unauthorized, match="cannot be fetched"):
                await keys.key(URL, "a")
        assert network.asked == 1
        network.clock, network.kids = network.clock + COOL_DOWN_S, ["a"]
        assert (await keys.key(URL, "a"))["kid"] == "a"
        network.clock, network.kids = network.clock + FRESH_S, None
        assert (await keys.key(URL, "a"))["kid"] == "a"  # what was fetched before stays

    asyncio.run(fail())


def listed(*keys: Any) -> bytes:
    return json.dumps({"keys": keys}).encode()


@pytest.mark.parametrize(
    ("body", "kids"),
    [
        (listed(RSA | {"kid": "a"}), {"a"}),
        (listed(RSA | {"kid": "a", "alg": "RS256", "use": "sig"}), {"a"}),
        (listed(RSA | {"kid": "a", "use": "enc"}), set()),
        (listed(RSA | {"kid": "a", "alg": "RS512"}), set()),
        (listed({"kty": "EC", "kid": "e"}, RSA | {"kid": "a"}), {"a"}),
        (listed({"kty": "oct", "kid": "a", "k": "AQAB"}), set()),
        (listed(RSA | {"kid": "a", "n": "x" * 10_000}), set()),
        (listed("text"), set()),
        (b"[]", set()),
        (b"{}", set()),
        (b"[" * 100_000, set()),
        (b"not JSON", set()),
    ],
)
def test_which_keys_of_a_set_are_taken(body: bytes, kids: set[str]) -> None:
    assert set(read_keys(body)) == kids


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.slow
def test_this_tools_keys_rotate_and_are_published_for_a_day(backend: str, tmp_path: Path) -> None:
    with database_url(backend, tmp_path) as url:
        database = Database(url)
        database.migrate()
        clock = now()
        keys = ToolKeys(database, lambda: clock)
        token = keys.sign({"a": 1})
        assert [key["kid"] for key in ToolKeys(database).public()["keys"]] == [kid_of(keys)]
        assert not {"d", "p", "q", "dp", "dq", "qi"} & set(keys.public()["keys"][0])
        first = kid_of(keys)
        second = keys.rotate()
        assert {key["kid"] for key in keys.public()["keys"]} == {first, second}
        assert kid_of(keys) == second
        assert jwt.decode(token, KeySet.import_key_set(keys.public()), algorithms=["RS256"]).claims == {"a": 1}  # type: ignore[arg-type]
        clock += PUBLISHED + timedelta(seconds=1)
        assert [key["kid"] for key in keys.public()["keys"]] == [second]
        with database.read() as session:
            entries = [(one.name, one.action, one.subject) for one in audit_page(session, DEFAULT_COURSE, None, 9)]
        assert entries == [("command line", "signing key rotated", second)]
        database.close()


def kid_of(keys: ToolKeys) -> str:
    """The key that signs now."""
    header = json.loads(_decoded(keys.sign({}).partition(".")[0]))
    assert header["alg"] == "RS256"
    return str(header["kid"])


def _decoded(part: str) -> bytes:
    return base64.urlsafe_b64decode(part + "==")


def test_the_platforms_own_keys_need_no_alg() -> None:
    assert "alg" not in KEYS[0].as_dict(private=False)


@pytest.mark.parametrize(
    ("origin", "url", "expected"),
    [
        ("https://grader.example", "https://grader.example/lti/launch", True),
        ("https://Grader.Example:443", "https://grader.example/x", True),
        ("http://[::1]:8000", "http://[::1]:8000/", True),
        ("https://grader.example", "https://grader.example:8443/", False),
        ("https://grader.example", "http://grader.example/", False),
        ("https://grader.example", "https://grader.example@evil.example/", False),
        ("https://grader.example", "https://grader.example\\@evil.example/", False),
        ("https://grader.example", "//grader.example/", False),
        ("https://grader.example", "https://grader.example:bad/", False),
        ("https://grader.example", "https://[grader.example/", False),
        ("", "", False),
    ],
)
def test_whose_address_it_is(origin: str, url: str, expected: bool) -> None:
    assert is_at(origin, url) == expected
