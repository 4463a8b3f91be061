"""Says where a script that ran out of time spent it, from the samples that its process sent. The samples are a claim,
which only explains. Of a claim that was made with hidden inputs only a line is shown."""

import ast
import json
import math
from dataclasses import dataclass
from typing import Any

from grader.sandbox.frames import read_arrays

NAME = b"where"
"""What the names of samples begin with; the last one counts."""
CLEAR_SHARE = 0.5
"""The share of the samples that one line must have to be named."""
CODE_CHARS_MAX = 60
HIDDEN_LINES_MAX = 10_000
"""The last line that is shown of a claim that was made with hidden inputs, as of exceptions: more would tell more."""
COUNTED = ("mj_step", "mj_forward")
RATE_MAX = 1e9
WHICH_ENDS = "Check when each of them ends."


def explain_time_out(results: bytes, source: str, *, waits: bool, hidden: bool) -> str:
    """Return sentences on the line with most samples, with a space before them; empty where no line stands out.
    `waits`: the script slept or waited for something. Whatever `results` holds, this does not raise."""
    texts = [payload for name, payload in read_arrays(results) if name.startswith(NAME)]
    try:
        summary = json.loads(texts[-1])
        (line, times), samples, rates = summary["lines"][0], summary["samples"], summary["rates"]
        lines = source.splitlines()
        last = min(len(lines), HIDDEN_LINES_MAX) if hidden else len(lines)
        if type(line) is not int or not 1 <= line <= last or not times / samples >= CLEAR_SHARE:
            return ""
        place = describe_line(source, line, None if hidden else summary.get("stays"), waits=waits)
        rate, busiest = max((compute_rate(rates, name), name) for name in COUNTED)
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError, MemoryError):
        return ""
    called = f" It called {busiest} about {round_figures(rate)} times a second." if rate and not hidden else ""
    return place.format(called=called)


def describe_line(source: str, line: int, stays: Any, *, waits: bool) -> str:
    """Return the sentences of a line, with a field `called`; `stays` is where its innermost lasting call was."""
    tree = ast.parse(source)
    text = shorten(source.splitlines()[line - 1].strip()).replace("{", "{{").replace("}", "}}")
    seen, here = f"in line {line} of your script ({text})", find_place(tree, line)
    if waits:
        return f" It waited {seen}{here.text}: remove that."
    outer = find_place(tree, stays) if type(stays) is int else here
    if outer.loops and outer.function is not here.function:
        return (
            f" It was busy {seen}{here.text}. The loop that begins in line {outer.loops[-1]}{outer.text}, goes on all "
            "the time, and leads there again and again.{called} Check when that loop ends."
        )
    if not here.loops:
        return f" It was busy {seen}{here.text}."
    if len(here.loops) > 1:
        begins = " and ".join(map(str, here.loops))
        return f" It was busy {seen}, in the loops that begin in lines {begins}{here.text}.{{called}} {WHICH_ENDS}"
    begins = "" if here.loops[0] == line else f", in the loop that begins in line {here.loops[0]}"
    return f" It was busy {seen}{begins}{here.text}.{{called}} Check when that loop ends."


@dataclass(frozen=True)
class Place:
    """The function around a line, and the lines in which the loops around it begin, within the function."""

    function: ast.AST | None
    loops: list[int]

    @property
    def text(self) -> str:
        """The function, to end a sentence."""
        name = getattr(self.function, "name", "")
        return f", in {shorten(name)}()" if name else ""


def find_place(tree: ast.AST, line: int) -> Place:
    """Return where a line lies."""
    nodes = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.For | ast.While)
        and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]
    place = Place(None, [])
    for node in sorted(nodes, key=lambda node: node.lineno):
        if isinstance(node, ast.For | ast.While):
            place.loops.append(node.lineno)
        else:
            place = Place(node, [])
    return place


def compute_rate(rates: Any, name: str) -> float:
    """Return how often a function was called in a second; 0 where nothing sensible is said."""
    value = rates.get(name)
    sensible = type(value) is float and math.isfinite(value) and 1 <= value <= RATE_MAX
    return float(value) if sensible else 0.0


def shorten(text: str) -> str:
    """Return a text, its end cut off where it is long."""
    return text if len(text) <= CODE_CHARS_MAX else f"{text[:CODE_CHARS_MAX]}..."


def round_figures(value: float) -> str:
    """Return a number to two figures, with commas."""
    return f"{int(float(f'{value:.2g}')):,}"
