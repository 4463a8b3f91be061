"""Lab runs that were asked for before: the same settings give the same run, bit for bit."""

from collections import OrderedDict
from collections.abc import Callable
from threading import Lock


class LabCache:
    """Compressed answers by digest, the least recently used forgotten first; at most `bytes_max` in all."""

    def __init__(self, bytes_max: int) -> None:
        self._bytes_max, self._bytes = bytes_max, 0
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._lock = Lock()

    def get(self, digest: str, make: Callable[[], bytes]) -> bytes:
        """What `make` returned for this digest before, or returns now."""
        with self._lock:
            if digest in self._kept:
                self._kept.move_to_end(digest)
                return self._kept[digest]
        made = make()
        with self._lock:
            self._bytes += len(made) - len(self._kept.pop(digest, b""))
            self._kept[digest] = made
            while self._bytes > self._bytes_max:
                self._bytes -= len(self._kept.popitem(last=False)[1])
        return made
