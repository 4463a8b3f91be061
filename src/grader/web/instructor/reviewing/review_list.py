"""`/instructor/review`: lists of answers to review. It needs no script."""

import json
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import Depends, Query, Request
from fastapi.responses import Response
from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.courses.people.namesakes import make_marks, mark_name
from grader.courses.reviewing import reviews
from grader.courses.reviewing.blinding import hide_names
from grader.courses.reviewing.desk import Desk
from grader.domain.verdict import Status
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.store import submissions
from grader.store.reviewing import reviews as stored
from grader.store.reviewing.reviews import Queue
from grader.store.submissions import NEEDS_REVIEW, SubmissionFilter
from grader.store.tables import ReviewClaim, Submission, now
from grader.web.frame.inputs import Visitor
from grader.web.frame.rendering import page
from grader.web.learner.pages import show_sign_in
from grader.web.text.moments import format_day
from grader.web.text.numbers import write_span
from grader.web.text.questions import describe_quiz, list_titles
from grader.web.text.statuses import QUEUED, RUNNING, Badge, describe_status

PAGE = "/instructor/review"
ROWS = 50
"""Answers on one page."""
EXCERPT = 72
"""Characters of an answer in a list."""

FIRST, SECOND, DIFFER, ALL = "reviews", "second", "disagreements", "submissions"
LISTS = {
    FIRST: "waiting for a review",
    SECOND: "waiting for my second mark",
    DIFFER: "two marks that differ",
    ALL: "all answers",
}
"""The lists, by the value of `which`."""

router = page_router()


@dataclass(frozen=True)
class Chosen:
    """A list, and the quiz, question and learner's name that it is narrowed to."""

    which: str
    quiz: str = ""
    question: str = ""
    user: str = ""

    @property
    def query(self) -> str:
        """The same, as the query of an address."""
        what = f"{self.quiz}/{self.question}" if self.question else self.quiz
        named = {"which": self.which, "what": what, "user": self.user}
        return urlencode({name: value for name, value in named.items() if value})

    def wanted(self, who: Identity) -> SubmissionFilter:
        """Returns the same, as queries take it."""
        return SubmissionFilter(who.course, self.user or None, self.quiz or None, self.question or None)

    def queue(self, desk: Desk, session: Session, who: Identity) -> Queue:
        """Returns the answers that wait for a mark: for the second in that list, in the others for the first."""
        return reviews.list_queue(desk, session, self.wanted(who), who.id if self.which == SECOND else None)


async def parse_choice(
    which: Annotated[str, Query(max_length=64)] = FIRST,
    what: Annotated[str, Query(max_length=200)] = "",
    user: Annotated[str, Query(max_length=200)] = "",
) -> Chosen:
    """Returns the list that an address names; `what` is a quiz, or a quiz and its question."""
    quiz, _, question = what.partition("/")
    return Chosen(which if which in LISTS else FIRST, quiz, question, user.strip())


Choice = Annotated[Chosen, Depends(parse_choice)]


@dataclass(frozen=True)
class AnswerRow:
    """One answer of a list. `held_by` names who reviews it, `is_theirs` where that is another instructor."""

    id: str
    learner: str
    quiz: str
    title: str
    excerpt: str
    at: str
    waited: str
    badge: Badge
    points: tuple[float, float] | None
    held_by: str
    is_theirs: bool
    to_claim: bool


@router.get(PAGE)
def show(
    request: Request, services: AppServices, who: Visitor, chosen: Choice, *,
    after: Annotated[str, Query(max_length=32)] = "", said: Annotated[str, Query(max_length=16)] = "",
    last: Annotated[str, Query(pattern="^[0-9a-f]{0,32}$")] = "",
) -> Response:  # fmt: skip
    """One list of answers; to anyone but an instructor, how to sign in."""
    if who is None or not who.is_instructor:
        return show_sign_in(request, services, who)
    desk = services.desk_of(who.course)
    with services.database.read() as session:
        rows, looked_up = list_rows(desk, session, who, chosen, after or None)
    if looked_up:
        with services.database.write() as session:
            record(session, who, who.course, Action.LOOKED_UP, chosen.user)
    quizzes = [describe_quiz(desk.library, quiz) for quiz in desk.library.list_asking()]
    following = rows[ROWS - 1].id if len(rows) > ROWS else None
    shown: dict[str, Any] = {"quizzes": quizzes, "lists": LISTS, "chosen": chosen, "following": following}
    return page(request, "review.html", who=who, rows=rows[:ROWS], said=said, last=last, **shown)


