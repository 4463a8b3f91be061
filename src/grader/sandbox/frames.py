"""Parses the message of the student's process: named arrays of numbers, then one frame that says how it ended.

    want   "W"                                                         asks for the next part of the job
    array  "A"  length u8, name  dtype code  ndim u8, shape u32 each  length u32, payload
    answer "C"  length u32, payload                                    to a message of the channel, if the job has one
    end    "E"  kind u8  length u16, reason (UTF-8)                     the last frame, exactly once

The first want comes after the import of the student's module and asks for the inputs; a second asks for the hidden
inputs. Arrays that follow the second are kept apart: only they can have been made with the hidden inputs.

Little-endian. Anything else is refused. Nothing is unpickled, and parsing takes no more memory than the bytes that
arrived.
"""

import math
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from grader.domain.run import ANSWER_BYTES_MAX, RunStatus
from grader.sandbox.policy import NAME_CHARS_MAX, NDIM_MAX, RESULT_ARRAYS_MAX

DTYPES: Final = {b"d": "<f8", b"f": "<f4", b"q": "<i8", b"i": "<i4", b"B": "|u1", b"?": "|b1"}
WANT: Final = b"W"
WANTS_MAX: Final = 2
ANSWER: Final = b"C"
ANSWER_HEAD_BYTES: Final = 5
KINDS: Final = (RunStatus.RETURNED, RunStatus.CRASHED, RunStatus.FORBIDDEN, RunStatus.OUT_OF_MEMORY)


class MalformedMessage(ValueError):
    """The message is not well formed; the text says why, in words for the student."""


@dataclass(frozen=True)
class Message:
    """Everything that a script sent, which is a claim. `end` is None if the message was cut short. `hidden` holds the
    arrays that arrived after the request for the hidden inputs."""

    results: Mapping[str, NDArray[np.generic]]
    hidden: Mapping[str, NDArray[np.generic]]
    end: RunStatus | None
    reason: str


class _Reader:
    """Reads bytes in order and refuses to read beyond the end."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, count: int) -> bytes:
        if self._at + count > len(self._data):
            raise MalformedMessage("they are cut short")
        taken = self._data[self._at : self._at + count]
        self._at += count
        return taken

    def number(self, code: str) -> int:
        value: int = struct.unpack(f"<{code}", self.take(struct.calcsize(f"<{code}")))[0]
        return value

    def done(self) -> bool:
        return self._at == len(self._data)


class WantCounter:
    """Counts the wants in a message that is still arriving; calls `heard` with the name of each array before the last.
    The time at which an array arrives later may tell the hidden inputs. With `takes_answers` it also takes the answers
    out of the message: `answer` is the last one, None before and once it was read."""

    def __init__(self, heard: Callable[[str], object], *, takes_answers: bool = False) -> None:
        self.count = 0
        self.answer: bytes | None = None
        self.unasked = False
        """Whether an answer came before the last one was read, or one is too long: no driver does that."""
        self._at = 0
        self._heard = heard
        self._takes_answers = takes_answers

    def scan(self, data: bytes | bytearray) -> int:
        """Read on in `data`, all that has arrived so far; returns how many whole want frames it holds."""
        while self._at < len(data):
            if self._takes_answers and data[self._at] == ANSWER[0]:
                assert isinstance(data, bytearray)
                if not self._take_answer(data):
                    break
                continue
            size = _measure_frame(data, self._at)
            if size is None or self._at + size > len(data):
                break
            if data[self._at] == WANT[0]:
                self.count += 1
            elif self.count < WANTS_MAX:
                name = self._at + 2
                self._heard(data[name : name + data[name - 1]].decode("ascii", "replace"))
            self._at += size
        return self.count

    def _take_answer(self, data: bytearray) -> bool:
        """Takes the answer at `_at` out of `data`; returns False if it has not wholly arrived, or is none."""
        begin = self._at + ANSWER_HEAD_BYTES
        if len(data) < begin:
            return False
        end = begin + int.from_bytes(data[self._at + 1 : begin], "little")
        if self.answer is not None or end - begin > ANSWER_BYTES_MAX:
            self.unasked = True
            return False
        if len(data) < end:
            return False
        self.answer = bytes(data[begin:end])
        del data[self._at : end]
        return True


def _measure_frame(data: bytes | bytearray, at: int) -> int | None:
    """Return the size [bytes] of the want or array frame at `at`; None if it is another, or has not wholly arrived."""
    if data[at] == WANT[0]:
        return 1
    if data[at] != ord("A"):
        return None
    try:
        shape = at + 2 + data[at + 1] + 1  # tag, length, name, dtype
        length = shape + 1 + 4 * data[shape]
        return length + 4 + int(struct.unpack_from("<I", data, length)[0]) - at
    except (IndexError, struct.error):
        return None


def read_arrays(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield name and payload of each whole array frame of a message that may be cut short, up to the first fault."""
    at = 0
    while at < len(data):
        size = _measure_frame(data, at)
        if size is None or at + size > len(data):
            return
        if data[at] != WANT[0]:
            name = at + 2
            shape = name + data[at + 1] + 1
            yield data[name : shape - 1], data[shape + 1 + 4 * data[shape] + 4 : at + size]
        at += size


