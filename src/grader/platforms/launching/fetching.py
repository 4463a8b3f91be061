"""What the LTI tool needs of the network: requests to platforms, and their public keys with a cache."""

import asyncio
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import structlog

from grader.errors import Unauthorized

if TYPE_CHECKING:  # it needs the packages of the extra
    from grader.platforms.sending.outgoing import Response

log = structlog.get_logger()

FRESH_S = 3600.0
"""How long fetched keys are used without asking again [s]."""
COOL_DOWN_S = 60.0
"""Pause after a fetch that an unknown `kid` has caused, or that failed [s]."""
KEY_SETS_MAX = 1000
KEYS_MAX = 100
"""Keys of one set that are looked at; platforms publish two or three."""
MODULUS_CHARACTERS_MAX = 1400
"""Of an RSA key of 8192 bits in base64; larger ones take long to verify with."""


class Requester(Protocol):
    """Sends requests to addresses that others have chosen, safely. `lms.outgoing.Outgoing` is one."""

    async def request(
        self, method: str, url: str, *, headers: Mapping[str, str] | None = None, body: bytes | None = None
    ) -> "Response":
        """Sends one request and reads the response. Raises an exception where the address may not be asked."""


@dataclass
class KeySet:
    """The keys of one address: when they were fetched, until when no more is asked, and the turn of those who do."""

    keys: dict[str, dict[str, Any]] = field(default_factory=dict)
    fetched_at: float = float("-inf")
    rests_until: float = float("-inf")
    turn: asyncio.Lock = field(default_factory=asyncio.Lock)


class PlatformKeys:
    """The public keys of platforms by address and `kid`, cached. For one event loop."""

    def __init__(self, requester: Requester, clock: Callable[[], float] = time.monotonic) -> None:
        self._requester, self._clock = requester, clock
        self._sets: dict[str, KeySet] = {}

    async def key(self, url: str, kid: str) -> dict[str, Any]:
        """Returns the public JWK with this `kid` at an address. Asks once more for an unknown `kid`, which is how keys
        are rotated, and then rests for `COOL_DOWN_S`. Raises Unauthorized."""
        held = self._held(url)
        async with held.turn:
            if self._clock() - held.fetched_at >= FRESH_S:
                await self._fetch(url, held)
            elif kid not in held.keys:
                await self._fetch(url, held, rest=True)
        if kid in held.keys:
            return held.keys[kid]
        if held.fetched_at == float("-inf"):
            raise Unauthorized("The platform's keys cannot be fetched now. Try again in a minute.")
        raise Unauthorized("The launch is signed with a key that the platform does not publish.")

    def _held(self, url: str) -> KeySet:
        held = self._sets.pop(url, None) or KeySet()
        self._sets[url] = held
        if len(self._sets) > KEY_SETS_MAX:
            del self._sets[next(iter(self._sets))]
        return held

    async def _fetch(self, url: str, held: KeySet, *, rest: bool = False) -> None:
        """Replaces the held keys, unless they rest; those of an earlier fetch stay where it fails."""
        if self._clock() < held.rests_until:
            return
        held.rests_until = self._clock() + COOL_DOWN_S
        try:
            answer = await self._requester.request("GET", url, headers={"Accept": "application/json"})
            keys = read_keys(answer.body) if answer.status == 200 else {}
        except Exception as error:  # whatever the other side, or the way to it, does wrong
            log.warning("the keys of a platform cannot be fetched", url=url, why=type(error).__name__)
            return
        if keys:
            held.keys, held.fetched_at = keys, self._clock()
            if not rest:
                held.rests_until = self._clock()


def read_keys(body: bytes) -> dict[str, dict[str, Any]]:
    """Returns the RSA keys for signatures of a JWK set by `kid`; a key need not name its `alg` and `use`."""
    try:
        listed = json.loads(body)["keys"][:KEYS_MAX]
        usable = [key for key in listed if key["kty"] == "RSA" and key.get("use", "sig") == "sig"]
        signing = [key for key in usable if key.get("alg", "RS256") == "RS256"]
        return {str(key["kid"]): key for key in signing if len(key["n"]) <= MODULUS_CHARACTERS_MAX}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}
