"""What one learner may do and see at one question, and which points count: decided here for every face. Pure."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from enum import IntEnum
from functools import lru_cache
from typing import Any

from grader.domain.policy import ONE_BY_ONE, Extension, Policy, Progress
from grader.domain.verdict import GRADED_AS, POINT_DIGITS, REVIEW, Finding, Status, Verdict
from grader.questions import Question, Reveal, kind_of

DAY = timedelta(days=1)
NO_EXTENSION = Extension()
ROLES_THAT_SEE_ALL = ("instructor", "service")

UNANSWERED = "Answer the question first: the lab opens with your first answer."

RUN_ENDS = (Status.CRASHED, Status.TIMED_OUT, Status.OUT_OF_MEMORY, Status.OUTPUT_TOO_LARGE, Status.FORBIDDEN)
NOT_ABOUT_CORRECTNESS = (Status.INVALID_ANSWER, Status.GRADER_FAULT, *RUN_ENDS)
"""Statuses that are shown at once, with their sentence: nothing was compared with a right answer."""

RECEIPT_FIELDS = ("max_points", "read_as", "stdout", "stderr", "environment", "content_digest", "submission_digest")
DIRECTION_FIELDS = (*RECEIPT_FIELDS, "status", "points", "direction", "timing_ms")
DIAGNOSIS_FIELDS = ("diagnosis", "line", "span")
FEEDBACK_FIELDS = (*DIRECTION_FIELDS, *DIAGNOSIS_FIELDS, "remark")
DIRECTION_FINDING_FIELDS = ("id", "title", "passed", "points", "max_points", "direction")
FINDING_FIELDS = (*DIRECTION_FINDING_FIELDS, "message", "measured")
RECEIPT_TIMES = ("script_cpu", "script_wall")
"""Times of the learner's own script. Judging takes longer where it searches for the mistake behind a wrong answer."""
DIRECTION_EVIDENCE = ("drawn", "option", "value", "unit", "angles", "claims", "tableau", "models", "motions", "film")
"""Pictures of the learner's own answer, and the numbers that were drawn for them."""
FEEDBACK_EVIDENCE = (*DIRECTION_EVIDENCE, "differences", "motion", "order")
"""Pictures that show how far it is off as well. `limits` and `stability` are the solution's: they tell the limit."""
VALUE_EVIDENCE = (*FEEDBACK_EVIDENCE, "references")
"""Pictures that show what was asked for: the geoms of the author's model."""


REVEAL: Reveal = "size"
"""What the feedback gives away where the author says nothing."""


class Visibility(IntEnum):
    """What a learner sees of their attempts at one question; each level includes the ones below it.

    - `RECEIPT`: what was understood of the answer, its own output, and statuses that say nothing about correctness;
    - `FEEDBACK`: status, points, findings, diagnosis, evidence of the answer itself, and the reviewer's comment, as far
      as the question's `reveal` goes;
    - `SOLUTION`: the explanation, the expected values, and the evidence that draws them.

    The level is the same for all attempts: a solution that is seen through one attempt is seen.
    """

    RECEIPT = 0
    FEEDBACK = 1
    SOLUTION = 2


@dataclass(frozen=True)
class Attempt:
    """One submission of a learner, handed in `at`. Until it has a verdict, `status` is None and `uses_attempt` true."""

    id: str
    number: int
    at: datetime
    status: Status | None
    points: float = 0.0
    uses_attempt: bool = True


@dataclass(frozen=True)
class Decision:
    """What holds for one learner at one question now.

    `why_not` says in a sentence why no answer is taken, and is None where one is. `attempts_left` is None without a
    limit. `multiplier` is what an answer handed in now would get, None where none is taken. `withheld` says when the
    feedback comes, and is None once it may be seen. `due` and `closes` include the learner's extension.
    `why_no_lab` says why the lab of a question may not be run: it shows what was to be predicted, so it opens with
    the first answer, and where feedback is withheld, with the feedback. `sees_all` is so for instructors and
    services.
    """

    why_not: str | None
    attempts_left: int | None
    multiplier: float | None
    shown: Visibility
    withheld: str | None
    due: datetime | None
    closes: datetime | None
    why_no_lab: str | None
    question: Question | None = None
    sees_all: bool = False

    @property
    def reveal(self) -> Reveal:
        """What the feedback gives away where the solution is not shown."""
        return REVEAL if self.question is None else kind_of(self.question).reveal(self.question) or REVEAL

    @property
    def may_answer(self) -> bool:
        """Whether an answer would be taken now."""
        return self.why_not is None


