"""`grader demo`: the same learners for a seed, verdicts that the judge gives again, and no mixing with others' data."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from random import Random

import pytest
from sqlalchemy import select

from grader.courses.people import members
from grader.courses.people.identity import Role
from grader.domain.verdict import Status, Verdict
from grader.errors import Conflict
from grader.grading.processes import Graders, ScriptJob
from grader.library import load
from grader.service.demo import fill_demo
from grader.service.demo.answers import build_pools
from grader.service.demo.cast import PlannedAnswer, choose_due_dates, draw_learners, plan_answers
from grader.settings import Settings
from grader.store import policies, submissions
from grader.store.engine.database import Database
from grader.store.submissions import NEEDS_REVIEW
from grader.store.tables import Member, Result, Submission
from support.content import PASSED

LESSON = Settings().content
NOW = datetime(2026, 11, 23, 15, 20, tzinfo=UTC)


def plan(seed: int, learners: int = 30) -> list[PlannedAnswer]:
    library, rng = load(LESSON, passed=PASSED), Random(seed)
    return plan_answers(rng, library, draw_learners(rng, learners), build_pools(library), NOW)


def test_a_seed_makes_the_same_class_and_another_seed_another() -> None:
    assert plan(1) == plan(1)
    assert plan(1) != plan(2)


def test_a_class_works_for_weeks_and_gets_things_wrong() -> None:
    planned = plan(1)
    assert planned == sorted(planned, key=lambda answer: answer.at)
    assert planned[-1].at < NOW and NOW - planned[0].at > timedelta(days=14)
    assert len({answer.learner.member_id for answer in planned}) in range(20, 30)  # some have not begun
    attempts = [
        sum(answer.learner == two.learner and answer.question == two.question for two in planned) for answer in planned
    ]
    assert max(attempts) in (3, 4) and attempts.count(1) > 20
    assert {answer.question for answer in planned} == {
        "q1", "q2", "q3", "q4", "servo-threshold", "servo-explain", "rk4-step", "rk4-free-joint",
    }  # fmt: skip
    scripts = [answer.answer["source"] for answer in planned if isinstance(answer.answer, dict)]
    assert not any("# diagnosis:" in source for source in scripts)  # what a program must get is not handed in


def test_due_dates_lie_around_now() -> None:
    due = choose_due_dates(list(load(LESSON, passed=PASSED).quizzes.values()), NOW)
    assert due["1.3-check"] < NOW < due["1.3-exercises"]


@pytest.mark.jail
@pytest.mark.slow
def test_the_verdicts_are_those_of_the_judge_and_nothing_is_mixed(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path / "data", workers=1)
    said: list[str] = []
    filled = fill_demo(settings, said.append, learners=2, seed=3, now=NOW)
    database = Database(settings.database)
    with database.read() as session:
        rows = session.scalars(select(Submission)).all()
        verdicts = submissions.read_verdicts(session, rows)
        scripts = [row for row in rows if row.seed is not None]
        assert filled.answers == len(rows) and filled.judged == len({row.answer for row in scripts}) > 1
        assert {row.status for row in rows} <= {"graded", NEEDS_REVIEW}
        assert sum(row.status == NEEDS_REVIEW for row in rows) == filled.waiting
        results = session.scalars(select(Result)).all()
        assert {(result.learner, result.question) for result in results} == {
            (row.learner, row.question) for row in rows
        }
        assert policies.read_of_course(session, "default").keys() == {"1.3-check", "1.3-exercises"}
        names = set(session.scalars(select(Member.name)))
    assert len(names) == 3 and "instructor" in names
    one = next(row for row in scripts if row.outcome == Status.PARTIAL or row.outcome == Status.INCORRECT)
    with Graders(1, allow_t2=False) as graders:
        again = graders.judge(
            load(LESSON, passed=PASSED), ScriptJob(one.quiz, one.question, json.loads(one.answer), one.seed)
        )
    kept = Verdict.model_validate(verdicts[one.id])
    assert (again.status, again.points, again.diagnosis) == (kept.status, kept.points, kept.diagnosis)

    with pytest.raises(Conflict, match="has answers already"):
        fill_demo(settings, said.append, learners=2, seed=3, now=NOW)
    with pytest.raises(Conflict, match="holds answers of other courses"):
        fill_demo(settings, said.append, course="second", learners=2, seed=3, now=NOW)
    with database.write() as session:
        members.get_named(session, "ada", Role.STUDENT, "second")
    beside = fill_demo(settings, said.append, course="second", learners=1, seed=3, beside=True, now=NOW)
    assert (beside.course, beside.learners) == ("second", 1)
    database.close()
