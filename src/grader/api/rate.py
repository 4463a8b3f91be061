"""How often somebody may ask: a bucket per user that fills steadily and is emptied by requests."""

import math
import time
from collections.abc import Callable, Hashable

from grader.errors import TooManyRequests

BUCKETS_MAX = 10_000


class RateLimit:
    """`rate_per_s` lastingly, `burst` at once. For one thread: the event loop's."""

    def __init__(self, rate_per_s: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self._rate, self._burst, self._clock = rate_per_s, burst, clock
        self._buckets: dict[Hashable, tuple[float, float]] = {}

    def spend(self, who: Hashable) -> None:
        """Takes one request out of the bucket. Raises TooManyRequests where it is empty."""
        now = self._clock()
        level, since = self._buckets.pop(who, (float(self._burst), now))
        level = min(self._burst, level + (now - since) * self._rate)
        if level >= 1:
            level -= 1
            self._keep(who, level, now)
            return
        self._keep(who, level, now)
        raise TooManyRequests("Too many requests at once.", math.ceil((1 - level) / self._rate))

    def _keep(self, who: Hashable, level: float, now: float) -> None:
        """The dict stays in order of last use, so that its first is the one to forget."""
        self._buckets[who] = (level, now)
        if len(self._buckets) > BUCKETS_MAX:
            del self._buckets[next(iter(self._buckets))]
