"""Runs a program with each of its edits on some calls, in the jail: the lines that are run are counted, so that no edit
takes long. This text follows those of `edits` and of the driver in the jail, and uses their names."""

import ast
import contextlib
import io
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

names: dict[str, Any] = globals()
"""Those of `edits` and of the driver: they stand in the same namespace."""

FILE = "<edited>"
LINES_SHARE, LINES_MORE = 4, 2000
"""Lines that an edited program may run: so many times those of the program as it is, and so many more."""


class TooManyLines(BaseException):
    """Ends an edited program that runs too long: no `except Exception` catches it."""


class Counter:
    """Ends what runs more lines of a program than are left."""

    def __init__(self, lines: int) -> None:
        self.left = lines

    def follow(self, frame: types.FrameType, event: str, _: object) -> Any:
        """Is called at each line."""
        if frame.f_code.co_filename != FILE:
            return None
        self.left -= event == "line"
        if self.left < 0:
            raise TooManyLines
        return self.follow

    def call(self, function: Callable[[], Any]) -> Any:
        """Returns what a function returns, counted."""
        sys.settrace(self.follow)
        try:
            return function()
        finally:
            sys.settrace(None)


EMPTY, EMPTY_LIKE = np.empty, np.empty_like


def clear_array(make: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a function that makes an array as `make` does, of nan: what an edit leaves unwritten is no number, and
    not what stood in the memory before."""

    def make_cleared(*arguments: Any, **named: Any) -> Any:
        array = make(*arguments, **named)
        if array.dtype.kind in "fc":
            array.fill(np.nan)
        return array

    return make_cleared


def compute(tree: ast.Module, inputs: Mapping[str, Any]) -> Sequence[Any]:
    """Returns the results of every call, one after the other. Raises whatever the program does."""
    module: dict[str, Any] = {"__name__": "program"}
    vars(np).update(empty=clear_array(EMPTY), empty_like=clear_array(EMPTY_LIKE))
    exec(compile(ast.fix_missing_locations(tree), FILE, "exec"), module)  # noqa: S102 - in the jail
    results: list[Any] = []
    for call in inputs["calls"]:
        model = names["compile_model"](call["model"])
        values = names["call_function"](module[inputs["entry"]], model, call, inputs["results"])
        if isinstance(values, str):
            raise TypeError(values)
        results += values
    return results


def run(student: object, inputs: Mapping[str, Any], submit: Callable[[str, Any], None]) -> None:
    """Called by the jail. Submits the numbers of all edits whose results have the shapes of `shapes`, a row for each,
    and which they are; only edits of `kinds`, of all where it is empty."""
    tree, kinds = ast.parse(inputs["source"]), {*inputs["kinds"]}
    counter = Counter(inputs["lines_max"])
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        counter.call(lambda: compute(tree, inputs))
        used = inputs["lines_max"] - counter.left
        left, rows, which = counter.left, list[Any](), list[int]()
        edits = names["make_edits"](tree, names["find_functions"](tree, inputs["entry"]))
        for index, (kind, _) in enumerate(edits):
            if left <= 0:
                break
            if kinds and kind not in kinds:
                continue
            allowed = min(left, LINES_SHARE * used + LINES_MORE)
            counter = Counter(allowed)
            with contextlib.suppress(Exception, TooManyLines):
                values = counter.call(lambda: compute(tree, inputs))
                if [list(value.shape) for value in values] == inputs["shapes"]:
                    rows.append(np.concatenate([value.ravel() for value in values]))
                    which.append(index)
            left -= max(allowed - counter.left, 1)
    submit("which", np.array(which, dtype=np.int64))
    submit("rows", np.array(rows, dtype=np.float64))
