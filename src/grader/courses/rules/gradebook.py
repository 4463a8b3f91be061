"""The gradebook as CSV, row by row: a generic form, and what Canvas and Moodle import. Pure."""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from itertools import repeat
from types import MappingProxyType
from typing import NamedTuple

from grader.courses.rules.csv_cells import BOM, guard, write_lines
from grader.domain.verdict import POINT_DIGITS


class Unit(StrEnum):
    """What has a column."""

    QUESTION = "question"
    QUIZ = "quiz"


class Form(StrEnum):
    """Which columns say who a learner is."""

    GENERIC = "generic"
    CANVAS = "canvas"
    MOODLE = "moodle"


@dataclass(frozen=True)
class Column:
    """One question; or a quiz as a whole, with an empty `question`. `lms_id` is the number of its assignment in Canvas:
    without it Canvas creates a new assignment."""

    quiz: str
    question: str
    title: str
    max_points: float
    lms_id: str = ""

    @property
    def name(self) -> str:
        """What tells the column from all others."""
        return f"{self.quiz}/{self.question}" if self.question else self.quiz


class LearnerRow(NamedTuple):
    """One learner, with the points that count by (quiz, question); what is missing is an empty cell. `user` is the
    name, which several may bear; `id` tells them apart and never changes. `mark` follows a name that another bears too:
    without one Canvas gives the points of both to the first whom it finds by name. `login` is the name that an
    instructor gave first. A name that learners chose themselves is left out: in an LMS it may be the login of another
    person. `lms_id` is the learner's number in Canvas. `hidden` are quizzes with a mark that the reader must not see
    yet: they have no sum."""

    user: str
    login: str = ""
    id: str = ""
    email: str = ""
    section: str = ""
    lms_id: str = ""
    sis_id: str = ""
    points: Mapping[tuple[str, str], float] = MappingProxyType({})
    mark: str = ""
    hidden: frozenset[str] = frozenset()


LEARNER: Mapping[Form, Mapping[str, Callable[[LearnerRow], str]]] = {
    Form.GENERIC: {"user": lambda row: row.user, "id": lambda row: row.id, "email": lambda row: row.email},
    Form.CANVAS: {
        "Student": lambda row: no_points_row(f"{row.user} {row.mark}" if row.mark else row.user),
        "ID": lambda row: row.lms_id,
        "SIS User ID": lambda row: row.sis_id,
        "SIS Login ID": lambda row: row.login,
        "Section": lambda row: row.section,
    },
    Form.MOODLE: {
        "Username": lambda row: row.login,
        "Email address": lambda row: row.email,
        "ID number": lambda row: row.sis_id,
    },
}
"""The columns before the questions, in the order that the form needs."""

DIGITS = {Form.GENERIC: POINT_DIGITS, Form.CANVAS: 6, Form.MOODLE: 6}
"""The decimals of points: Moodle keeps five, Canvas shows two."""

POINTS_ROW = "Points Possible"
"""Canvas takes every row for the points of the assignments whose first cell holds this."""

TOTALS = re.compile("(Current|Final) (Score|Points|Grade)|Override (Score|Grade|Status)")
"""Canvas drops every column whose heading holds one of these."""

NUMBERED = re.compile(r".*\s\(\d+\)", re.DOTALL)
"""Canvas takes the number at the end of such a heading for the id of an assignment."""


def gradebook_csv(
    rows: Iterable[LearnerRow], columns: Sequence[Column], form: Form = Form.GENERIC, *, bom: bool = False
) -> Iterator[str]:
    r"""The lines of the gradebook, ended by "\r\n" (RFC 4180); one learner is held at a time. The generic form ends
    with `points` and `max_points`, the sums over all columns. `bom` marks the text as UTF-8 for Excel, which takes it
    for the local code page otherwise; Canvas and Moodle read it with and without. The form for Canvas has a second row
    with the points of each assignment, or new ones would be made without."""
    mark = BOM if bom else ""
    for line in write_lines(heading_cells(columns, form)):
        yield mark + line
        mark = ""
    yield from write_lines(build_cells(rows, columns, form))


def heading_cells(columns: Sequence[Column], form: Form) -> Iterator[list[str]]:
    """The heading, and for Canvas the points of the assignments."""
    cells, sums = LEARNER[form], ["points", "max_points"] if form is Form.GENERIC else []
    yield [*cells, *list_headings(columns, form), *sums]
    if form is Form.CANVAS:
        blank = [""] * (len(cells) - 1)
        yield [f"    {POINTS_ROW}", *blank, *(number(column.max_points, DIGITS[form]) for column in columns)]


def build_cells(rows: Iterable[LearnerRow], columns: Sequence[Column], form: Form) -> Iterator[list[str]]:
    """The cells of each learner."""
    full = number(math.fsum(column.max_points for column in columns))
    keys, learner = [(column.quiz, column.question) for column in columns], list(LEARNER[form].values())
    for row in rows:
        points = list(map(row.points.get, keys))
        summed = None if row.hidden else math.fsum(filter(None, points))
        total = [number(summed), full] if form is Form.GENERIC else []
        yield [*(guard(cell(row)) for cell in learner), *map(number, points, repeat(DIGITS[form])), *total]


def no_points_row(name: str) -> str:
    """The name of a learner, who cannot pass for the row of points."""
    return name.replace(POINTS_ROW, POINTS_ROW.replace(" ", "_"))


def list_headings(columns: Sequence[Column], form: Form) -> list[str]:
    """One heading for each column: its name in the generic form, else the title. Canvas takes the points of both
    columns from the first where two have one heading: `[name]` is appended to repeated titles, and to those
    that end like the id of an assignment. Titles that look like a total, which it would drop, are replaced. A title
    that no assignment has makes a new one, so titles should stay as they are."""
    if form is Form.GENERIC:
        return [guard(column.name) for column in columns]
    titles = [" ".join(column.title.split()) for column in columns]
    taken = Counter([*titles, *LEARNER[form]])
    unique = [
        title if taken[title] == 1 and title else f"{title} [{column.name}]".strip()
        for title, column in zip(titles, columns, strict=True)
    ]
    if form is Form.MOODLE:
        return [guard(title) for title in unique]
    return [guard(canvas_heading(title, column)) for title, column in zip(unique, columns, strict=True)]


def canvas_heading(title: str, column: Column) -> str:
    """The heading by which Canvas finds an assignment, or makes one of this title."""
    if TOTALS.search(title):
        title = column.name
    if column.lms_id:
        return f"{title} ({column.lms_id})"
    return f"{title} [{column.name}]" if NUMBERED.fullmatch(title) else title


@lru_cache(maxsize=4096)
def number(value: float | None, digits: int = POINT_DIGITS) -> str:
    """Points to some decimals without an exponent, which Canvas does not read, or trailing zeros; empty for None."""
    if value is None:
        return ""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
