"""Says where a script that ran out of time spent it, from the samples that its process sent. The samples are a claim,
which only explains. Of a claim that was made with hidden inputs only a line is shown."""

import ast
import json
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

from grader.sandbox.frames import read_arrays

NAME = b"where"
"""What the names of samples begin with; the last one counts."""
CLEAR_SHARE = 0.5
"""The share of the samples that one line must have to be named."""
CODE_CHARS_MAX = 40
HIDDEN_LINES_MAX = 10_000
"""The last line that is shown of a claim that was made with hidden inputs, as of exceptions: more would tell more."""
COUNTED = ("mj_step", "mj_forward")
RATE_MAX = 1e9
UNENDED = "went on"
WHICH_ENDS = "Check when each of them ends."


@dataclass(frozen=True)
class Above:
    """Where the time was spent from: the line of the innermost call that `stays` all the time, and the line of most
    samples in the outermost call of the script; None or 0 where none is known."""

    stays: Any = None
    outermost: int = 0


@dataclass(frozen=True)
class Surroundings:
    """The function around a line, and the lines in which the loops around it begin, within the function."""

    function: ast.AST | None
    loops: list[int]

    @property
    def text(self) -> str:
        """The function, to end a sentence."""
        name = getattr(self.function, "name", "")
        return f", in {shorten(name)}()" if name else ""


def explain_time_out(results: bytes, source: str, *, waits: bool, hidden: bool) -> str:
    """Return sentences on the line with most samples, else on the loop with most, with a space before them; empty where
    neither stands out. `waits`: the script slept or waited for something. Whatever `results` holds, this does not
    raise."""
    texts = [payload for name, payload in read_arrays(results) if name.startswith(NAME)]
    try:
        summary = json.loads(texts[-1])
        counts, samples, rates = summary["lines"], summary["samples"], summary["rates"]
        last = min(len(source.splitlines()), HIDDEN_LINES_MAX) if hidden else len(source.splitlines())
        line = choose_line(counts, samples, last)
        above = Above() if hidden else Above(summary.get("stays"), choose_line(summary.get("outer"), samples, last))
        if line:
            place = describe_line(source, line, above, waits=waits)
        else:
            place = describe_loop(source, counts, samples, above)
        rate, busiest = max((compute_rate(rates, name), name) for name in COUNTED)
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError, MemoryError):
        return ""
    called = f" It called {busiest} about {round_figures(rate)} times a second." if rate and not hidden else ""
    return place.format(called=called)


def choose_line(counts: Any, samples: Any, last: int) -> int:
    """Return the line with most samples; 0 where it has not CLEAR_SHARE of them, or is not in the script."""
    if not counts:
        return 0
    line, times = counts[0]
    return line if type(line) is int and 1 <= line <= last and times / samples >= CLEAR_SHARE else 0


def describe_loop(source: str, counts: Any, samples: Any, above: Above) -> str:
    """Return the sentences of the innermost loop around most samples; of the one that lasts where no loop has
    CLEAR_SHARE of them."""
    tree, shares = ast.parse(source), Counter[int]()
    for line, times in counts:
        loops = find_place(tree, line).loops if type(line) is int else []
        shares.update(dict.fromkeys(loops, times))
    clear = [loop for loop, times in shares.items() if times / samples >= CLEAR_SHARE]
    if not clear:
        lasting = find_place(tree, above.stays) if type(above.stays) is int else Surroundings(None, [])
        if not lasting.loops:
            return describe_outermost(source, tree, above)
        loop = quote_line(source, lasting.loops[-1])
        return f" The loop in {loop}{lasting.text}, {UNENDED}. Check when it should end."
    inner = max(clear)
    here = find_place(tree, inner)
    seen = f" It was busy in the loop that begins in {quote_line(source, inner)}{here.text}."
    return f"{seen}{describe_above(source, tree, here, above) or '{called} Check when that loop ends.'}"


def describe_outermost(source: str, tree: ast.AST, above: Above) -> str:
    """Return the sentences on the loop that called what took the time; empty if none did."""
    place = find_place(tree, above.outermost)
    if not place.loops:
        return ""
    begins = quote_line(source, place.loops[-1])
    return f" It was busy in what the loop in {begins}{place.text}, calls.{{called}} Check how often it runs."


def describe_above(source: str, tree: ast.AST, here: Surroundings, above: Above) -> str:
    """Return the sentences on the loop of another function that leads to where the time was spent; empty if none."""
    lasts = type(above.stays) is int
    place = find_place(tree, above.stays if lasts else above.outermost)  # else all calls have ended while it sampled
    if place.loops and place.function is not here.function:
        begins = quote_line(source, place.loops[-1])
        how = f"{UNENDED}, and leads" if lasts else "leads"
        leads = f"The loop in {begins}{place.text}, {how} there each time."
        return f" {leads}{{called}} Check when that loop ends."
    return ""


def quote_line(source: str, line: int) -> str:
    """Return a line's number and text, with braces doubled."""
    text = shorten(source.splitlines()[line - 1].strip()).replace("{", "{{").replace("}", "}}")
    return f"line {line} ({text})"


def describe_line(source: str, line: int, above: Above, *, waits: bool) -> str:
    """Return the sentences of a line, with a field `called`."""
    tree = ast.parse(source)
    text = shorten(source.splitlines()[line - 1].strip()).replace("{", "{{").replace("}", "}}")
    seen, here = f"in line {line} of your script ({text})", find_place(tree, line)
    if waits:
        return f" It waited {seen}{here.text}: remove that."
    if leads := describe_above(source, tree, here, above):
        return f" It was busy {seen}{here.text}.{leads}"
    if not here.loops:
        return f" It was busy {seen}{here.text}."
    if len(here.loops) > 1:
        begins = " and ".join(map(str, here.loops))
        return f" It was busy {seen}, in the loops that begin in lines {begins}{here.text}.{{called}} {WHICH_ENDS}"
    begins = "" if here.loops[0] == line else f", in the loop that begins in {quote_line(source, here.loops[0])}"
    return f" It was busy {seen}{begins}{here.text}.{{called}} Check when that loop ends."


def find_place(tree: ast.AST, line: int) -> Surroundings:
    """Return where a line lies."""
    nodes = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.For | ast.While)
        and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]
    place = Surroundings(None, [])
    for node in sorted(nodes, key=lambda node: node.lineno):
        if isinstance(node, ast.For | ast.While):
            place.loops.append(node.lineno)
        else:
            place = Surroundings(node, [])
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