def list_rows(
    desk: Desk, session: Session, who: Identity, chosen: Chosen, after: str | None
) -> tuple[list[AnswerRow], bool]:
    """Returns one answer more than a page has, beginning after the id `after`; and whether a name lifted pseudonyms."""
    answers, claims = find_answers(desk, session, who, chosen, after)
    seen = hide_names(
        desk, session, who, answers, submissions.read_verdicts(session, answers), always=chosen.which != ALL
    )
    looked_up = chosen.which == ALL and bool(chosen.user and seen.names)  # who asks by name knows whose it is
    names, titles = {} if looked_up else seen.names, list_titles(desk.library)
    marks = make_marks(session, who.course)
    rows = [
        make_row(
            submission,
            seen.verdicts.get(submission.id),
            name_learner(submission, names, marks),
            titles,
            name_holder(claims.get(submission.id), who),
        )
        for submission in answers
    ]
    return rows, looked_up


def find_answers(
    desk: Desk, session: Session, who: Identity, chosen: Chosen, after: str | None
) -> tuple[Sequence[Submission], Mapping[str, ReviewClaim]]:
    """Returns the answers of a list and the claims on them: all newest first, those that wait oldest first."""
    if chosen.which == ALL:
        return submissions.page(session, chosen.wanted(who), after, ROWS + 1), {}
    if chosen.which == DIFFER:
        wanted = replace(chosen.wanted(who), user=None)  # a name would tell whose answers they are
        differ = stored.list_disagreements(session, wanted, after, ROWS + 1, who.id)
        return [submission for submission, _ in differ], {}
    waiting = stored.page(session, chosen.queue(desk, session, who), after, ROWS + 1, now())
    return [submission for submission, _ in waiting], {
        submission.id: claim for submission, claim in waiting if claim is not None
    }


def name_learner(submission: Submission, names: Mapping[str, str], marks: Mapping[str, str]) -> str:
    """Whose answer it is: a pseudonym of `names`, or the name with its mark."""
    return names[submission.id] if submission.id in names else mark_name(submission.user, submission.learner, marks)


def name_holder(claim: ReviewClaim | None, who: Identity) -> tuple[str, bool]:
    """Says who reviews an answer now, and whether that is another than this instructor."""
    return ("", False) if claim is None else (claim.name, claim.reviewer != who.id)


def make_row(
    submission: Submission, verdict: Any, learner: str, titles: Mapping[tuple[str, str], str], held: tuple[str, bool]
) -> AnswerRow:
    """Returns one answer in words. What waits for a person has no points yet."""
    decided = verdict is not None and verdict["status"] != Status.NEEDS_REVIEW
    waiting = RUNNING if submission.status == submissions.RUNNING else QUEUED
    badge = describe_status(verdict["status"]) if verdict else waiting
    title = titles.get((submission.quiz, submission.question), submission.question)
    return AnswerRow(
        submission.id, learner, submission.quiz, title, shorten_answer(submission),
        format_day(submission.created_at), write_span((now() - submission.created_at).total_seconds()), badge,
        (verdict["points"], verdict["max_points"]) if decided else None, *held, submission.status == NEEDS_REVIEW,
    )  # fmt: skip


def shorten_answer(submission: Submission) -> str:
    """Returns the first words of an answer in words; nothing of any other."""
    answer = json.loads(submission.answer) if submission.answer else None
    return textwrap.shorten(answer, EXCERPT, placeholder="…") if isinstance(answer, str) else ""
