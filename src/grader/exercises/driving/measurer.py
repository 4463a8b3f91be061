"""Runs a kind's measuring program over what a script submitted in one trial, in a process of the jail of its own. The
code of this file is sent to the jail in place of a script; it imports nothing of the grader."""

import base64
import builtins
import types
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

PROGRAM: dict[str, Any] = {"__name__": "program", "__builtins__": builtins}


def load(program: types.CodeType) -> None:
    """Executes the measuring program, which defines `measure`."""
    exec(program, PROGRAM)  # noqa: S102


def run(student: object, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Called by the jail; there is no student's code in this process."""
    results = {
        name: np.frombuffer(base64.b64decode(text), dtype).reshape(shape)
        for name, (dtype, shape, text) in inputs["results"].items()
    }
    PROGRAM["measure"](inputs["inputs"], results, submit)
