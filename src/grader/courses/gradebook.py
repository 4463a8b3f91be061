"""The gradebook as CSV, row by row: a generic form, and what Canvas and Moodle import. Pure."""

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache

from grader.domain.verdict import POINT_DIGITS

BOM = "\ufeff"
FORMULA = re.compile(r"'*(?:\s*[=+\-@＝＋－＠]|[\t\r\n])")
"""Texts that a spreadsheet may run as a formula. Source: OWASP, CSV injection."""


class Form(StrEnum):
    """Which columns say who a learner is."""

    GENERIC = "generic"
    CANVAS = "canvas"
    MOODLE = "moodle"


@dataclass(frozen=True)
class Column:
    """One question. `lms_id` is the number of its assignment in Canvas: without it Canvas creates a new assignment."""

    quiz: str
    question: str
    title: str
    max_points: float
    lms_id: str = ""


@dataclass(frozen=True)
class Row:
    """One learner, with the points that count by (quiz, question); what is missing is an empty cell."""

    user: str
    name: str = ""
    email: str = ""
    section: str = ""
    lms_id: str = ""
    sis_id: str = ""
    points: Mapping[tuple[str, str], float] = field(default_factory=dict)


LEARNER: Mapping[Form, Mapping[str, Callable[[Row], str]]] = {
    Form.GENERIC: {"user": lambda row: row.user, "name": lambda row: row.name, "email": lambda row: row.email},
    Form.CANVAS: {
        "Student": lambda row: row.name or row.user,
        "ID": lambda row: row.lms_id,
        "SIS User ID": lambda row: row.sis_id,
        "SIS Login ID": lambda row: row.user,
        "Section": lambda row: row.section,
    },
    Form.MOODLE: {"Username": lambda row: row.user, "Email address": lambda row: row.email},
}
"""The columns before the questions, in the order that the form needs."""


class _Line:
    """A file whose `write` returns the text, so that csv.writer.writerow returns the line."""

    def write(self, text: str) -> str:
        return text


def gradebook_csv(
    rows: Iterable[Row], columns: Sequence[Column], form: Form = Form.GENERIC, *, bom: bool = False
) -> Iterator[str]:
    r"""The lines of the gradebook, ended by "\r\n" (RFC 4180); one learner is held at a time.

    The generic form ends with `points` and `max_points`, the sums over all columns. `bom` marks the text as UTF-8
    for Excel, which takes it for the local code page otherwise; Canvas and Moodle read it with and without.
    """
    line = csv.writer(_Line()).writerow
    names, cells = headings(columns, form), LEARNER[form]
    sums = ["points", "max_points"] if form is Form.GENERIC else []
    yield (BOM if bom else "") + line([*cells, *names, *sums])
    full = number(math.fsum(column.max_points for column in columns))
    for row in rows:
        points = [row.points.get((column.quiz, column.question)) for column in columns]
        total = [number(math.fsum(value for value in points if value is not None)), full] if sums else []
        texts = [guarded(cell(row)) for cell in cells.values()]
        yield line([*texts, *("" if value is None else number(value) for value in points), *total])


def headings(columns: Sequence[Column], form: Form) -> list[str]:
    """One heading for each column: `quiz/question` in the generic form, else the title.

    Canvas takes the points of both columns from the first where two have one heading: `[quiz/question]` is appended
    to repeated titles.
    """
    if form is Form.GENERIC:
        return [guarded(f"{column.quiz}/{column.question}") for column in columns]
    titles = [" ".join(column.title.split()) for column in columns]
    taken = Counter([*titles, *LEARNER[form]])
    unique = [
        title if taken[title] == 1 and title else f"{title} [{column.quiz}/{column.question}]".strip()
        for title, column in zip(titles, columns, strict=True)
    ]
    if form is Form.MOODLE:
        return [guarded(title) for title in unique]
    return [
        guarded(f"{title} ({column.lms_id})" if column.lms_id else title)
        for title, column in zip(unique, columns, strict=True)
    ]


def guarded(text: str) -> str:
    """The text as a cell that no spreadsheet runs: an apostrophe before what looks like a formula.

    Guarding a guarded text adds another apostrophe, so removing one always gives the text back.
    """
    return f"'{text}" if FORMULA.match(text) else text


@lru_cache(maxsize=4096)
def number(value: float) -> str:
    """Points to 9 digits without an exponent, which Canvas does not read, and without trailing zeros."""
    text = f"{value:.{POINT_DIGITS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
