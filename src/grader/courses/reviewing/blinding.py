"""What reviewers are kept from knowing: whose answer they mark, and how another reviewer has marked it.

While an answer of a learner to an anonymous quiz waits for a decision, everything of theirs in it that a person marks
bears a pseudonym. Until the second mark is there, only the first reviewer sees the first: as a verdict, as the points
that count, and in the audit log. Learners and services are kept from nothing.
"""

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.people.identity import Identity
from grader.courses.reviewing.desk import Desk
from grader.store import submissions
from grader.store.courses import AuditEntry
from grader.store.results import LearnerAt
from grader.store.reviewing import reviews
from grader.store.reviewing.reviews import WAITING
from grader.store.submissions import NEEDS_REVIEW
from grader.store.tables import Submission


@dataclass(frozen=True)
class BlindedVerdicts:
    """Verdicts by submission, without what this reviewer may not see, and pseudonyms in place of names."""

    verdicts: Mapping[str, Any]
    names: Mapping[str, str]


def hide_names(
    desk: Desk, session: Session, who: Identity, rows: Sequence[Submission], verdicts: Mapping[str, Any], *,
    always: bool = False,
) -> BlindedVerdicts:  # fmt: skip
    """Says what an instructor may see of submissions whose newest verdicts are given; learners see their own as they
    are. With `always`, answers that a person marks bear their pseudonyms also after the last decision."""
    if not who.is_instructor:
        return BlindedVerdicts(verdicts, {})
    held = reviews.find_of_submissions(session, [row.id for row in rows])
    hidden = [id_ for id_, review in held.items() if review.second == WAITING and review.reviewer != who.id]
    earlier = reviews.graders_verdicts(session, hidden) if hidden else {}
    names = list_pseudonyms(desk, session, who, [row for row in rows if is_marked(row, held)], always=always)
    return BlindedVerdicts({**verdicts, **earlier}, names)


def is_marked(row: Submission, reviewed: Collection[str]) -> bool:
    """Says whether a person marks the submission, or has."""
    return row.status == NEEDS_REVIEW or row.id in reviewed


def list_pseudonyms(
    desk: Desk, session: Session, who: Identity, marked: Sequence[Submission], *, always: bool
) -> dict[str, str]:
    """Returns the pseudonyms of submissions that a person marks, by id; without those that bear the learner's name."""
    others = [row for row in marked if row.learner != who.id and desk.is_anonymous(row.quiz)]
    learners = {row.learner for row in others}
    if always or not others:
        return {row.id: desk.blinding.name(row) for row in others}
    averaged = desk.list_averaged(session, who.course)
    waiting = reviews.find_undecided(session, who.course, averaged, learners)
    return {row.id: desk.blinding.name(row) for row in others if (row.quiz, row.learner) in waiting}


@dataclass(frozen=True)
class Unseen:
    """First marks that a reviewer must not see yet: their submissions, and the results that they count for."""

    submissions: frozenset[str] = frozenset()
    results: frozenset[LearnerAt] = frozenset()


def find_unseen(session: Session, who: Identity) -> Unseen:
    """Returns the first marks in a course that this user must not see yet."""
    if not who.is_instructor:
        return Unseen()
    rows = reviews.list_unseen(session, who.course, who.id)
    return Unseen(frozenset(row.id for row in rows), frozenset(LearnerAt(*row[1:]) for row in rows))


def blinded_differences(
    desk: Desk, session: Session, who: Identity, quiz: str, items: Iterable[dict[str, Any]]
) -> list[dict[str, Any]]:
    """The differences of a regrade (`regrades.differences`) without names and first marks that are to stay unseen."""
    differences = list(items)
    rows = submissions.get_several(
        session, [sub["submission_id"] for item in differences for sub in item["submissions"]]
    )
    names, unseen = hide_names(desk, session, who, rows, {}).names, find_unseen(session, who)
    return [
        _difference(item, names, unseen, LearnerAt(who.course, item["learner"], quiz, item["question"]))
        for item in differences
    ]


def _difference(item: dict[str, Any], names: Mapping[str, str], unseen: Unseen, at: LearnerAt) -> dict[str, Any]:
    name = next((names[sub["submission_id"]] for sub in item["submissions"] if sub["submission_id"] in names), None)
    if name is not None:
        item = item | {"user": name, "learner": None}
    if at in unseen.results:
        seen = [sub | {"old": None, "new": None} for sub in item["submissions"]]
        item = item | {"before": None, "after": None, "difference": None, "submissions": seen}
    return item


def limit_detail(entry: AuditEntry, unseen: Unseen) -> dict[str, Any]:
    """Returns the detail of an entry of the audit log, without the points of a first mark that is to stay unseen."""
    detail: dict[str, Any] = json.loads(entry.detail)
    return {} if entry.subject in unseen.submissions else detail
