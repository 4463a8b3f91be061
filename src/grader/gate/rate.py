"""Rate limits: one token bucket per learner or address, which requests empty and time refills. A bucket is stored as
the time at which it is full again, so that a full one needs no entry."""

import math
import time
from collections.abc import Callable, Hashable
from ipaddress import IPv6Address, IPv6Network, ip_address

from starlette.types import Scope

from grader.errors import TooManyRequests

BUCKETS_MAX = 10_000
"""Buckets of one limit; beyond it the least recently used is dropped."""

ROUNDING = 1e-6
"""What a bucket may lack of a token through the rounding of times."""


class RateLimit:
    """Token buckets of size `burst`, refilled at `rate_per_s` [1/s]. Not thread-safe: for the event loop. Each server
    process counts alone: see `Settings.share`."""

    def __init__(
        self,
        rate_per_s: float,
        burst: float,
        clock: Callable[[], float] = time.monotonic,
        *,
        refusal: str = "Too many requests at once.",
    ) -> None:
        self._rate, self._burst, self._clock, self._refusal = rate_per_s, burst, clock, refusal
        self._full_at: dict[Hashable, float] = {}

    def spend(self, who: Hashable, cost: float = 1.0) -> None:
        """Takes `cost` out of the bucket, which may leave a debt. Raises TooManyRequests if it holds less than 1."""
        self.require(who)
        self.charge(who, cost)

    def require(self, who: Hashable) -> None:
        """Raises TooManyRequests if the bucket holds less than 1."""
        level = self._burst - max(0.0, self._full_at.get(who, -math.inf) - self._clock()) * self._rate
        if level < 1 - ROUNDING:
            raise TooManyRequests(self._refusal, math.ceil((1 - level) / self._rate))

    def charge(self, who: Hashable, cost: float) -> None:
        """Takes `cost` out of the bucket."""
        self._full_at[who] = max(self._full_at.pop(who, -math.inf), self._clock()) + cost / self._rate
        if len(self._full_at) > BUCKETS_MAX:
            del self._full_at[next(iter(self._full_at))]


def read_address(scope: Scope) -> str:
    """The client's IPv4 address or IPv6 network of 64 bits, which one client has to itself; "" if there is none."""
    host = (scope.get("client") or ("", 0))[0]
    try:
        address = ip_address(host)
    except ValueError:
        return ""
    if isinstance(address, IPv6Address):
        return str(address.ipv4_mapped or IPv6Network((int(address), 64), strict=False))
    return str(address)
