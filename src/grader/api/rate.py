"""Rate limits: one token bucket per learner or address, which requests empty and time refills."""

import math
import time
from collections.abc import Callable, Hashable
from ipaddress import IPv6Address, IPv6Network, ip_address

from starlette.types import Scope

from grader.errors import TooManyRequests

BUCKETS_MAX = 10_000


class RateLimit:
    """Token buckets of size `burst`, refilled at `rate_per_s`. Not thread-safe: for the event loop."""

    def __init__(
        self,
        rate_per_s: float,
        burst: float,
        clock: Callable[[], float] = time.monotonic,
        *,
        refusal: str = "Too many requests at once.",
    ) -> None:
        self._rate, self._burst, self._clock, self._refusal = rate_per_s, burst, clock, refusal
        self._buckets: dict[Hashable, tuple[float, float]] = {}

    def spend(self, who: Hashable, cost: float = 1.0) -> None:
        """Takes `cost` out of the bucket, which may leave a debt. Raises TooManyRequests if it holds less than 1."""
        self.require(who)
        self.charge(who, cost)

    def require(self, who: Hashable) -> None:
        """Raises TooManyRequests if the bucket holds less than 1."""
        level = self._level(who)
        if level < 1:
            raise TooManyRequests(self._refusal, math.ceil((1 - level) / self._rate))

    def charge(self, who: Hashable, cost: float) -> None:
        """Takes `cost` out of the bucket. Drops the least recently used of too many buckets."""
        level = self._level(who) - cost
        self._buckets.pop(who, None)
        self._buckets[who] = (level, self._clock())
        if len(self._buckets) > BUCKETS_MAX:
            del self._buckets[next(iter(self._buckets))]

    def _level(self, who: Hashable) -> float:
        level, since = self._buckets.get(who, (self._burst, self._clock()))
        return min(self._burst, level + (self._clock() - since) * self._rate)


def address_of(scope: Scope) -> str:
    """The client's IPv4 address or IPv6 network of 64 bits, which one client has to itself; "" if there is none."""
    host = (scope.get("client") or ("", 0))[0]
    try:
        address = ip_address(host)
    except ValueError:
        return ""
    if isinstance(address, IPv6Address):
        return str(address.ipv4_mapped or IPv6Network((int(address), 64), strict=False))
    return str(address)
