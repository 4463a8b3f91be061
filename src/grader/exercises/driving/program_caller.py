"""Calls functions of an author's program, `function(model, numbers, rng)`, in the jail. The code of this file is sent
there, with the program in place of a script; it imports nothing of the grader. The process waits for calls over the
channel of the jail, so that calls do not each pay for a process. The program runs anew for each, so that what a call
gives depends on its arguments alone. What the program prints is dropped.

A call is JSON, and so is its answer, which goes back in pieces; each but the last begins with MORE."""

import json
import os
import random
import signal
import sys
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

NAME = "program"
"""The `__name__` of every author's program."""

MORE, LAST = b"+", b"."
PIECE_BYTES = 60_000
ANSWER_BYTES_MAX = 2_000_000
SAMPLED_FROM, SAMPLES = 0.5, 50
"""The jail looks where a call is, once it has taken this share of its CPU time, and so often until its end."""

CODES: list[types.CodeType] = []

exchange: Callable[[bytes | None], bytes | None] = globals().get("exchange", lambda _: None)
"""Sends a piece of an answer, and returns the next message: the jail defines it."""


def compile_source(source: str, filename: str) -> types.CodeType:
    """Called by the jail: compiles the program, which runs with each call, and nothing in its place."""
    CODES.append(compile(source, filename, "exec", dont_inherit=True))
    return compile("", filename, "exec")


def run(program: types.ModuleType, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Called by the jail: answers calls. There is no student's code in this process."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    call = exchange(None)
    while call is not None:
        for piece in split_answer(answer_call(json.loads(call), inputs["cpu_s"])):
            call = exchange(piece)


def split_answer(answer: Mapping[str, Any]) -> Iterator[bytes]:
    """Yields the pieces of an answer. Raises ValueError if it is too long."""
    text = json.dumps(answer).encode()
    if len(text) > ANSWER_BYTES_MAX:
        raise ValueError(f"what it returns takes more than {ANSWER_BYTES_MAX // 1_000_000} MB as JSON")
    last = (len(text) - 1) // PIECE_BYTES
    for index in range(last + 1):
        yield (MORE if index < last else LAST) + text[index * PIECE_BYTES : (index + 1) * PIECE_BYTES]


def answer_call(call: Mapping[str, Any], cpu_s: float) -> dict[str, Any]:
    """Runs the program, and makes a call that may take `cpu_s`. Raises what the program raises."""
    random.seed(0)
    np.random.seed(0)
    module = sys.modules[NAME] = types.ModuleType(NAME)
    signal.setitimer(signal.ITIMER_PROF, SAMPLED_FROM * cpu_s, (1 - SAMPLED_FROM) * cpu_s / SAMPLES)
    try:
        exec(CODES[0], vars(module))  # noqa: S102 - what the jail is for
        return call_function(vars(module), call)
    except Exception as error:
        if call["numbers"]:
            error.add_note(f"(with {', '.join(f'{name} = {at:.4g}' for name, at in call['numbers'].items())})")
        raise
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def call_function(names: Mapping[str, Any], call: Mapping[str, Any]) -> dict[str, Any]:
    """Returns what the function of a program with these names returned, as plain JSON; in place of a list the type of
    what it is, and of a program without the function those that it defines."""
    function = names.get(call["function"])
    if not callable(function):
        return {"defines": [name for name, value in names.items() if getattr(value, "__module__", "") == NAME]}
    model = mujoco.MjModel.from_xml_string(call["xml"]) if call["xml"] else None
    made = function(model, dict(call["numbers"]), np.random.default_rng(call["seed"]))
    return {"made": [*map(write_plainly, made)]} if isinstance(made, list | tuple) else {"type": name_type(made)}


def write_plainly(value: object) -> Any:
    """Returns a text, numbers as nested lists, or the type of anything else."""
    if isinstance(value, str):
        return str(value)
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        return {"type": name_type(value)}
    return array.tolist() if array.dtype.kind in "iuf" else {"type": name_type(value)}


def name_type(value: object) -> str:
    """Returns the name of a value's type."""
    return type(value).__name__
