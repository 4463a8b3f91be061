"""ETags of documents, and the requests that carry one."""

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from threading import Lock


def etag_of(*parts: object) -> str:
    """An ETag that is the same while the parts are; their `repr` is hashed."""
    return f'"{hashlib.sha256(repr(parts).encode()).hexdigest()[:24]}"'


def unchanged(if_none_match: str, etag: str) -> bool:
    """Whether an `If-None-Match` header names this ETag, so that the answer is 304."""
    return if_none_match.strip() == "*" or etag in [tag.strip().removeprefix("W/") for tag in if_none_match.split(",")]


class Bodies:
    """Bodies of documents by their ETag: the `count` that were used last. Safe to use from several threads."""

    def __init__(self, count: int) -> None:
        self._count, self._lock = count, Lock()
        self._kept: OrderedDict[str, bytes] = OrderedDict()

    def get(self, etag: str, make: Callable[[], bytes]) -> bytes:
        """The body with this ETag; calls `make` if it is not kept. Several threads may make the same one at once."""
        with self._lock:
            if etag in self._kept:
                self._kept.move_to_end(etag)
                return self._kept[etag]
        body = make()
        with self._lock:
            self._kept[etag] = body
            self._kept.move_to_end(etag)
            if len(self._kept) > self._count:
                self._kept.popitem(last=False)
        return body