@dataclass(frozen=True)
class CountedPoints:
    """The points that count, the attempts that they come from, and whether they can still change by grading. `is_final`
    is false while an attempt has no verdict, or the newest one waits for a reviewer; where the policy takes the
    average, any one. `is_late` says whether any of the sources was handed in after the learner's due date."""

    points: float
    sources: tuple[Attempt, ...]
    is_final: bool
    is_late: bool = False

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the attempts that the points come from."""
        return tuple(attempt.number for attempt in self.sources)


@lru_cache(maxsize=1024)
def policy_in_force(default: Policy, changes: str | None) -> Policy:
    """The policy of a quiz in a course: that of the content, with the `changes` of the course, JSON text, in place of
    its values. What counts, and what may be seen when, is decided by this one. The content may have changed since the
    changes were checked: then the values may not fit each other, and are in force all the same."""
    if changes is None:
        return default
    values = default.model_dump(mode="json") | json.loads(changes)
    return Policy.model_validate_json(json.dumps(values), context=ONE_BY_ONE)


def has_opened(policy: Policy, now: datetime, role: str) -> bool:
    """Whether the questions of a quiz may be read."""
    return role in ROLES_THAT_SEE_ALL or before_opening(policy, now) is None


def before_opening(policy: Policy, now: datetime) -> str | None:
    """When the quiz opens, in a sentence; None once it has."""
    if policy.opens is None or now >= policy.opens:
        return None
    return f"This quiz opens on {format_moment(policy.opens)}."


def decide(
    policy: Policy, extension: Extension | None, question: Question, progress: Progress, now: datetime, *, role: str,
    published_at: datetime | None = None
) -> Decision:  # fmt: skip
    """Decides what a learner may do and see at a question. `progress` sums up the learner's own attempts at it.
    `published_at` is when an instructor published the feedback of the quiz, None before that. Instructors and services
    see everything, and may try questions at any time."""
    extension = extension or NO_EXTENSION
    due, closes = find_due(policy, extension), find_closing(policy, extension)
    if role in ROLES_THAT_SEE_ALL:
        return replace(UNRESTRICTED, due=due, closes=closes)
    allowed = attempts_allowed(policy, extension, question)
    left = None if allowed is None else max(0, allowed - progress.used)
    why_not = explain_refusal(policy, closes, allowed, left, now)
    closed = closes is not None and now > closes
    withheld = explain_withholding(policy, closes, closed, published_at, now)
    if withheld:
        shown = Visibility.RECEIPT
    else:
        shown = Visibility.SOLUTION if solution_is_open(policy, progress, left, closed) else Visibility.FEEDBACK
    multiplier = None if why_not else late_multiplier(policy, extension, now)
    why_no_lab = withheld if progress.used else UNANSWERED
    return Decision(why_not, left, multiplier, shown, withheld, due, closes, why_no_lab, question)


UNRESTRICTED = Decision(None, None, 1.0, Visibility.SOLUTION, None, None, None, None, sees_all=True)
"""For instructors and services."""


def decide_without_content(role: str) -> Decision:
    """The decision on a question that the course no longer has: with its policy gone, its verdicts are withheld."""
    if role in ROLES_THAT_SEE_ALL:
        return UNRESTRICTED
    gone = "This question is not part of the course at present."
    return Decision(gone, None, None, Visibility.RECEIPT, gone, None, None, gone)


def count_points(attempts: Sequence[Attempt], policy: Policy, extension: Extension | None) -> CountedPoints:
    """The points that count, to 9 digits, late multipliers included; `attempts` in the order of handing in. A learner
    may see them from `Visibility.FEEDBACK` on. Only attempts that used one and have a verdict count; in an average of
    several, those that wait for a reviewer do not count yet. Among equally good ones the first is the best. A taken
    answer keeps counting, also where `due` is moved to an earlier date."""
    used = [attempt for attempt in attempts if attempt.uses_attempt]
    decided = [attempt for attempt in used if attempt.status is not None]
    waiting = used if policy.counts == "average" else used[-1:]
    is_final = len(decided) == len(used) and all(attempt.status is not Status.NEEDS_REVIEW for attempt in waiting)
    if not decided:
        return CountedPoints(0.0, (), is_final)
    extension = extension or NO_EXTENSION
    points = [attempt.points * late_multiplier(policy, extension, attempt.at) for attempt in decided]
    if policy.counts == "average":
        pairs = list(zip(decided, points, strict=True))
        # An attempt that waits for a mark has no points yet.
        counting = [pair for pair in pairs if pair[0].status is not Status.NEEDS_REVIEW] or pairs
        total, sources = math.fsum(share for _, share in counting) / len(counting), [each for each, _ in counting]
    else:
        index = points.index(max(points)) if policy.counts == "best" else -1
        total, sources = points[index], [decided[index]]
    due = find_due(policy, extension)
    is_late = due is not None and any(source.at > due for source in sources)
    return CountedPoints(round(total, POINT_DIGITS), tuple(sources), is_final, is_late)


def late_multiplier(policy: Policy, extension: Extension, at: datetime) -> float:
    """What the points of an answer handed in at a moment are multiplied by: `per_day` to the power of days started."""
    due = find_due(policy, extension)
    if policy.late is None or due is None or at <= due:
        return 1.0
    days = -((due - at) // DAY)
    return max(policy.late.floor, policy.late.per_day**days)


def find_due(policy: Policy, extension: Extension) -> datetime | None:
    """The learner's due date, if the quiz has one."""
    return None if policy.due is None else max(policy.due, extension.due or policy.due)


