"""Verdict and Finding: the result of grading one submission."""

import math
from enum import StrEnum
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, TypeAdapter

PlainJson = Annotated[Any, AfterValidator(TypeAdapter[JsonValue](JsonValue).validate_python)]
"""A value of JSON. An array or a class of a kind of exercise is refused here, not when the verdict is saved."""

POINT_DIGITS = 9
"""Decimals of a sum of points, so that three thirds of a point add up to 1."""

GRADED_AS = "graded_as"
"""The key of the evidence of a reviewed verdict that holds the status before the first review."""


REVIEW = "review"
"""The id of the finding of a reviewer."""

NO_COMMENT = "An instructor has decided."
"""What this finding tells where the reviewer wrote no comment."""


class Status(StrEnum):
    """The outcome of a submission."""

    CORRECT = "correct"
    PARTIAL = "partial"
    INCORRECT = "incorrect"
    NEEDS_REVIEW = "needs_review"
    INVALID_ANSWER = "invalid_answer"
    CRASHED = "crashed"
    TIMED_OUT = "timed_out"
    OUT_OF_MEMORY = "out_of_memory"
    OUTPUT_TOO_LARGE = "output_too_large"
    FORBIDDEN = "forbidden"
    GRADER_FAULT = "grader_fault"

    def __init__(self, name: str) -> None:
        self.uses_attempt = name not in ("invalid_answer", "grader_fault")
        """Whether it counts as an attempt: an unreadable answer and a fault of the grader do not."""


class Finding(BaseModel):
    """The outcome of one criterion; `passed` is None if it is undecided. With "reveal": "direction", `direction` takes
    the place of `message`; None: no message there. A list of two numbers in `measured` or `expected` is an interval;
    give several numbers by name, in a dict."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    id: str
    title: str
    passed: bool | None
    points: float
    max_points: float
    message: str
    direction: str | None = None
    measured: PlainJson = None
    expected: PlainJson = None


class Span(BaseModel):
    """A statement of a script: lines from 1, columns from 0 in characters; `end_column` is the one after its last."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    line: int
    column: int
    end_line: int
    end_column: int


class Verdict(BaseModel):
    """Status, points and findings of one submission. Verdicts are append-only: a regrade adds one. With "reveal":
    "direction", `direction` takes the place of `diagnosis`; None: no diagnosis there. `line` is the line of the
    script, from 1, that the diagnosis is about, and `span` the statement there; None where it is about no line.
    `remark` is a sentence on a right answer."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)

    status: Status
    points: float
    max_points: float
    findings: tuple[Finding, ...] = ()
    diagnosis: str | None = None
    direction: str | None = None
    line: int | None = None
    span: Span | None = None
    read_as: str | None = None
    explain: str | None = None
    remark: str | None = None
    evidence: dict[str, PlainJson] = Field(default_factory=dict)
    stdout: str = ""
    stderr: str = ""
    timing_ms: dict[str, float] = Field(default_factory=dict)
    environment: dict[str, str] = Field(default_factory=dict)
    content_digest: str = ""
    submission_digest: str = ""


def status_of(points: float, max_points: float) -> Status:
    """Correct, partial or incorrect, by points."""
    if points >= max_points:
        return Status.CORRECT
    return Status.PARTIAL if points > 0 else Status.INCORRECT


def apply_review(verdict: Verdict, points: float, comment: str) -> Verdict:
    """The verdict with the points of a reviewer, as the first finding. Measured findings stay; undecided ones with
    points are dropped. The grader's own status is kept as evidence `graded_as`: before the feedback a learner sees no
    other. Raises ValueError for points below 0 or above those of the question."""
    if not 0 <= points <= verdict.max_points:
        raise ValueError(f"points must be between 0 and {verdict.max_points:g}")
    status = status_of(points, verdict.max_points)
    message = comment or NO_COMMENT
    review = Finding(
        id=REVIEW,
        title="review",
        passed={Status.CORRECT: True, Status.INCORRECT: False}.get(status),
        points=points,
        max_points=verdict.max_points,
        message=message,
        direction=message,
    )
    measured = tuple(f for f in verdict.findings if f.id != review.id and not (f.passed is None and f.max_points))
    decided = {"status": status, "points": points, "findings": (review, *measured)}
    return verdict.model_copy(update={**decided, "evidence": {GRADED_AS: verdict.status.value, **verdict.evidence}})


def verdict_of(findings: tuple[Finding, ...], **rest: Any) -> Verdict:
    """The verdict with the sum of the findings' points; `rest` are further fields of Verdict."""
    max_points = round(math.fsum(f.max_points for f in findings), POINT_DIGITS)
    points = round(math.fsum(f.points for f in findings), POINT_DIGITS)
    status = status_of(points, max_points)
    return Verdict(status=status, points=points, max_points=max_points, findings=findings, **rest)


def format_points(points: float) -> str:
    """`1 point`, `2.5 points`."""
    return f"{points:g} point{'' if points == 1 else 's'}"
