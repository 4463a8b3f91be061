"""Verdicts as text, and as HTML for notebooks. Everything that is written into HTML is escaped."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from html import escape
from typing import Any

from mjgrader import pictures

MARKS = {True: "right", False: "wrong", None: "not judged here"}
COLOURS = {True: "#1a7f37", False: "#b3261e", None: "#6b7280"}
BOX = "border:1px solid #8886;border-radius:6px;padding:.6em 1em;max-width:60em"
UNDER_WAY = ("queued", "running")


def write_check(check: Any) -> str:
    """Returns a check as text."""
    lines = [check.title, *(write_finding(finding) for finding in check.findings), *check.remarks]
    return "\n".join([check.output, "", *lines] if check.output else lines)


def write_finding(finding: Mapping[str, Any]) -> str:
    """Returns one line."""
    return f"  {MARKS[finding['passed']]:>7}  {finding['title']}: {finding.get('message') or ''}".rstrip(": ")


def draw_check(check: Any) -> str:
    """Returns a check as HTML."""
    printed = f"<details><summary>printed</summary><pre>{escape(check.output)}</pre></details>" if check.output else ""
    remarks = "".join(f"<p>{escape(remark)}</p>" for remark in check.remarks)
    return f'<div style="{BOX}"><b>{escape(check.title)}</b>{draw_findings(check.findings)}{printed}{remarks}</div>'


def draw_findings(findings: Sequence[Mapping[str, Any]]) -> str:
    """Returns the cases as a table; a case under several integrators is a row of them."""
    rows = "".join(
        f'<tr><td style="color:{COLOURS[finding["passed"]]};white-space:nowrap">{MARKS[finding["passed"]]}</td>'
        f'<td style="text-align:left">{escape(str(finding["title"]))}</td>'
        f'<td style="text-align:left">{escape(str(finding.get("message") or ""))}</td></tr>'
        for finding in findings
    )
    return f"{draw_matrix(findings)}<table>{rows}</table>"


def draw_matrix(findings: Sequence[Mapping[str, Any]]) -> str:
    """Returns cases against integrators, where the titles say both; else nothing."""
    cells: dict[str, dict[str, Any]] = {}
    for finding in findings:
        case, _, column = str(finding["title"]).rpartition(", ")
        if case and column:
            cells.setdefault(case, {})[column] = finding["passed"]
    columns = list(dict.fromkeys(column for row in cells.values() for column in row))
    if len(cells) < 2 or not 2 <= len(columns) <= 8:
        return ""
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    body = "".join(
        f'<tr><th style="text-align:left">{escape(case)}</th>'
        + "".join(draw_cell(row[column]) if column in row else "<td></td>" for column in columns)
        + "</tr>"
        for case, row in cells.items()
    )
    return f"<table><tr><th></th>{head}</tr>{body}</table>"


def draw_cell(passed: bool | None) -> str:
    """Returns one cell of the matrix."""
    sign = {True: "\u2713", False: "\u2717", None: "?"}[passed]
    return f'<td style="color:{COLOURS[passed]}" title="{MARKS[passed]}">{sign}</td>'


class Answer:
    """A submission. Shows its verdict as text, and in a notebook as HTML."""

    def __init__(self, submission: Mapping[str, Any], site: str, left: int | None = None) -> None:
        self.submission, self.site, self.attempts_left = submission, site, left

    @property
    def id(self) -> str:
        """The submission's id."""
        return str(self.submission["id"])

    @property
    def verdict(self) -> Mapping[str, Any] | None:
        """The verdict; None while there is none."""
        verdict: Mapping[str, Any] | None = self.submission.get("verdict")
        return verdict

    @property
    def status(self) -> str:
        """The verdict's status, else that of the submission."""
        return str((self.verdict or self.submission)["status"])

    @property
    def points(self) -> float | None:
        """The points of the verdict."""
        return None if self.verdict is None else float(self.verdict["points"])

    @property
    def is_under_way(self) -> bool:
        """Whether it is still graded."""
        return self.submission["status"] in UNDER_WAY

    @property
    def facts(self) -> list[str]:
        """What holds for the attempt, in sentences."""
        facts = [f"Attempt {self.submission['attempt']} at {self.submission['question']}."]
        if self.attempts_left is not None:
            one = self.attempts_left == 1
            facts.append("1 attempt is left." if one else f"{self.attempts_left} attempts are left.")
        facts.append(f"On the page: {self.site}/quizzes/{self.submission['quiz']}/{self.submission['question']}")
        return facts

    @property
    def heading(self) -> str:
        """Status and points."""
        if self.verdict is None:
            return self.status.replace("_", " ")
        points = f"{self.verdict['points']:g} of {self.verdict['max_points']:g} points"
        return f"{self.status.replace('_', ' ')}: {points}"

    def __str__(self) -> str:
        verdict = self.verdict or {}
        told = [self.submission.get("withheld"), verdict.get("diagnosis"), verdict.get("stderr")]
        findings = [write_finding(finding) for finding in verdict.get("findings") or []]
        return "\n".join([self.heading, *filter(None, told), *findings, *self.facts])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        verdict = self.verdict or {}
        told = "".join(
            f"<p>{escape(str(one))}</p>" for one in (self.submission.get("withheld"), verdict.get("diagnosis")) if one
        )
        printed = "".join(
            f"<details><summary>{name}</summary><pre>{escape(str(verdict[name]))}</pre></details>"
            for name in ("stdout", "stderr")
            if verdict.get(name)
        )
        drawn = "".join(pictures.draw_evidence(verdict.get("evidence") or {}))
        findings = draw_findings(verdict.get("findings") or []) if verdict.get("findings") else ""
        facts = "".join(f"<div>{escape(fact)}</div>" for fact in self.facts)
        return f'<div style="{BOX}"><b>{escape(self.heading)}</b>{told}{findings}{drawn}{printed}{facts}</div>'


class Progress:
    """Points and dates of every quiz, in this machine's time zone."""

    def __init__(self, quizzes: Sequence[Mapping[str, Any]]) -> None:
        self.quizzes = quizzes

    def list_rows(self) -> Iterator[tuple[str, str, str, str]]:
        """Yields quiz, question, points and due date."""
        for quiz in self.quizzes:
            for question in quiz.get("questions") or []:
                result = question.get("result") or {}
                points = f"{result.get('points', 0):g} of {question.get('points', result.get('max_points', 1)):g}"
                yield str(quiz["id"]), str(question["id"]), points, write_moment(question.get("due"))

    def __str__(self) -> str:
        rows = [("quiz", "question", "points", "due"), *self.list_rows()]
        widths = [max(len(row[column]) for row in rows) for column in range(4)]
        return "\n".join(
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
        )

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in self.list_rows()
        )
        return f"<table><tr><th>quiz</th><th>question</th><th>points</th><th>due</th></tr>{rows}</table>"


def write_moment(text: str | None) -> str:
    """Returns a moment of the API in the local time zone; empty for none."""
    if not text:
        return ""
    moment = datetime.fromisoformat(text.replace("Z", "+00:00")).astimezone()
    return f"{moment:%a %d %b %Y, %H:%M} {moment.tzname()}"