def find_closing(policy: Policy, extension: Extension) -> datetime | None:
    """The last moment at which the learner may hand in, if there is one."""
    due = find_due(policy, extension)
    if due is None:
        return None
    return max(due, policy.late.until if policy.late else due, extension.until or due)


def attempts_allowed(policy: Policy, extension: Extension, question: Question) -> int | None:
    """How many attempts the learner has at a question; None without a limit."""
    allowed = policy.attempts if question.attempts is None else question.attempts
    return None if allowed is None else allowed + extension.attempts


def explain_refusal(
    policy: Policy, closes: datetime | None, allowed: int | None, left: int | None, now: datetime
) -> str | None:
    """Why no answer is taken now, in a sentence; None where one is."""
    if (unopened := before_opening(policy, now)) is not None:
        return unopened
    if closes is not None and now > closes:
        return f"This quiz closed on {format_moment(closes)}."
    if left != 0:
        return None
    spent = {1: "The only attempt", 2: "Both attempts"}.get(allowed or 0, f"All {allowed} attempts")
    return f"{spent} at this question {'is' if allowed == 1 else 'are'} used up."


def explain_withholding(
    policy: Policy, closes: datetime | None, closed: bool, published_at: datetime | None, now: datetime
) -> str | None:
    """When the feedback comes, in a sentence; None where it may be seen."""
    if policy.feedback == "after_due" and not closed:
        end = "the due date, which is not set yet" if closes is None else format_moment(closes)
        return f"Your answer is recorded; you see how it was graded after {end}."
    if policy.feedback == "after_publish" and (published_at is None or now < published_at):
        return "Your answer is recorded; you see how it was graded once the results are published."
    return None


def solution_is_open(policy: Policy, progress: Progress, left: int | None, closed: bool) -> bool:
    """Whether a learner who sees the feedback also sees the solution. Attempts are spent only when all have their
    verdicts: a fault of the grader would give one back."""
    match policy.solutions:
        case "never":
            return False
        case "with_feedback":
            return True
        case "after_due":
            return closed
        case _:
            spent = left == 0 and not progress.pending
            return closed or spent or progress.solved


def format_moment(moment: datetime) -> str:
    """A moment as every page and sentence writes it: `27 Nov 2026, 18:00 UTC`."""
    return f"{moment.day} {moment:%b %Y, %H:%M} UTC"


NOTHING_SEEN = Verdict(status=Status.NEEDS_REVIEW, points=0.0, max_points=0.0).model_dump(mode="json")
"""A verdict of which nothing may be seen."""
FINDING_UNSEEN = {**dict.fromkeys(Finding.model_fields), "message": ""}


