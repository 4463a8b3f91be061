"""Verdict and Finding: what grading says of one submission; the same JSON everywhere."""

import math
from enum import StrEnum
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

POINT_DIGITS = 9
"""Shares of points (a third of 3) are rounded away in their sum."""


class Status(StrEnum):
    """How a submission came out."""

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

    @property
    def uses_attempt(self) -> bool:
        """An answer that could not be read and a fault of ours cost the learner nothing."""
        return self not in (Status.INVALID_ANSWER, Status.GRADER_FAULT)


class Finding(BaseModel):
    """The outcome of one check. `passed` is None where it could not be decided."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    title: str
    passed: bool | None
    points: float
    max_points: float
    message: str
    measured: Any = None
    expected: Any = None


class Verdict(BaseModel):
    """Status, points and findings of one submission; append-only: a regrade is a new one."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    status: Status
    points: float
    max_points: float
    findings: tuple[Finding, ...] = ()
    diagnosis: str | None = None
    read_as: str | None = None
    explain: str | None = None
    evidence: dict[str, Any] = Field(default_factory=dict)
    stdout: str = ""
    stderr: str = ""
    timing_ms: dict[str, float] = Field(default_factory=dict)
    environment: dict[str, str] = Field(default_factory=dict)
    content_digest: str = ""
    submission_digest: str = ""


def status_of(points: float, max_points: float) -> Status:
    """Correct, partial or incorrect by points."""
    if points >= max_points:
        return Status.CORRECT
    return Status.PARTIAL if points > 0 else Status.INCORRECT


def reviewed(verdict: Verdict, points: float, comment: str) -> Verdict:
    """The verdict after a person's decision over it: their points count.

    What was measured stays beside them; what was left open is decided.
    Raises ValueError for points that are not between 0 and those of the question.
    """
    if not 0 <= points <= verdict.max_points:
        raise ValueError(f"points must be between 0 and {verdict.max_points:g}")
    status = status_of(points, verdict.max_points)
    review = Finding(
        id="review",
        title="review",
        passed={Status.CORRECT: True, Status.INCORRECT: False}.get(status),
        points=points,
        max_points=verdict.max_points,
        message=comment or "An instructor has decided.",
    )
    measured = tuple(f for f in verdict.findings if f.id != review.id and not (f.passed is None and f.max_points))
    return verdict.model_copy(update={"status": status, "points": points, "findings": (review, *measured)})


def verdict_of(findings: tuple[Finding, ...], **rest: Any) -> Verdict:
    """The verdict that a set of findings adds up to; `rest` are further fields of Verdict."""
    max_points = round(math.fsum(f.max_points for f in findings), POINT_DIGITS)
    points = round(math.fsum(f.points for f in findings), POINT_DIGITS)
    status = status_of(points, max_points)
    return Verdict(status=status, points=points, max_points=max_points, findings=findings, **rest)
