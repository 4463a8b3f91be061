"""A script with the statement that its diagnosis is about: the lines around it, the others folded, the advice below."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

AROUND = 3
"""Lines that are shown before and after the statement."""

FOLDED_MAX = 300
"""Lines that are folded on either side; more are left out."""

RAISED = re.compile(r"\bin line (\d+) of your script\b|\(line (\d+): ")
"""How verdicts without `line`, which are older, name the line that raised."""

PLACE = re.compile(r" \(line \d+: .*\)(?=$|\.$)|, in line \d+ of your script\b")
"""What a diagnosis says of the place, which is needless beside it."""

CONDITION = "If you did"
"""What begins a sentence that makes no sense without the one before it."""

FIRST = re.compile(r"\bFirst: (.*?)(?= Second: |$)")
FURTHER = re.compile(r" (?:Apart from that|There is more): .*$")
"""Of several mistakes the first stands at the place; the others are elsewhere."""

SENTENCE_END = re.compile(r"(?<=[.!?]) (?=[A-Z])")
CLAUSE = re.compile(r"(?<=[a-z0-9)])(?<!Error)(?<!Exception): (?=[a-z])")
"""What stands before the advice in a sentence such as `data.act does not change: advance it with data.act_dot`."""


@dataclass(frozen=True)
class MarkedLine:
    """A line of a script in three parts, of which the middle one is marked; `hot` lines have the statement."""

    number: int
    before: str
    marked: str = ""
    after: str = ""

    @property
    def text(self) -> str:
        """The whole line."""
        return self.before + self.marked + self.after

    @property
    def hot(self) -> bool:
        """Whether a part of it is marked."""
        return bool(self.marked)


@dataclass(frozen=True)
class MarkedScript:
    """The lines of a script in order: folded, shown up to the end of the statement, shown after it, folded. `advice`
    stands under the statement."""

    above: Sequence[MarkedLine]
    shown: Sequence[MarkedLine]
    rest: Sequence[MarkedLine]
    below: Sequence[MarkedLine]
    advice: str

    @property
    def hot(self) -> Sequence[MarkedLine]:
        """The lines of the statement."""
        return [line for line in self.shown if line.hot]


def mark_script(source: str, verdict: Mapping[str, Any]) -> MarkedScript | None:
    """Returns the script with the statement of the verdict's line marked; None where the verdict is about no line."""
    diagnosis = verdict.get("diagnosis") or ""
    line, span, texts = verdict.get("line") or read_raised_line(diagnosis), verdict.get("span"), source.splitlines()
    if not 1 <= line <= len(texts):
        return None
    if span is None or not line - 1 <= span["end_line"] <= len(texts):
        first, last, start, end = line, line, len(texts[line - 1]) - len(texts[line - 1].lstrip()), None
    else:
        first, last, start, end = span["line"], span["end_line"], span["column"], span["end_column"]
    lines = [MarkedLine(number, text) for number, text in enumerate(texts, 1)]
    for number in range(first, last + 1):
        text = texts[number - 1]
        begin = start if number == first else len(text) - len(text.lstrip())
        stop = end if number == last and end is not None else len(text)
        lines[number - 1] = MarkedLine(number, text[:begin], text[begin:stop] or " ", text[stop:])
    top, bottom = max(0, first - 1 - AROUND), min(len(lines), last + AROUND)
    return MarkedScript(
        lines[max(0, top - FOLDED_MAX) : top], lines[top:last], lines[last:bottom],
        lines[bottom : bottom + FOLDED_MAX], find_advice(diagnosis),
    )  # fmt: skip


def read_raised_line(diagnosis: str) -> int:
    """Returns the line that a diagnosis says has raised; 0 where it says none."""
    match = RAISED.search(diagnosis)
    return int(match[1] or match[2]) if match else 0


def find_advice(diagnosis: str) -> str:
    """Returns the end of a diagnosis that says what to do there; all of it where it has one clause."""
    diagnosis = FURTHER.sub("", PLACE.sub("", diagnosis.strip()))
    if (match := FIRST.search(diagnosis)) is not None:
        return match[1]
    first, *others = SENTENCE_END.split(diagnosis, maxsplit=1)
    if others and not others[0].startswith(CONDITION):
        return others[0]
    colons = (match for match in CLAUSE.finditer(first) if not is_in_parentheses(first, match.start()))
    last = first[next((colon.end() for colon in colons), 0) :]
    return " ".join((last[:1].upper() + last[1:] if last.split(" ")[0].isalpha() else last, *others))


def is_in_parentheses(text: str, place: int) -> bool:
    """Says whether a place of the text stands within parentheses."""
    return text.count("(", 0, place) > text.count(")", 0, place)
