"""Who is stuck: learners whose last attempts at a question gained nothing and end in the same named mistake."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import groupby
from typing import Any

from sqlalchemy.orm import Session

from grader.store import submissions
from grader.store.submissions import Try
from grader.store.tables import now

ATTEMPTS_MIN = 3
"""Attempts in a row without a gain, all with one diagnosis; two are a slip and its repetition."""

RECENT = timedelta(days=7)
"""Learners who have not tried again since then are left out."""

SUBMISSIONS_MAX = 10_000
"""Submissions that are looked at, the newest ones: more than a large course gets in all but its busiest weeks."""

PLACES_MAX = 200
"""Learners at a question whose attempts are read, those who tried last."""


@dataclass(frozen=True)
class Stuck:
    """A learner who gets no further at a question, with the mistake of the last attempts; `attempts` gained nothing."""

    learner: str
    name: str
    quiz: str
    question: str
    attempts: int
    diagnosis: str
    last: datetime


def find_stuck(session: Session, course: str, without: Collection[str]) -> list[Stuck]:
    """Returns the learners of a course who are stuck, those with the most attempts first; not the members `without`.
    What a person marks is left out: there the learner waits, and bears a pseudonym."""
    since = now() - RECENT
    tries = submissions.unsolved(session, course, since, ATTEMPTS_MIN, newest=SUBMISSIONS_MAX, limit=PLACES_MAX)
    runs = [run for run in find_runs(tries) if run[-1].learner not in without]
    newest = [one.submission for run in runs for one in run[-ATTEMPTS_MIN:]]
    return select_stuck(runs, submissions.verdicts_of(session, newest))


def find_runs(tries: Iterable[Try]) -> list[Sequence[Try]]:
    """Returns the last attempts of each learner at a question that gained no points; of `ATTEMPTS_MIN` or more. Pure.
    `tries` are in order of the learner, the quiz, the question and time."""
    by_place = groupby(tries, key=lambda one: (one.learner, one.quiz, one.question))
    runs = [drop_gains(list(theirs)) for _, theirs in by_place]
    return [run for run in runs if len(run) >= ATTEMPTS_MIN]


def drop_gains(tries: Sequence[Try]) -> Sequence[Try]:
    """Returns the attempts since the last one that got more points than the attempt before it."""
    start = len(tries) - 1
    while start > 0 and tries[start].points <= tries[start - 1].points:
        start -= 1
    return tries[start:]


def select_stuck(runs: Iterable[Sequence[Try]], verdicts: Mapping[str, Any]) -> list[Stuck]:
    """Returns the runs whose last `ATTEMPTS_MIN` attempts have one diagnosis, the longest first. Pure."""
    found = []
    for run in runs:
        diagnoses = {verdicts[one.submission]["diagnosis"] for one in run[-ATTEMPTS_MIN:]}
        if len(diagnoses) == 1 and (diagnosis := diagnoses.pop()):
            newest = run[-1]
            at = (newest.learner, newest.name, newest.quiz, newest.question)
            found.append(Stuck(*at, len(run), diagnosis, newest.created_at))
    return sorted(found, key=lambda one: (-one.attempts, one.last, one.name))
