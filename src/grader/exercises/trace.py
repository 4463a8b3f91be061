"""Reads the traces that scripts leave in the jail: claims, which explain a verdict and never decide one.
`grader.exercises.driving.recorder` writes them and describes their form. Whatever the bytes are, `read_trace` returns a
trace: the notes up to the first that is not well formed."""

import re
import struct
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from grader.sandbox.cleaning import read_json

ALL_BYTES_MAX = 320 * 1024
"""The size of all traces of a run, with room to spare."""
BYTES_MAX = 64 * 1024
"""The size of a trial's trace, with room to spare: the recorder's limit is half of it."""
INFO_BYTES_MAX = 16 * 1024
NOTES_MAX = 4096
LINES_MAX = 10_000
"""A higher line is not believed: a script chooses which line it tells, and so could tell a number of a hidden case."""
NAME_CHARS_MAX = 32
WORDS_MAX = 3
"""The words of a text that a driver notes, such as `argument 1`."""

Numbers = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Note:
    """One entry of a trace. `info` is any JSON object, `numbers` (n,) are read-only and may be nan or inf."""

    name: str
    info: Mapping[str, Any]
    numbers: Numbers


@dataclass(frozen=True)
class ReturnedValue:
    """A value that a function returned. `type` is the name of its class, `text` that of a string. `shape` is that of an
    array or the length of a list or tuple, whose items have the classes `items`. `numbers` are the first ones, nan
    where an item is no number."""

    type: str
    text: str
    shape: tuple[int, ...]
    items: tuple[str, ...]
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class HandledException:
    """An exception that the `except` clause in line `clause` caught: class, line where it was raised, and how often.
    `message` is empty in a hidden trial. The clause may have raised it again."""

    type: str
    line: int
    clause: int
    times: int
    message: str


@dataclass(frozen=True)
class Trace:
    """What a script did in one trial, as it claims. `cut`: there was more than was kept, or not all can be read."""

    notes: tuple[Note, ...] = ()
    cut: bool = False

    def list_notes(self, name: str) -> list[Note]:
        """Returns the notes of one name, in order."""
        return [note for note in self.notes if note.name == name]

    @property
    def returned_values(self) -> list[ReturnedValue]:
        """The first values that the student's functions returned."""
        return [read_returned(note) for note in self.list_notes("returned")]

    @property
    def handled_exceptions(self) -> list[HandledException]:
        """The exceptions that `except` clauses caught; notes that cannot be read are left out."""
        return [handled for note in self.list_notes("handled") if (handled := read_handled(note.info))]

    @property
    def printed_text(self) -> str | None:
        """The beginning of what was printed, empty in a hidden trial; None if nothing was."""
        printed = next((note.info.get("text") for note in self.list_notes("printed")), None)
        return printed if isinstance(printed, str) else None


NO_TRACE = Trace()


def read_traces(values: "NDArray[np.generic] | None", known: Container[str] | None = None) -> dict[int, Trace]:
    """Returns the traces in the result `traces` by the index of the trial, up to the first that is not whole.
    `grader.exercises.driving.harness` writes the result. `known` is given for hidden trials: a text with a word that is
    not among these is emptied, as the script may have made it of the numbers of a hidden case."""
    traces: dict[int, Trace] = {}
    if values is None or values.dtype != np.uint8 or values.ndim != 1:
        return traces
    at = 0
    while at + 8 <= min(len(values), ALL_BYTES_MAX):
        index, size = struct.unpack("<II", values[at : at + 8].tobytes())
        traces[index] = read_trace(values[at + 8 : at + 8 + size], known)
        at += 8 + size
    return traces


def read_trace(values: "NDArray[np.generic] | None", known: Container[str] | None = None) -> Trace:
    """Returns the trace of a trial, with known words alone as in `read_traces`; an empty one if there is none."""
    if values is None:
        return NO_TRACE
    if values.dtype != np.uint8 or values.ndim != 1:
        return Trace(cut=True)
    raw, notes = values[:BYTES_MAX].tobytes(), list[Note]()
    whole = len(values) <= BYTES_MAX
    try:
        for note in read_notes(raw):
            notes.append(note if known is None else replace(note, info=drop_unknown_words(note.info, known)))
    except (ValueError, struct.error, RecursionError):
        whole = False
    return Trace(tuple(note for note in notes if note.name != "cut"), not whole or any(n.name == "cut" for n in notes))


def drop_unknown_words(value: Any, known: Container[str]) -> Any:
    """Returns JSON in which each text with an unknown word is empty; numbers of one digit are known."""
    if isinstance(value, dict):
        return {key: drop_unknown_words(element, known) for key, element in value.items()}
    if isinstance(value, list):
        return [drop_unknown_words(item, known) for item in value]
    if isinstance(value, str):
        words = re.findall(r"\w+", value)
        return value if len(words) <= WORDS_MAX and all(len(w) == 1 or w in known for w in words) else ""
    return value


def read_notes(raw: bytes) -> Iterator[Note]:
    """Yields each note. Raises ValueError, struct.error or RecursionError where one is not well formed."""
    at = 0
    for _ in range(NOTES_MAX):
        if at == len(raw):
            return
        length = raw[at]
        name = raw[at + 1 : at + 1 + length].decode("ascii")
        at += 1 + length
        (length,) = struct.unpack_from("<I", raw, at)
        text = raw[at + 4 : at + 4 + length]
        at += 4 + length
        (count,) = struct.unpack_from("<I", raw, at)
        at += 4
        if not name.isidentifier() or len(name) > NAME_CHARS_MAX or length > INFO_BYTES_MAX:
            raise ValueError("a note has no proper name or information")
        info = read_json(text) if text else {}
        if not isinstance(info, dict):
            raise ValueError("the information of a note is no object")
        yield Note(name, info, np.frombuffer(raw, "<f8", count, at))  # raises ValueError beyond the end
        at += 8 * count
    if at != len(raw):
        raise ValueError("there are too many notes")


def read_returned(note: Note) -> ReturnedValue:
    """Returns what a note says of a returned value."""
    shape, items = (note.info.get(key) for key in ("shape", "items"))
    return ReturnedValue(
        type=get_text(note.info, "type"),
        text=get_text(note.info, "text"),
        shape=tuple(n for n in shape if is_count(n)) if isinstance(shape, list) else (),
        items=tuple(item for item in items if isinstance(item, str)) if isinstance(items, list) else (),
        numbers=tuple(note.numbers.tolist()),
    )


def read_handled(info: Mapping[str, Any]) -> HandledException | None:
    """Returns what a note says of a handled exception; None if a line or the count is no number."""
    line, clause, times = (info.get(key) for key in ("line", "clause", "times"))
    if not (is_line(line) and is_line(clause) and is_count(times)):
        return None
    return HandledException(get_text(info, "type"), line, clause, times, get_text(info, "message"))


def get_text(info: Mapping[str, Any], key: str) -> str:
    """Returns a text; empty if there is none."""
    text = info.get(key)
    return text if isinstance(text, str) else ""


def get_list(info: Mapping[str, Any], key: str) -> list[Any]:
    """Returns a list; an empty one if there is none."""
    items = info.get(key)
    return items if isinstance(items, list) else []


def is_count(value: object) -> TypeGuard[int]:
    """Whether a value is a whole number of a sensible size."""
    return type(value) is int and 0 <= value < 2**31


def is_line(value: object) -> TypeGuard[int]:
    """Whether a value may be the number of a line."""
    return is_count(value) and 1 <= value <= LINES_MAX
