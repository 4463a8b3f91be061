"""Says how an attempt compares with earlier ones at the same question: the same mistake again, or more that holds."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.domain.verdict import Status, format_points

NUMBER = re.compile(r"[0-9][0-9.,/]*(?:e[+-]?[0-9]+)?")
"""Numbers in a diagnosis: the same mistake has others in another attempt."""

COMPARED = frozenset({Status.CORRECT, Status.PARTIAL, Status.INCORRECT, Status.CRASHED, Status.TIMED_OUT})
"""Statuses of attempts that are compared; the others say nothing about the learner's work."""


@dataclass(frozen=True)
class ComparedAttempt:
    """An attempt's number, and its verdict as the learner may see it; only status and points unless `is_whole`."""

    attempt: int
    verdict: Mapping[str, Any]
    is_whole: bool = True

    @property
    def mistake(self) -> str:
        """The diagnosis without its numbers; empty if there is none."""
        return NUMBER.sub("#", self.verdict.get("diagnosis") or "")

    @property
    def points(self) -> float:
        """Its points."""
        return float(self.verdict.get("points") or 0.0)

    @property
    def held(self) -> frozenset[str]:
        """The findings that passed."""
        return frozenset(finding["id"] for finding in self.verdict.get("findings") or () if finding.get("passed"))


def describe_progress(earlier: Sequence[ComparedAttempt], now: ComparedAttempt) -> str:
    """Returns a sentence on an attempt beside earlier ones, in their order; empty where there is nothing to say. It is
    made of what the learner may see of the verdicts alone."""
    before = [
        comparison
        for comparison in earlier
        if comparison.verdict.get("status") in COMPARED and comparison.attempt < now.attempt
    ]
    if not before or now.verdict.get("status") not in COMPARED:
        return ""
    if now.verdict["status"] != Status.CORRECT and now.mistake:
        same = next((index for index in reversed(range(len(before))) if before[index].mistake == now.mistake), None)
        if same is not None:
            return describe_repetition(before, same)
    last, best = before[-1], max(before, key=lambda comparison: comparison.points)
    if now.points > last.points:
        more, several = len(now.held - last.held), len(now.verdict.get("findings") or ())
        hold = "holds" if more == 1 else "hold"
        is_known = last.is_whole and now.held >= last.held
        gained = f": {more} more of {several} {hold}" if more and is_known else ""
        return f"Better than attempt {last.attempt}{gained}, {compare_points(now, last)}."
    holds_as_much = bool(now.held) and best.is_whole and now.held >= best.held  # a person has set the points
    if now.points < best.points and not holds_as_much:
        return f"Attempt {best.attempt} was better, {compare_points(best, now)}: go on from that one."
    return ""


def describe_repetition(before: Sequence[ComparedAttempt], same: int) -> str:
    """Returns the sentence of a mistake that an earlier attempt had already, and of where it was gone."""
    repeated, between = before[same], before[same + 1 :]
    if not between:
        return f"The same mistake as in attempt {repeated.attempt}."
    better = max(between, key=lambda comparison: comparison.points)
    gain = f", with {format_points(better.points)}" if better.points > repeated.points else ""
    return (
        f"The mistake of attempt {repeated.attempt} is back: in attempt {better.attempt} it was gone{gain}. See what "
        "you changed there."
    )


def compare_points(more: ComparedAttempt, less: ComparedAttempt) -> str:
    """Returns the points of two attempts."""
    return f"{format_points(float(f'{more.points:.3g}'))} in place of {less.points:.3g}"
