"""A page of the gradebook shows whom a computation from scratch would show, in the same order, with the same sums."""

import random
from collections import defaultdict
from collections.abc import Iterator
from itertools import product
from math import fsum
from typing import Any

import pytest
from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from grader.store import results
from grader.store.engine.database import Database
from grader.store.results import ORDERS, SHOWS, Ranking
from grader.store.reviewing.reviews import WAITING, list_unseen
from grader.store.tables import Member, Result, Review
from support.databases import BACKENDS, open_database
from support.seeding import Course, seed

COURSE = Course(learners=16, questions=4, submissions=64)
REVIEWER = "tina"
ASKED = {COURSE.quiz: {"q1", "q2", "q3"}}
"""The quiz has lost its fourth question."""


@pytest.fixture(scope="module", params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    """A course in which some have not answered everything, wait, share a name, left, or have a first mark only."""
    with open_database(request.param, tmp_path_factory.mktemp("ranking")) as database:
        seed(database, COURSE)
        with database.write() as session:
            scramble(session, random.Random(5))
        yield database


def scramble(session: Session, chance: random.Random) -> None:
    for result in session.scalars(select(Result).order_by(Result.learner, Result.question)).all():
        result.points, result.is_final = chance.choice((0.0, 0.5, 1.0)), chance.random() < 0.9
        if chance.random() < 0.2:
            session.delete(result)
        elif chance.random() < 0.2:
            at = {"course": COURSE.name, "quiz": COURSE.quiz, "question": result.question, "name": "Tom", "points": 0.5}
            session.add(Review(submission_id=result.submission_id, reviewer="tom", second=WAITING, **at))
    session.get_one(Member, COURSE.learner(3)).name = session.get_one(Member, COURSE.learner(4)).name = "Zoe"
    session.execute(delete(Member).where(Member.id == COURSE.learner(5)))


def is_asked(result: Result) -> bool:
    return result.question in ASKED[result.quiz]


def from_scratch(session: Session, wanted: Ranking) -> list[tuple[str, str]]:
    """Every learner who is wanted, in order: reads all results and members, and sorts here."""
    names = {member.id: member.name for member in session.scalars(select(Member))}
    unseen = {tuple(row[1:]) for row in list_unseen(session, wanted.course, wanted.reviewer)}
    unseen = unseen if wanted.reviewer else set()
    theirs: dict[str, list[Result]] = defaultdict(list)
    for one in session.scalars(select(Result)):
        theirs[one.learner].append(one)

    def name(learner: str) -> str:
        return names.get(learner, learner).lower()

    def is_wanted(learner: str) -> bool:
        several = [*filter(is_asked, theirs[learner])]
        shown = {
            "all": True,
            "waiting": not all(result.is_final for result in several),
            "incomplete": len(several) < len(ASKED[COURSE.quiz]),
        }
        return learner not in wanted.without and wanted.find.lower() in name(learner) and shown[wanted.show]

    def key(learner: str) -> float | str:
        if wanted.by == "points":
            at = ("course", "learner", "quiz", "question")
            seen = [
                result
                for result in filter(is_asked, theirs[learner])
                if tuple(getattr(result, name) for name in at) not in unseen
            ]
            return fsum(result.points for result in seen)
        return name(learner) if wanted.by == "name" else len([*filter(is_asked, theirs[learner])])

    order = sorted(filter(is_wanted, theirs), key=lambda one: (name(one), one))
    if wanted.by == "name" and wanted.descending:  # names that are equal stay in the order of the ids
        order.sort()
    order.sort(key=key, reverse=wanted.descending)
    return [(one, names.get(one, one)) for one in order]


@pytest.mark.parametrize("reviewer", ["", REVIEWER])
@pytest.mark.parametrize("find", ["", "SER1", "_"])
@pytest.mark.parametrize("show", SHOWS)
@pytest.mark.slow
def test_a_page_has_whom_a_computation_from_scratch_has(
    database: Database, show: str, find: str, reviewer: str
) -> None:
    of_quiz = (COURSE.name, ASKED, {COURSE.learner(0)})
    with database.read() as session:
        for by, descending in product(ORDERS, (False, True)):
            wanted = Ranking(*of_quiz, find, show, by, descending, reviewer)
            everybody = from_scratch(session, wanted)
            assert results.rank_learners(session, wanted, 0, 100) == everybody
            assert results.rank_learners(session, wanted, 2, 3) == everybody[2:5]


@pytest.mark.parametrize("reviewer", ["", REVIEWER])
def test_sums_by_quiz_are_those_of_a_computation_from_scratch(database: Database, reviewer: str) -> None:
    learners = [COURSE.learner(number) for number in range(COURSE.learners)]
    wanted = Ranking(COURSE.name, {**ASKED, "of nobody": ["q1"]}, reviewer=reviewer)
    with database.read() as session:
        unseen = {(row.learner, row.question) for row in list_unseen(session, COURSE.name, reviewer)}
        theirs: dict[str, list[Result]] = defaultdict(list)
        for one in filter(is_asked, session.scalars(select(Result))):
            theirs[one.learner].append(one)
        expected: Any = {
            learner: {COURSE.quiz: (
                pytest.approx(fsum(
                    result.points for result in several if not reviewer or (learner, result.question) not in unseen
                )),
                len(several), not all(result.is_final for result in several),
            )}
            for learner in learners for several in [theirs[learner]] if several
        }  # fmt: skip
        by_learner = results.sums_of_learners(session, wanted, learners)
    assert {learner: sums for learner, sums in by_learner.items() if sums} == expected
    assert unseen
