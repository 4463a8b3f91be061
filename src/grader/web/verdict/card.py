"""A verdict as the page's card: status, diagnosis, findings as a matrix or a list, output, and its plots."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

from markupsafe import Markup

from grader.domain.pages.pictures import Table
from grader.domain.verdict import NO_COMMENT, REVIEW, Status
from grader.web.text.numbers import capitalize, keep_unbroken, mark_code, write_number, write_points, write_quantity
from grader.web.text.prose import cached_prose
from grader.web.text.statuses import FAILED, PASSED, Badge, describe_outcome
from grader.web.verdict import evidence as read
from grader.web.verdict.film import FilmBox, describe_film
from grader.web.verdict.marked_script import MarkedScript, mark_script
from grader.web.verdict.plots import Figure, draw_figures
from grader.web.verdict.work import GivenAnswer

WORD = re.compile(r"([A-Z][a-z]+(?: [a-z]+){0,2}): ")
"""What a message begins with to sum itself up, such as `Too high: `."""
NAMED_LINE = re.compile(r"\b[Ll]ine (\d{1,5})\b")
HIDDEN = re.compile(r"Hidden case (\d+)(: .*)?")
ENDED = frozenset({Status.CRASHED, Status.FORBIDDEN, Status.TIMED_OUT, Status.OUT_OF_MEMORY, Status.OUTPUT_TOO_LARGE})
"""How a script ends as a whole: its verdict has findings only where it ended so in every case."""

TIMES = {"script_wall": "your script", "script_cpu": "of it on the processor", "judge_cpu": "our own simulation"}


@dataclass(frozen=True)
class Cell:
    """One finding: how it ended, and for a failed one what was measured and expected, as far as it is shown."""

    badge: Badge
    title: str
    message: str = ""
    measured: str = ""
    expected: str = ""
    got: float = 0.0
    of: float = 0.0
    rubric: tuple[str, ...] = ()
    is_comment: bool = False

    @property
    def passed(self) -> bool:
        """Whether it needs no further word. A reviewer's comment is read whatever the points."""
        return self.badge == PASSED and not self.is_comment


@dataclass(frozen=True)
class CardRow:
    """One case of a matrix, with a cell for each column."""

    title: str
    cells: tuple[Cell, ...]

    @property
    def passed(self) -> bool:
        """Whether all of its cells passed."""
        return all(cell.passed for cell in self.cells)

    @property
    def got(self) -> float:
        """Its points."""
        return sum(cell.got for cell in self.cells)

    @property
    def of(self) -> float:
        """Its points at most."""
        return sum(cell.of for cell in self.cells)


@dataclass(frozen=True)
class Card:
    """What the template verdict.html shows."""

    given: GivenAnswer
    badge: Badge
    score: str
    diagnosis: str
    read_as: str
    columns: tuple[str, ...] = ()
    rows: tuple[CardRow, ...] = ()
    passed_rows: tuple[CardRow, ...] = ()
    notes: tuple[str, ...] = ()
    cells: tuple[Cell, ...] = ()
    script: MarkedScript | None = None
    tableau: read.Tableau | None = None
    values: tuple[read.Value, ...] = ()
    tables: tuple[Table, ...] = ()
    explanation: Markup = field(default_factory=Markup)
    stdout: str = ""
    stderr: str = ""
    facts: tuple[str, ...] = ()
    evidence: Mapping[str, Any] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[Cell, ...]:
        """The findings that need a further word."""
        return tuple(cell for cell in self.cells if not cell.passed)

    @property
    def passed(self) -> tuple[Cell, ...]:
        """The other findings."""
        return tuple(cell for cell in self.cells if cell.passed)

    @property
    def film(self) -> FilmBox | None:
        """The box of its films; None where no run is to be seen."""
        return describe_film(self.evidence)

    @property
    def figures(self) -> list[Figure]:
        """The plots of the evidence, drawn where a page asks for them."""
        return draw_figures(self.evidence, self.titles)


