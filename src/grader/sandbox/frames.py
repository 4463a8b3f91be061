"""What the student's process sends back: named arrays of numbers, then one word on how it ended. Parsed strictly.

    array  "A"  length u8, name  dtype code  ndim u8, shape u32 each  length u32, payload
    end    "E"  kind u8  length u16, reason (UTF-8)                     the last frame, exactly once

Little-endian. Whatever is not exactly that is refused; nothing is ever unpickled, and a parse takes no more memory
than the bytes that arrived.
"""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from grader.domain.run import RunStatus
from grader.sandbox.policy import NAME_CHARS_MAX, NDIM_MAX, RESULT_ARRAYS_MAX

DTYPES: Final = {b"d": "<f8", b"f": "<f4", b"q": "<i8", b"i": "<i4", b"B": "|u1", b"?": "|b1"}
KINDS: Final = (RunStatus.RETURNED, RunStatus.CRASHED, RunStatus.FORBIDDEN, RunStatus.OUT_OF_MEMORY)


class Malformed(ValueError):
    """Not a well-formed message; the text says why, in words for the student."""


@dataclass(frozen=True)
class Message:
    """All that a script sent; a claim. `end` is None when it was cut short."""

    results: Mapping[str, NDArray[np.generic]]
    end: RunStatus | None
    reason: str


class _Reader:
    """Takes bytes from the front, never more than there are."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, count: int) -> bytes:
        if self._at + count > len(self._data):
            raise Malformed("they are cut short")
        taken = self._data[self._at : self._at + count]
        self._at += count
        return taken

    def number(self, code: str) -> int:
        value: int = struct.unpack(f"<{code}", self.take(struct.calcsize(f"<{code}")))[0]
        return value

    def done(self) -> bool:
        return self._at == len(self._data)


def parse(data: bytes) -> Message:
    """Read a whole message.

    Raises:
        Malformed: not well formed, a name twice, a number that is not finite.
    """
    reader, results = _Reader(data), dict[str, NDArray[np.generic]]()
    while not reader.done():
        tag = reader.take(1)
        if tag == b"E":
            return _end(reader, results)
        if tag != b"A":
            raise Malformed("they are not in the expected form")
        name = _name(reader)
        if name in results:
            raise Malformed(f"{name} is there twice")
        results[name] = _array(reader, name)
        if len(results) > RESULT_ARRAYS_MAX:
            raise Malformed(f"there are more than {RESULT_ARRAYS_MAX} arrays")
    return Message(results, None, "")


def _end(reader: _Reader, results: Mapping[str, NDArray[np.generic]]) -> Message:
    kind = reader.number("B")
    raw = reader.take(reader.number("H"))
    if kind >= len(KINDS) or not reader.done():
        raise Malformed("their end is not in the expected form")
    return Message(results, KINDS[kind], raw.decode("utf-8", "replace"))


def _name(reader: _Reader) -> str:
    raw = reader.take(reader.number("B"))
    name = raw.decode("ascii", "replace")
    if not name.isidentifier() or not name.isascii() or len(name) > NAME_CHARS_MAX:
        raise Malformed("an array has no proper name")
    return name


def _array(reader: _Reader, name: str) -> NDArray[np.generic]:
    code = reader.take(1)
    if code not in DTYPES:
        raise Malformed(f"{name} has an unknown type")
    dtype = np.dtype(DTYPES[code])
    ndim = reader.number("B")
    if ndim > NDIM_MAX:
        raise Malformed(f"{name} has more than {NDIM_MAX} dimensions")
    shape = tuple(reader.number("I") for _ in range(ndim))
    length = reader.number("I")
    if math.prod(shape) * dtype.itemsize != length:
        raise Malformed(f"the shape of {name} does not fit its size")
    raw = reader.take(length)
    if code == b"?" and raw.strip(b"\0\1"):
        raise Malformed(f"{name} holds something that is neither true nor false")
    array: NDArray[np.generic] = np.frombuffer(raw, dtype).reshape(_sized(shape))
    if dtype.kind == "f" and not np.isfinite(array).all():
        raise Malformed(f"{name} holds a number that is not finite")
    return array


def _sized(shape: tuple[int, ...]) -> tuple[int, ...]:
    """An empty array of monstrous other dimensions is no array that NumPy can hold."""
    if 0 in shape and math.prod(max(n, 1) for n in shape) > np.iinfo(np.int64).max // 8:
        raise Malformed("an array has an impossible shape")
    return shape