def parse_message(data: bytes) -> Message:
    """Read a whole message. Raises Malformed: not well formed, a name twice, a number that is not finite."""
    reader, results = _Reader(data), dict[str, NDArray[np.generic]]()
    hidden = dict[str, NDArray[np.generic]]()
    wants = 0
    while not reader.done():
        tag = reader.take(1)
        if tag == WANT and wants < WANTS_MAX:
            wants += 1
            continue
        if tag == b"E":
            return Message(results, hidden, *_read_end(reader))
        if tag != b"A":
            raise MalformedMessage("they are not in the expected form")
        name = _read_name(reader)
        if name in results or name in hidden:
            raise MalformedMessage(f"{name} is there twice")
        (hidden if wants == WANTS_MAX else results)[name] = _read_array(reader, name)
        if len(results) + len(hidden) > RESULT_ARRAYS_MAX:
            raise MalformedMessage(f"there are more than {RESULT_ARRAYS_MAX} arrays")
    return Message(results, hidden, None, "")


def _read_end(reader: _Reader) -> tuple[RunStatus, str]:
    kind = reader.number("B")
    raw = reader.take(reader.number("H"))
    if kind >= len(KINDS) or not reader.done():
        raise MalformedMessage("their end is not in the expected form")
    return KINDS[kind], raw.decode("utf-8", "replace")


def _read_name(reader: _Reader) -> str:
    name = reader.take(reader.number("B")).decode("ascii", "replace")
    if not name.isidentifier() or not name.isascii() or len(name) > NAME_CHARS_MAX:
        raise MalformedMessage("an array has no proper name")
    return name


def _read_array(reader: _Reader, name: str) -> NDArray[np.generic]:
    code = reader.take(1)
    if code not in DTYPES:
        raise MalformedMessage(f"{name} has an unknown type")
    dtype = np.dtype(DTYPES[code])
    ndim = reader.number("B")
    if ndim > NDIM_MAX:
        raise MalformedMessage(f"{name} has more than {NDIM_MAX} dimensions")
    shape = tuple(reader.number("I") for _ in range(ndim))
    length = reader.number("I")
    if math.prod(shape) * dtype.itemsize != length:
        raise MalformedMessage(f"the shape of {name} does not fit its size")
    raw = reader.take(length)
    if code == b"?" and raw.strip(b"\0\1"):
        raise MalformedMessage(f"{name} holds something that is neither true nor false")
    array: NDArray[np.generic] = np.frombuffer(raw, dtype).reshape(_check_shape(shape))
    if dtype.kind == "f" and not np.isfinite(array).all():
        raise MalformedMessage(f"{name} holds a number that is not finite")
    return array


def _check_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Refuse an empty array whose other dimensions are too large for NumPy."""
    if 0 in shape and math.prod(max(n, 1) for n in shape) > np.iinfo(np.int64).max // 8:
        raise MalformedMessage("an array has an impossible shape")
    return shape
