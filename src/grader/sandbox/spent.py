"""Says where a script that ran out of time spent it, from the samples that its process sent.

The samples are a claim, which only explains. Of a claim that was made with hidden inputs nothing but a line is told.
"""

import ast
import json
import math
from typing import Any

from grader.sandbox.frames import arrays_of

NAME = b"where"
"""What the names of samples begin with; the last one counts."""
CLEAR_SHARE = 0.5
"""The share of the samples that one line must have to be named."""
CODE_CHARS_MAX = 60
COUNTED = ("mj_step", "mj_forward")
RATE_MAX = 1e9


def where_spent(results: bytes, source: str, *, waits: bool, hidden: bool) -> str:
    """Return sentences on the line with most samples, with a space before them; empty where no line stands out.

    `waits`: the script slept or waited for something. Whatever `results` holds, this does not raise.
    """
    texts = [payload for name, payload in arrays_of(results) if name.startswith(NAME)]
    try:
        told = json.loads(texts[-1])
        (line, times), samples, rates = told["lines"][0], told["samples"], told["rates"]
        lines = source.splitlines()
        if type(line) is not int or not 1 <= line <= len(lines) or not times / samples >= CLEAR_SHARE:
            return ""
        function, loop = around(source, line)
        rate, busiest = max((rate_of(rates, name), name) for name in COUNTED)
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError, MemoryError):
        return ""
    place = f"in line {line} of your script ({shortened(lines[line - 1].strip())})"
    if waits:
        return f" It waited {place}{function}: remove that."
    if loop is None:
        return f" It was busy {place}{function}."
    called = f" It called {busiest} about {rounded(rate)} times a second." if rate and not hidden else ""
    begins = "" if loop == line else f", in the loop that begins in line {loop}"
    return f" It was busy {place}{begins}{function}.{called} Check when that loop ends."


def around(source: str, line: int) -> tuple[str, int | None]:
    """Return the function around a line, to end a sentence, and the line in which the innermost loop begins."""
    function, loop = "", None
    nodes = [
        node
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.For | ast.While)
        and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]
    for node in sorted(nodes, key=lambda node: node.lineno):
        if isinstance(node, ast.For | ast.While):
            loop = node.lineno
        else:
            function, loop = f", in {shortened(node.name)}()", None
    return function, loop


def rate_of(rates: Any, name: str) -> float:
    """Return how often a function was called in a second; 0 where nothing sensible is said."""
    value = rates.get(name)
    sensible = type(value) is float and math.isfinite(value) and 1 <= value <= RATE_MAX
    return float(value) if sensible else 0.0


def shortened(text: str) -> str:
    """Return a text, its end cut off where it is long."""
    return text if len(text) <= CODE_CHARS_MAX else f"{text[:CODE_CHARS_MAX]}..."


def rounded(value: float) -> str:
    """Return a number to two figures, with commas."""
    return f"{int(float(f'{value:.2g}')):,}"