def build_card(given: GivenAnswer) -> Card | None:
    """Returns the card of an answer; None while it has no verdict."""
    verdict = given.verdict
    if verdict is None:
        return None
    findings = verdict.get("findings") or []
    ended = describe_end(verdict["status"], findings)
    if ended:
        findings = []
    columns, rows = build_matrix(findings)
    cells = [] if columns else merge_cells([build_cell(finding) for finding in findings])
    evidence = verdict.get("evidence") or {}
    titles = {finding["id"]: finding["title"] for finding in findings}
    diagnosis = verdict.get("diagnosis") or verdict.get("remark") or ""
    cases = {title.partition(": ")[0] for title in titles.values()}
    sentence = capitalize(keep_unbroken(diagnosis)) if diagnosis.startswith(tuple(cases)) else keep_unbroken(diagnosis)
    notes = (ended,) if ended else tuple(list_notes(columns, rows, sentence))
    return Card(
        given, given.badge, describe_score(given, verdict), sentence,
        keep_unbroken(verdict.get("read_as") or ""), columns, tuple(row for row in rows if not row.passed),
        tuple(row for row in rows if row.passed), notes, tuple(cells),
        mark_script(given.text, verdict), read.read_one(evidence, "tableau", read.Tableau),
        tuple(read.read_list(evidence, "values", read.Value)), tuple(list_tables(evidence, titles)),
        cached_prose(verdict["explain"]) if verdict.get("explain") else Markup(),
        (verdict.get("stdout") or "").rstrip(), (verdict.get("stderr") or "").rstrip(), tuple(list_facts(verdict)),
        evidence, titles,
    )  # fmt: skip


def describe_score(given: GivenAnswer, verdict: Mapping[str, Any]) -> str:
    """Says how many points a decided answer has, and what a late one counts as: `1 of 1 point, late: 0.5 counts`."""
    if not given.is_decided:
        return ""
    score = f"{write_points(verdict['points'])} of {format_count(verdict['max_points'], 'point')}"
    is_less = given.counted < verdict["points"]
    return f"{score}, late: {write_points(given.counted)} counts" if is_less else score


def list_tables(evidence: Mapping[str, Any], titles: Mapping[str, str]) -> Iterator[Table]:
    """Yields the tables of the evidence that have rows, each headed by the title of its case."""
    for table in read.read_list(evidence, "tables", Table):
        matching = (title for id_, title in titles.items() if id_ == table.case or id_.startswith(f"{table.case}."))
        name = next(matching, table.case).partition(": ")[0]
        if table.rows:
            yield table.model_copy(update={"title": f"{table.title}: {name}" if table.title else name})


def describe_end(status: str, findings: Sequence[Mapping[str, Any]]) -> str:
    """Says that no case ran to its end, in place of a matrix of failures; empty where some did."""
    if status not in ENDED or len(findings) < 2:
        return ""
    return "No case ran to its end."


def format_count(value: float, noun: str) -> str:
    """`1 point`, `2.5 points`."""
    return f"{write_points(value)} {noun}{'' if value == 1 else 's'}"


def build_matrix(findings: Sequence[Mapping[str, Any]]) -> tuple[tuple[str, ...], tuple[CardRow, ...]]:
    """Columns and rows, where every title is `row, column` and each row has the same columns; else nothing."""
    places = [finding["title"].rpartition(", ") for finding in findings]
    columns = tuple(dict.fromkeys(column for _, _, column in places))
    titles = tuple(dict.fromkeys(row for row, _, _ in places))
    is_full = len(columns) > 1 and len(findings) == len(columns) * len(titles) == len({*places})
    if not is_full or "" in titles:
        return (), ()
    cells = {(row, column): build_cell(finding) for (row, _, column), finding in zip(places, findings, strict=True)}
    return columns, tuple(
        CardRow(capitalize(keep_unbroken(row)), tuple(cells[row, column] for column in columns)) for row in titles
    )


def list_notes(columns: Sequence[str], rows: Sequence[CardRow], diagnosis: str = "") -> Iterator[str]:
    """Says what the failed cells of a matrix say beyond their word and the diagnosis: each sentence once, with its
    place. Names the columns, and where other cells of a column failed otherwise, the cases too."""
    places: dict[str, dict[str, list[str]]] = {}
    for row in rows:
        for column, cell in zip(columns, row.cells, strict=True):
            if cell.badge == FAILED and cell.message and cell.message not in diagnosis:
                places.setdefault(cell.message, {}).setdefault(column, []).append(row.title)
    wrong = {column: sum(not row.cells[at].passed for row in rows) for at, column in enumerate(columns)}
    for message, where in places.items():
        held: dict[str, list[str]] = {}
        for name, titles in where.items():
            held.setdefault("" if len(titles) == wrong[name] else describe_cases(titles), []).append(name)
        yield f"{', '.join(describe_place(names, cases, len(columns)) for cases, names in held.items())}: {message}"


def describe_place(names: Sequence[str], cases: str, of: int) -> str:
    """Some columns with the cases in them that are meant: `Euler (Hidden case 1)`; of all columns the cases alone."""
    if not cases:
        return ", ".join(names)
    return cases if len(names) == of else f"{', '.join(names)} ({cases})"