def redact_json(verdict: Any | None, decision: Decision) -> Any | None:
    """A verdict, new or stored, as plain JSON, without what is not to be seen yet: built from lists of what may be seen
    at each level. It is the only way to a learner. Before the feedback the status is `needs_review` and the diagnosis
    says when it comes, except where the grader's status says nothing about correctness. A review does not show."""
    whole = verdict.model_dump(mode="json") if isinstance(verdict, Verdict) else verdict
    if whole is None or decision.shown is Visibility.SOLUTION:
        return whole
    whole = NOTHING_SEEN | whole  # an older one lacks fields
    if decision.shown is Visibility.FEEDBACK:
        return reveal_json(whole, decision.reveal)
    times = {name: ms for name, ms in whole["timing_ms"].items() if name in RECEIPT_TIMES}
    seen = NOTHING_SEEN | choose(whole, RECEIPT_FIELDS) | {"findings": [], "evidence": {}, "timing_ms": times}
    if tells_nothing(whole):
        return seen | choose(whole, DIAGNOSIS_FIELDS) | {"status": graded_as(whole)}
    return seen | {"diagnosis": decision.withheld}


def reveal_json(whole: dict[str, Any], reveal: Reveal) -> dict[str, Any]:
    """The feedback of a whole verdict, without the solution, as far as `reveal` goes. With "direction", the `direction`
    of findings and verdict takes the place of messages and diagnosis, and measured distances are left out. A reviewer's
    finding is shown as it was written."""
    if reveal == "direction":
        findings = [direct(finding) for finding in whole["findings"]]
        diagnosis = choose(whole, DIAGNOSIS_FIELDS) if tells_nothing(whole) else {"diagnosis": whole["direction"]}
        fields = choose(whole, DIRECTION_FIELDS) | diagnosis
    else:
        names = (*FINDING_FIELDS, "expected") if reveal == "value" else FINDING_FIELDS
        findings = [FINDING_UNSEEN | choose(finding, names) for finding in whole["findings"]]
        fields = choose(whole, FEEDBACK_FIELDS)
    shown = {"direction": DIRECTION_EVIDENCE, "size": FEEDBACK_EVIDENCE, "value": VALUE_EVIDENCE}[reveal]
    evidence = {name: value for name, value in whole["evidence"].items() if name in shown}
    return NOTHING_SEEN | fields | {"findings": findings, "evidence": evidence}


def direct(finding: dict[str, Any]) -> dict[str, Any]:
    """A finding that tells the direction of an error alone."""
    measured = finding.get("measured") if finding["id"] == REVIEW else None
    seen = choose(finding, DIRECTION_FINDING_FIELDS)
    return FINDING_UNSEEN | seen | {"message": finding.get("direction") or "", "measured": measured}


def graded_as(whole: dict[str, Any]) -> str:
    """The status that the grader gave, before any review."""
    status: str = whole["evidence"].get(GRADED_AS, whole["status"])
    return status


def tells_nothing(whole: dict[str, Any]) -> bool:
    """Whether the grader's status says nothing about correctness."""
    return graded_as(whole) in NOT_ABOUT_CORRECTNESS


def choose(part: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    """The named fields; an older verdict may lack some."""
    return {name: part[name] for name in names if name in part}


def limit_feedback(verdict: Verdict, reveal: Reveal) -> Verdict:
    """The feedback of a verdict, without the solution, as far as `reveal` goes."""
    return Verdict.model_validate(reveal_json(verdict.model_dump(mode="json"), reveal))


def report_verdict(verdict: Verdict, question: Question) -> Verdict:
    """The verdict as a command reports it, which knows neither attempts nor dates: limited by the author's `reveal`. A
    right answer shows everything. Without `reveal` only expected values, and the evidence that draws them, are left
    out, but of a script, whose hidden cases have none."""
    kind = kind_of(question)
    revealed = kind.reveal(question)
    if verdict.status is Status.CORRECT or (revealed is None and kind.is_script):
        return verdict
    if revealed is not None:
        return limit_feedback(verdict, revealed)
    findings = tuple(finding.model_copy(update={"expected": None}) for finding in verdict.findings)
    evidence = {name: value for name, value in verdict.evidence.items() if name in FEEDBACK_EVIDENCE}
    return verdict.model_copy(update={"findings": findings, "evidence": evidence})
