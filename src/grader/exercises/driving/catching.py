"""Notes the exceptions that `except` clauses of the script catch: `handled`, with class, both lines, and how often. The
code of this file is sent to the jail behind that of the recorder, if the script has the word `except`; it imports
nothing of the grader. A call that is compiled into each clause sees them: tracing (`sys.settrace`, `sys.setprofile`)
would slow every line of the script, and `sys.monitoring` needs Python 3.12. It misses `contextlib.suppress`."""

import ast
import builtins
import contextlib
import sys
import types
from collections.abc import Callable, Mapping
from typing import Any

HANDLED_MAX = 16
"""Different handled exceptions that are noted in a trial; each is counted."""
TEXT_CHARS_MAX = 120
SOURCE_BYTES_MAX = 64 * 1024
"""A longer script is compiled as it is: its syntax tree would take much memory."""

HANDLER = "__handled__"
"""The name of the call in `except` clauses, among the built-in names."""

note: Callable[..., bool] = globals().get("note", lambda *_: False)
state: Mapping[str, int] = globals().get("state", {"open": 0})
"""What the recorder calls so: the harness defines both."""
handled: dict[tuple[str, int, int], list[Any]] = {}


def finish() -> None:
    """Notes what was handled in the trial that ends."""
    for (what, line, clause), (times, message) in handled.items():
        note("handled", {"type": what, "line": line, "clause": clause, "times": times, "message": message})
    handled.clear()


def compile_source(source: str, filename: str) -> types.CodeType:
    """Compiles the student's source, with a call of `handle` at the start of each `except` clause. Falls back on the
    plain compiler, which raises what there is to raise."""
    if len(source) <= SOURCE_BYTES_MAX:
        try:
            tree = ast.parse(source, filename)
            for node in ast.walk(tree):
                if isinstance(node, ast.ExceptHandler):
                    node.body.insert(0, build_call(node))
            vars(builtins)[HANDLER] = handle
            code: types.CodeType = compile(tree, filename, "exec", dont_inherit=True)
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            pass
        else:
            return code
    plain: types.CodeType = compile(source, filename, "exec", dont_inherit=True)
    return plain


def build_call(clause: ast.ExceptHandler) -> ast.stmt:
    """Returns the statement `__handled__(<line of the clause>)`, placed at the clause."""
    call = ast.Expr(ast.Call(ast.Name(HANDLER, ast.Load()), [ast.Constant(clause.lineno)], []))
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
