"""Rate limits: one token bucket per learner or address, which requests empty and time refills.

A bucket is the time at which it is full again, so that a full one needs no place. Several processes share theirs in
memory, by the clock of the machine.
"""

import fcntl
import math
import mmap
import os
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager, nullcontext
from hashlib import blake2b
from ipaddress import IPv6Address, IPv6Network, ip_address
from typing import Any, Protocol

from starlette.types import Scope

from grader.errors import TooManyRequests

BUCKETS_MAX = 10_000

PLACES = 1 << 15
"""Places for buckets that processes share, of 16 bytes: three limits with as many buckets as one process keeps."""

NEAR = 8
"""Places where a shared bucket may be: from the one that its name says."""

EMPTY = 0
"""Marks a place without a bucket."""

ROUNDING = 1e-6
"""What a bucket may lack of a token through the rounding of times."""


class Buckets(Protocol):
    """Where a limit's buckets are: when each is full again [s]."""

    def turn(self) -> Any:
        """A context in which no other process changes them."""

    def get(self, who: Hashable) -> float:
        """When the bucket is full again; a time long ago if it is not there."""

    def put(self, who: Hashable, full_at: float) -> None:
        """Keeps a bucket; drops another where there are too many."""


class OwnBuckets:
    """The buckets of one process, of which the least recently used is dropped."""

    def __init__(self) -> None:
        self._full_at: dict[Hashable, float] = {}

    def turn(self) -> Any:
        """No other process has them."""
        return nullcontext()

    def get(self, who: Hashable) -> float:
        """When the bucket is full again."""
        return self._full_at.get(who, -math.inf)

    def put(self, who: Hashable, full_at: float) -> None:
        """Keeps a bucket."""
        self._full_at.pop(who, None)
        self._full_at[who] = full_at
        if len(self._full_at) > BUCKETS_MAX:
            del self._full_at[next(iter(self._full_at))]


class SharedBuckets:
    """The buckets of several processes, in memory that they inherit as a file; `limit` tells those of limits apart.

    Among the places near its own, a new bucket takes that of the one that is full first. A killed process leaves no
    lock behind: the kernel frees it.
    """

    def __init__(self, descriptor: int, limit: str = "") -> None:
        self._descriptor, self._limit = descriptor, limit
        memory = memoryview(mmap.mmap(descriptor, 16 * PLACES))
        self._names, self._full_at = memory[: 8 * PLACES].cast("Q"), memory[8 * PLACES :].cast("d")

    @staticmethod
    def create() -> int:
        """The descriptor of new memory without buckets."""
        descriptor = os.memfd_create("grader-rates")
        os.ftruncate(descriptor, 16 * PLACES)
        return descriptor

    def of(self, limit: str) -> "SharedBuckets":
        """The buckets of another limit in the same memory."""
        return SharedBuckets(self._descriptor, limit)

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Holds the lock, for some microseconds."""
        fcntl.lockf(self._descriptor, fcntl.LOCK_EX)
        try:
            yield
        finally:
            fcntl.lockf(self._descriptor, fcntl.LOCK_UN)

    def get(self, who: Hashable) -> float:
        """When the bucket is full again."""
        name = self._name(who)
        return next((self._full_at[place] for place in near(name) if self._names[place] == name), -math.inf)

    def put(self, who: Hashable, full_at: float) -> None:
        """Keeps a bucket."""
        name = self._name(who)
        own = [place for place in near(name) if self._names[place] == name]
        place = own[0] if own else min(near(name), key=self._fullness)
        self._names[place], self._full_at[place] = name, full_at

    def _fullness(self, place: int) -> float:
        return -math.inf if self._names[place] == EMPTY else self._full_at[place]

    def _name(self, who: Hashable) -> int:
        """The number of a bucket, the same in every process."""
        digest = blake2b(repr((self._limit, who)).encode(), digest_size=8).digest()
        return int.from_bytes(digest, "big") or 1


def near(name: int) -> list[int]:
    """The places where a shared bucket may be."""
    return [(name + step) % PLACES for step in range(NEAR)]


class RateLimit:
    """Token buckets of size `burst`, refilled at `rate_per_s`. Not thread-safe: for the event loop."""

    def __init__(
        self,
        rate_per_s: float,
        burst: float,
        clock: Callable[[], float] = time.monotonic,
        *,
        refusal: str = "Too many requests at once.",
        buckets: Buckets | None = None,
    ) -> None:
        self._rate, self._burst, self._clock, self._refusal = rate_per_s, burst, clock, refusal
        self._buckets = OwnBuckets() if buckets is None else buckets

    def spend(self, who: Hashable, cost: float = 1.0) -> None:
        """Takes `cost` out of the bucket, which may leave a debt. Raises TooManyRequests if it holds less than 1."""
        with self._buckets.turn():
            self.require(who)
            self._take(who, cost)

    def require(self, who: Hashable) -> None:
        """Raises TooManyRequests if the bucket holds less than 1."""
        level = self._burst - max(0.0, self._buckets.get(who) - self._clock()) * self._rate
        if level < 1 - ROUNDING:
            raise TooManyRequests(self._refusal, math.ceil((1 - level) / self._rate))

    def charge(self, who: Hashable, cost: float) -> None:
        """Takes `cost` out of the bucket."""
        with self._buckets.turn():
            self._take(who, cost)

    def _take(self, who: Hashable, cost: float) -> None:
        self._buckets.put(who, max(self._buckets.get(who), self._clock()) + cost / self._rate)


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
