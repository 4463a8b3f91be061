"""Who is stuck: learners whose last attempts at a question gained nothing and end in the same named mistake; and where
several learners are, by the mistake of their newest attempts."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import groupby
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.rules.mistakes import OTHER, name_mistake
from grader.store import submissions
from grader.store.submissions import Try
from grader.store.tables import now

ATTEMPTS_MIN = 3
"""Attempts in a row without a gain, all with one diagnosis; two are a slip and its repetition."""

RECENT = timedelta(days=7)
"""Learners who have not tried again since then are left out."""

SUBMISSIONS_MAX = 5_000
"""Submissions that are looked at, the newest ones: more than a class of 100 gets in its busiest week, and those of the
last hours in a course of thousands."""

PLACES_MAX = 200
"""Learners at a question whose attempts are read, those who tried last."""


SHARED_MIN, SHARED_MAX = 2, 4
"""Learners whose newest attempts share a mistake that is named, and how many such mistakes are."""


@dataclass(frozen=True)
class SharedMistake:
    """A mistake at a question that is the newest verdict of several learners; `key` and `name` of its family."""

    quiz: str
    question: str
    key: str
    name: str
    learners: int


@dataclass(frozen=True)
class StuckLearner:
    """A learner who gets no further at a question, with the mistake of the last attempts; `attempts` gained nothing."""

    learner: str
    name: str
    quiz: str
    question: str
    attempts: int
    diagnosis: str
    last: datetime


def find_stuck(session: Session, course: str, without: Collection[str]) -> list[StuckLearner]:
    """Returns the learners of a course who are stuck, those with the most attempts first; not the members `without`.
    What a person marks is left out: there the learner waits, and bears a pseudonym."""
    since = now() - RECENT
    tries = submissions.find_unsolved(session, course, since, ATTEMPTS_MIN, newest=SUBMISSIONS_MAX, limit=PLACES_MAX)
    runs = [run for run in find_runs(tries) if run[-1].learner not in without]
    newest = [attempt.submission for run in runs for attempt in run[-ATTEMPTS_MIN:]]
    return select_stuck(runs, submissions.read_verdicts_by_id(session, newest))


def find_runs(tries: Iterable[Try]) -> list[Sequence[Try]]:
    """Returns the last attempts of each learner at a question that gained no points; of `ATTEMPTS_MIN` or more. Pure.
    `tries` are in order of the learner, the quiz, the question and time."""
    by_place = groupby(tries, key=lambda attempt: (attempt.learner, attempt.quiz, attempt.question))
    runs = [drop_gains(list(theirs)) for _, theirs in by_place]
    return [run for run in runs if len(run) >= ATTEMPTS_MIN]


def drop_gains(tries: Sequence[Try]) -> Sequence[Try]:
    """Returns the attempts since the last one that got more points than the attempt before it."""
    start = len(tries) - 1
    while start > 0 and tries[start].points <= tries[start - 1].points:
        start -= 1
    return tries[start:]


def select_stuck(runs: Iterable[Sequence[Try]], verdicts: Mapping[str, Any]) -> list[StuckLearner]:
    """Returns the runs whose last `ATTEMPTS_MIN` attempts have one diagnosis, the longest first. Pure."""
    learners = []
    for run in runs:
        diagnoses = {verdicts[attempt.submission]["diagnosis"] for attempt in run[-ATTEMPTS_MIN:]}
        if len(diagnoses) == 1 and (diagnosis := diagnoses.pop()):
            newest = run[-1]
            at = (newest.learner, newest.name, newest.quiz, newest.question)
            learners.append(StuckLearner(*at, len(run), diagnosis, newest.created_at))
    return sorted(learners, key=lambda learner: (-learner.attempts, learner.last, learner.name))


def find_shared_mistakes(session: Session, course: str) -> list[SharedMistake]:
    """Returns the mistakes in which the newest attempts of most learners ended lately, at questions that they have not
    solved. Looks at the `PLACES_MAX` learners at a question who tried last."""
    newest = submissions.newest_wrong(session, course, now() - RECENT, newest=SUBMISSIONS_MAX, limit=PLACES_MAX)
    verdicts = submissions.read_verdicts_by_id(session, [submission for *_, submission in newest])
    attempts = [
        (quiz, question, verdicts[submission]) for _, quiz, question, submission in newest if submission in verdicts
    ]
    return count_shared(attempts)


def count_shared(attempts: Iterable[tuple[str, str, Any]]) -> list[SharedMistake]:
    """Returns the mistakes of most learners; `attempts` have the quiz, the question and the verdict of each. Pure."""
    named = ((quiz, question, name_mistake(one["status"], one["diagnosis"])) for quiz, question, one in attempts)
    mistakes = [(quiz, question, one) for quiz, question, one in named if one is not None and one.name != OTHER]
    counts = Counter((quiz, question, one.key) for quiz, question, one in mistakes)
    names = {(quiz, question, one.key): one.name for quiz, question, one in mistakes}
    shared = [SharedMistake(*at, names[at], learners) for at, learners in counts.items() if learners >= SHARED_MIN]
    shared.sort(key=lambda mistake: (-mistake.learners, mistake.quiz, mistake.question, mistake.name))
    return shared[:SHARED_MAX]
