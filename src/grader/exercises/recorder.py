"""Records a trace of each trial, inside the jail: what the functions return, print and catch, what they ask of MuJoCo.

The code of this file is sent to the jail with the harness; it imports nothing of the grader. `grader.exercises.trace`
reads what it writes. A trace is a claim of the student's process, and only explains a verdict.

A trace is a sequence of notes, little-endian:

    name      u8 length, ASCII
    info      u32 length, a JSON object; nothing if it is empty
    numbers   u32 count, float64 each; they may be nan or inf, which other results may not

Every kind gets `returned` (a value's type, shape and first numbers), `handled` (an exception that an `except` clause
of the script caught, with both lines), `printed` and, where notes did not fit, `cut`. A driver finds a function
`note(name, info, numbers)` among its names and adds its own.

Handled exceptions are seen by a call that is compiled into each `except` clause: tracing (`sys.settrace`,
`sys.setprofile`) would slow every line of the script, and `sys.monitoring` needs Python 3.12. A script without the
word `except` is compiled as it is. `contextlib.suppress` is not seen.
"""

import ast
import builtins
import contextlib
import functools
import json
import struct
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

BYTES_MAX = 256 * 1024
"""The size of all traces of a run."""
TRIAL_BYTES_MAX = 32 * 1024
"""The size of one trial's trace."""
RETURNS_MAX = 4
"""Returned values that are noted in a trial, the first ones."""
HANDLED_MAX = 16
"""Different handled exceptions that are noted in a trial; each is counted."""
PRINTED_CHARS_MAX = 500
NUMBERS_MAX = 8
"""Numbers of a returned value that are noted."""
TEXT_CHARS_MAX = 120
SOURCE_BYTES_MAX = 64 * 1024
"""A longer script is compiled as it is: its syntax tree would take much memory."""

HANDLER = "__handled__"
"""The name of the call in `except` clauses, among the built-in names."""

notes: list[bytes] = []
state = {"left": BYTES_MAX, "trial": 0, "dropped": 0, "returned": 0, "open": 0, "hidden": 0, "printed": 0}
handled: dict[tuple[str, int, int], list[Any]] = {}
printed: list[str] = []


def note(name: str, info: Mapping[str, Any] | None = None, numbers: Any = ()) -> bool:
    """Adds a note to the trace of the current trial; returns False where there is none, or the note does not fit."""
    if not state["open"]:
        return False
    text = json.dumps(info).encode() if info else b""
    values = np.asarray(numbers, dtype="<f8").tobytes()
    return keep(note_of(name, text, values))


def note_of(name: str, text: bytes, values: bytes) -> bytes:
    """Returns the bytes of a note."""
    label = name.encode("ascii")
    head = struct.pack(f"<B{len(label)}sI", len(label), label, len(text))
    return b"".join((head, text, struct.pack("<I", len(values) // 8), values))


NOTHING = note_of("returned", b'{"type": "NoneType"}', b"")
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
    handled.clear()
    printed.clear()
    state.update(trial=0, dropped=0, returned=0, open=1, hidden=int(hidden), printed=0)
    listen()


def end() -> bytes:
    """Ends the trace and returns it."""
    deafen()
    if printed:
        note("printed", {"text": "" if state["hidden"] else "".join(printed)[:PRINTED_CHARS_MAX]})
    for (what, line, clause), (times, message) in handled.items():
        note("handled", {"type": what, "line": line, "clause": clause, "times": times, "message": message})
    if state["dropped"]:
        state["left"] = max(state["left"], 100)  # room to say so
        state["trial"] = 0
        note("cut", {"dropped": state["dropped"]})
    state["open"] = 0
    return b"".join(notes)


def traced(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a function that notes the first values that `function` returns."""

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        value = function(*arguments, **named)
        if state["returned"] < RETURNS_MAX:
            state["returned"] += 1
            describe(value)
        return value

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
    found = []
    for item in items:
        is_number = type(item) in (bool, int, float) or isinstance(item, np.floating | np.integer)
        try:
            found.append(float(item) if is_number else np.nan)
        except OverflowError:
            found.append(np.inf)
    return found


def compiled(source: str, filename: str) -> types.CodeType:
    """Compiles the student's source, with a call of `handle` at the start of each `except` clause.

    Falls back on the plain compiler, which raises what there is to raise.
    """
    if "except" in source and len(source) <= SOURCE_BYTES_MAX:
        try:
            tree = ast.parse(source, filename)
            for node in ast.walk(tree):
                if isinstance(node, ast.ExceptHandler):
                    node.body.insert(0, call_at(node))
            vars(builtins)[HANDLER] = handle
            code: types.CodeType = compile(tree, filename, "exec", dont_inherit=True)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            pass
        else:
            return code
    plain: types.CodeType = compile(source, filename, "exec", dont_inherit=True)
    return plain


def call_at(clause: ast.ExceptHandler) -> ast.stmt:
    """Returns the statement `__handled__(<line of the clause>)`, placed at the clause."""
    name = ast.Name(HANDLER, ast.Load())
    call = ast.Expr(ast.Call(name, [ast.Constant(clause.lineno)], []))
    return ast.fix_missing_locations(ast.copy_location(call, clause))


def handle(clause: int) -> None:
    """Counts the exception that an `except` clause has just caught."""
    error = sys.exc_info()[1]
    if not state["open"] or error is None:
        return
    # the first frame is the one that catches: the line in the student's file is that of a deeper frame of that file
    step = error.__traceback__
    file, line = (step.tb_frame.f_code.co_filename, step.tb_lineno) if step else ("", clause)
    while step is not None:
        if step.tb_frame.f_code.co_filename == file:
            line = step.tb_lineno
        step = step.tb_next
    key = (type(error).__name__[:TEXT_CHARS_MAX], line, clause)
    if key in handled:
        handled[key][0] += 1
    elif len(handled) < HANDLED_MAX:
        message = ""
        if not state["hidden"]:
            with contextlib.suppress(Exception):  # the student's own __str__
                message = str(error)[:TEXT_CHARS_MAX]
        handled[key] = [1, message]


def listen() -> None:
    """Keeps the first characters that are printed in the trial: `print` looks `write` up in the stream."""
    stream = sys.stdout
    plain = getattr(stream, "write", None)
    if type(stream).__name__ != "TextIOWrapper" or plain is None:  # the student's own
        return

    def write(text: str) -> Any:
        printed.append(text[:PRINTED_CHARS_MAX])
        state["printed"] += len(text)
        if state["printed"] > PRINTED_CHARS_MAX or len(printed) > PRINTED_CHARS_MAX:
            deafen()
        return plain(text)

    stream.write = write  # type: ignore[method-assign]
    listening.append(stream)


listening: list[Any] = []


def deafen() -> None:
    """Prints as before."""
    while listening:
        vars(listening.pop()).pop("write", None)