def describe_cases(titles: Sequence[str]) -> str:
    """Titles of cases in a row, hidden ones that follow each other as `Hidden cases 1 to 6`."""
    ranges = []
    for hidden, group in groupby(titles, lambda title: bool(HIDDEN.fullmatch(title) and title[-1].isdigit())):
        some = list(group)
        numbers = [int(title.split()[-1]) for title in some] if hidden else []
        is_whole = len(some) > 1 and numbers == [*range(numbers[0], numbers[0] + len(some))] if hidden else False
        ranges += [describe_range(numbers[0], numbers[-1])] if is_whole else some
    return ", ".join(ranges)


def describe_range(first: int, last: int) -> str:
    """Hidden cases from one number to another."""
    return f"Hidden cases {first} {'and' if last == first + 1 else 'to'} {last}"


def build_cell(finding: Mapping[str, Any]) -> Cell:
    """Returns one finding. What passed says so and no more."""
    badge = describe_outcome(finding["passed"], finding["points"])
    rubric = tuple(list_rubric(finding.get("measured")))
    worth = {"got": finding["points"], "of": finding["max_points"], "rubric": rubric}
    title, message = capitalize(keep_unbroken(finding["title"])), keep_unbroken(finding["message"])
    if badge == PASSED:
        is_comment = finding["id"] == REVIEW and finding["message"] != NO_COMMENT
        return Cell(badge, title, message, is_comment=is_comment, **worth)
    if badge == FAILED and (match := WORD.match(message)):
        badge, message = (
            Badge(match[1].lower(), badge.icon, badge.tone),
            message[match.end() :][:1].upper() + message[match.end() + 1 :],
        )
    measured = "" if rubric else describe_value(finding.get("measured"))
    if {measured, describe_number(finding.get("measured"))} & {*re.split(r"[\s;]|\.(?=\s|$)", message)}:
        measured = ""  # the message has it
    elif measured and measured in message:
        measured = ""
    return Cell(badge, title, message, measured, describe_value(finding.get("expected")), **worth)


def merge_cells(cells: Sequence[Cell]) -> list[Cell]:
    """The cells with those of failed hidden cases in a row that say the same of the same part made one: `Hidden cases 1
    to 6`, `Hidden cases 1 and 2: settling time`. It stands where the first of them stood."""
    merged: list[Cell] = []
    runs: dict[tuple[str, Badge, str], tuple[int, int, int]] = {}
    """Of each part, badge and message: the place in `merged`, the first case and the last one."""
    for cell in cells:
        match = None if cell.passed else HIDDEN.match(cell.title)
        if match is None:
            merged.append(cell)
            continue
        case, part = int(match[1]), match[2] or ""
        at, first, last = runs.get((part, cell.badge, cell.message), (len(merged), case, case))
        if last == case - 1:
            earlier = merged[at]
            title = f"{describe_range(first, case)}{part}"
            merged[at] = replace(earlier, title=title, got=earlier.got + cell.got, of=earlier.of + cell.of)
        else:
            at, first = len(merged), case
            merged.append(cell)
        runs[part, cell.badge, cell.message] = (at, first, case)
    return merged


RANGE = 2
"""A list of so many numbers is the range between them; of more, it is these numbers."""


def describe_value(value: Any) -> str:
    """Returns a measured or expected value in words; empty if there is none."""
    if value is None or isinstance(value, bool):
        return ""
    if isinstance(value, int | float):
        return write_number(value, 5)
    if isinstance(value, str):
        return keep_unbroken(value)
    if isinstance(value, list):
        return (" to " if len(value) == RANGE else ", ").join(map(describe_value, value))
    if isinstance(value, dict):
        return ", ".join(f"{name.replace('_', ' ')} {describe_value(element)}" for name, element in value.items())
    return str(value)


def describe_number(value: Any) -> str:
    """Returns a number to the four figures that messages have."""
    return write_number(value, 4) if isinstance(value, int | float) else "\0"


def list_rubric(measured: Any) -> Iterator[str]:
    """Yields the items of the rubric that a reviewer chose."""
    if isinstance(measured, dict) and isinstance(measured.get("rubric"), list):
        for item in measured["rubric"]:
            yield f"{item['title']} ({write_number(item['points'])})"


def link_lines(text: str) -> Markup:
    """Returns a sentence whose `line 14` leads to that line of the editor."""
    return Markup(NAMED_LINE.sub(r'<a href="#answer" data-go-to="\1">\g<0></a>', str(mark_code(text))))  # noqa: S704


def list_facts(verdict: Mapping[str, Any]) -> Iterator[str]:
    """Says how it was graded: times and versions."""
    times = verdict.get("timing_ms") or {}
    for name, words in TIMES.items():
        if name in times:
            yield f"{write_quantity(times[name], 'ms', 3)} {words}"
    if version := (verdict.get("environment") or {}).get("mujoco"):
        yield f"MuJoCo {version}"
