"""What a learner may do and see: reads what the policy needs, and redacts verdicts by it. Every face asks here."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.answering.policies import read_policies
from grader.courses.people.identity import Identity
from grader.courses.rules.policy import (
    ROLES_THAT_SEE_ALL,
    UNRESTRICTED,
    Decision,
    Visibility,
    before_opening,
    decide,
    decide_without_content,
    format_moment,
    has_opened,
)
from grader.domain.policy import Extension, Policy, Progress
from grader.errors import Conflict, NotFound
from grader.library import Library
from grader.questions import Question, Quiz
from grader.store import extensions, results, submissions
from grader.store.tables import Result, now

COUNTS = {"best": "the best one counts", "latest": "the latest one counts", "average": "their average counts"}


@dataclass(frozen=True)
class LearnerAccess:
    """What one user's attempts, extensions and the published quizzes allow them at one moment."""

    library: Library
    policies: Mapping[str, Policy]
    """The policies in force, of the quizzes that were asked for and the content has."""
    role: str
    at: datetime
    progress: Mapping[tuple[str, str], Progress]
    extensions: Mapping[str, Extension]
    published: Mapping[str, datetime]
    _decisions: dict[tuple[str, str], Decision] = field(default_factory=dict, init=False, repr=False, compare=False)

    def decide(self, quiz: str, question: str) -> Decision:
        """What the user may do and see at a question, also one that the content has lost."""
        at = quiz, question
        if at not in self._decisions:
            self._decisions[at] = self._apply_policy(quiz, question)
        return self._decisions[at]

    def _apply_policy(self, quiz: str, question: str) -> Decision:
        if self.role in ROLES_THAT_SEE_ALL:
            return UNRESTRICTED
        try:
            part, policy = self.library.question(quiz, question), self.policies[quiz]
        except NotFound:
            return decide_without_content(self.role)
        extension, published_at = self.extensions.get(quiz), self.published.get(quiz)
        progress = self.progress_at(quiz, question)
        return decide(policy, extension, part, progress, self.at, role=self.role, published_at=published_at)

    def progress_at(self, quiz: str, question: str) -> Progress:
        """What the user's attempts at a question come to."""
        return self.progress.get((quiz, question), Progress())

    def notice(self, quiz: Quiz, question: Question) -> str:
        """What holds at a question now, in sentences: attempts, what an answer would get, and dates."""
        return " ".join(filter(None, (self.describe_attempts(quiz, question), self.describe_dates(quiz, question))))

    def describe_attempts(self, quiz: Quiz, question: Question) -> str:
        """Says how many attempts are left and what an answer would get; or why none is taken."""
        decision, used = self.decide(quiz.id, question.id), self.progress_at(quiz.id, question.id).used
        if decision.why_not is not None:
            return decision.why_not
        sentences = []
        if decision.attempts_left is not None:
            of = decision.attempts_left + used
            attempts = "attempt" if of == 1 else "attempts"
            sentences.append(
                f"{decision.attempts_left} of {of} {attempts} left; {COUNTS[self.policies[quiz.id].counts]}."
            )
        if decision.multiplier is not None and decision.multiplier < 1:
            sentences.append(f"It is late: an answer now gets {decision.multiplier:.0%} of its points.")
        return " ".join(sentences)

    def describe_dates(self, quiz: Quiz, question: Question) -> str:
        """Says until when answers are taken; empty where none is taken, or there is no date."""
        decision = self.decide(quiz.id, question.id)
        if decision.why_not is not None:
            return ""
        sentences = []
        if decision.due is not None and (decision.multiplier is None or decision.multiplier >= 1):
            sentences.append(f"Due on {format_moment(decision.due)}.")
        if decision.closes is not None and decision.closes != decision.due:
            sentences.append(f"Answers are taken until {format_moment(decision.closes)}.")
        return " ".join(sentences)

    def has_opened(self, quiz: str) -> bool:
        """Whether the user may read the questions of a quiz. Raises NotFound."""
        return has_opened(self.policies[self.library.quiz(quiz).id], self.at, self.role)


def require_opened(session: Session, library: Library, who: Identity, quiz: str) -> Policy:
    """Returns the policy in force. Raises Conflict where a learner may not read the questions of a quiz yet, and
    NotFound without such a quiz."""
    policy, clock = read_policies(session, library, who.course, [library.quiz(quiz).id])[quiz], now()
    if not has_opened(policy, clock, who.role):
        raise Conflict(before_opening(policy, clock))
    return policy


def read_access(session: Session, library: Library, who: Identity, at: tuple[str, str] | None = None) -> LearnerAccess:
    """The access of a user at all questions, or `at` one (quiz, question) only, which takes fewer queries."""
    if at is None:
        progress = submissions.compute_progress(session, who.course, who.id)
    else:
        progress = {at: submissions.compute_progress_at(session, who.course, who.id, *at)}
    policies = read_policies(session, library, who.course, library.quizzes if at is None else at[:1])
    question = None if at is None else at[1]
    extensible = [quiz for quiz, policy in policies.items() if may_be_extended(policy, library.quiz(quiz), question)]
    unpublished = [quiz for quiz, policy in policies.items() if policy.feedback == "after_publish"]
    extended = extensions.list_of_learner(session, who.course, who.id, extensible) if extensible else {}
    published = extensions.find_published(session, who.course, unpublished) if unpublished else {}
    return LearnerAccess(library, policies, who.role, now(), progress, extended, published)


def may_be_extended(policy: Policy, quiz: Quiz, question: str | None) -> bool:
    """Whether an extension could change anything at a question or any: where there are dates, or limited attempts."""
    limits = [candidate.attempts for candidate in quiz.questions if question in (None, candidate.id)]
    return policy.due is not None or policy.attempts is not None or any(limit is not None for limit in limits)


def describe_progress(session: Session, access: LearnerAccess, who: Identity, quiz: Quiz) -> dict[str, dict[str, Any]]:
    """The learner's progress by question, as plain JSON: attempts, dates, and what counts once it may be seen. `notice`
    says the same in sentences, for pages."""
    stored = results.find_of_learner(session, who.course, who.id, quiz.id)
    return {part.id: describe_progress_at(access, quiz, part, stored.get(part.id)) for part in quiz.questions}


def describe_progress_at(
    access: LearnerAccess, quiz: Quiz, question: Question, result: Result | None
) -> dict[str, Any]:
    """One question of `describe_progress`."""
    decision = access.decide(quiz.id, question.id)
    seen = result if decision.shown >= Visibility.FEEDBACK else None
    return {
        "attempts_used": access.progress_at(quiz.id, question.id).used, "attempts_left": decision.attempts_left,
        "may_answer": decision.may_answer, "multiplier": decision.multiplier, "due": decision.due,
        "closes": decision.closes, "result": None if seen is None else describe_result(seen),
        "notice": access.notice(quiz, question),
    }  # fmt: skip


def describe_result(result: Result) -> dict[str, Any]:
    """What counts for a learner at a question, as plain JSON."""
    names = ("submission_id", "attempt", "points", "max_points", "is_late", "is_final", "revision")
    return {name: getattr(result, name) for name in names}
