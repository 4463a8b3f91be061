"""Records a trace of each trial, inside the jail: what the functions return, print and catch, what they ask of MuJoCo.

The code of this file is sent to the jail with the harness; it imports nothing of the grader. `grader.exercises.trace`
reads what it writes. A trace is a claim of the student's process, and only explains a verdict.

A trace is a sequence of notes, little-endian:

    name      u8 length, ASCII
    info      u32 length, a JSON object; nothing if it is empty
    numbers   u32 count, float64 each; they may be nan or inf, which other results may not

Every kind gets `returned` (a value's type, shape and first numbers), `handled` (see catching.py), `printed` and, where
notes did not fit, `cut`. A driver finds a function `note(name, info, numbers)` among its names and adds its own.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

BYTES_MAX = 256 * 1024
"""The size of all traces of a run."""
TRIAL_BYTES_MAX = 32 * 1024
"""The size of one trial's trace."""
RETURNS_MAX = 4
"""Returned values that are noted in a trial, the first ones."""
PRINTED_CHARS_MAX = 500
NUMBERS_MAX = 8
"""Numbers of a returned value that are noted."""
TEXT_CHARS_MAX = 120

notes: list[bytes] = []
state = {"left": BYTES_MAX, "trial": 0, "dropped": 0, "returned": 0, "open": 0, "hidden": 0, "printed": 0}
printed: list[str] = []
heard: list[Any] = [None]
"""The stream that is listened to."""
at_end: list[Callable[[], None]] = []
"""Called at the end of each trial: what else there is to note."""


def note(name: str, info: Mapping[str, Any] | None = None, numbers: Any = ()) -> bool:
    """Adds a note to the trace of the current trial; returns False where there is none, or the note does not fit.
    `numbers` may be the bytes of float64 already."""
    if not state["open"]:
        return False
    text = json.dumps(info).encode() if info else b""
    values = numbers if type(numbers) is bytes else np.asarray(numbers, dtype="<f8").tobytes()
    return keep(encode_note(name, text, values))


def encode_note(name: str, text: bytes, values: bytes) -> bytes:
    """Returns the bytes of a note."""
    label, count = name.encode("ascii"), len(values) // 8
    return b"".join(
        (bytes((len(label),)), label, len(text).to_bytes(4, "little"), text, count.to_bytes(4, "little"), values)
    )


NOTHING = encode_note("returned", b'{"type": "NoneType"}', b"")
"""The note of a function that returned None, as the functions of some kinds do in every step."""


def keep(raw: bytes) -> bool:
    """Keeps the bytes of a note if they fit."""
    if len(raw) > min(state["left"], TRIAL_BYTES_MAX - state["trial"]):
        state["dropped"] += 1
        return False
    state["left"] -= len(raw)
    state["trial"] += len(raw)
    notes.append(raw)
    return True


def begin(hidden: bool) -> None:
    """Begins the trace of a trial. What a hidden one catches and prints is noted without its text."""
    notes.clear()
    state.update(trial=0, dropped=0, returned=0, open=1, hidden=int(hidden), printed=0)
    if sys.stdout is not heard[0]:
        listen(sys.stdout)


def end() -> bytes:
    """Ends the trace and returns it."""
    if printed:
        note("printed", {"text": "" if state["hidden"] else "".join(printed)[:PRINTED_CHARS_MAX]})
        printed.clear()
    for finish in at_end:
        finish()
    if state["dropped"]:
        state["left"] = max(state["left"], 100)  # room to say so
        state["trial"] = 0
        note("cut", {"dropped": state["dropped"]})
    state["open"] = 0
    return b"".join(notes)


def traced(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a function that notes the first values that `function` returns; `inspect.unwrap` finds `function`."""

    def call(*arguments: Any, **named: Any) -> Any:
        value = function(*arguments, **named)
        if state["returned"] < RETURNS_MAX:
            state["returned"] += 1
            describe(value)
        return value

    call.__wrapped__ = function  # type: ignore[attr-defined]
    return call


def describe(value: Any) -> None:
    """Notes type, shape and first numbers of a returned value; runs no code of the student's."""
    if value is None:
        keep(NOTHING)
        return
    info: dict[str, Any] = {"type": type(value).__name__[:TEXT_CHARS_MAX]}
    numbers: list[float] = []
    if type(value) in (bool, int, float) or isinstance(value, np.number):
        numbers = first_numbers([value])
    elif type(value) is str:
        info["text"] = value[:TEXT_CHARS_MAX]
    elif type(value) in (tuple, list):
        info["shape"] = [len(value)]
        info["items"] = [type(item).__name__[:TEXT_CHARS_MAX] for item in value[:NUMBERS_MAX]]
        numbers = first_numbers(value[:NUMBERS_MAX])
    elif type(value) is np.ndarray:
        info["shape"], info["dtype"] = list(value.shape), str(value.dtype)
        numbers = first_numbers(value.flat[:NUMBERS_MAX].tolist())
    note("returned", info, numbers)


def first_numbers(items: Sequence[Any]) -> list[float]:
    """Returns items as numbers; nan for those that are not real numbers."""
    numbers = []
    for item in items:
        is_number = type(item) in (bool, int, float) or isinstance(item, np.floating | np.integer)
        try:
            numbers.append(float(item) if is_number else np.nan)
        except OverflowError:
            numbers.append(np.inf)
    return numbers


def listen(stream: Any) -> None:
    """Keeps the first characters that are printed in a trial: `print` looks `write` up in the stream."""
    heard[0] = stream
    plain = getattr(stream, "write", None)
    if type(stream).__name__ != "TextIOWrapper" or plain is None:  # the student's own
        return

    def write(text: str) -> Any:
        if state["open"]:
            printed.append(text[:PRINTED_CHARS_MAX])
            state["printed"] += len(text)
            if state["printed"] > PRINTED_CHARS_MAX or len(printed) > PRINTED_CHARS_MAX:
                vars(stream).pop("write", None)  # until the next trial
                heard[0] = None
        return plain(text)

    stream.write = write
