"""Fills a course with the answers of learners who do not exist, and with real verdicts: each script is judged once, and
the verdict is kept for the next time."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import cache, partial
from random import Random
from threading import Lock

from sqlalchemy import select
from sqlalchemy.orm import Session

from grader.courses.answering import results
from grader.courses.answering.policies import change_policy
from grader.courses.people import members
from grader.courses.people.identity import DEFAULT_COURSE, Identity, Role, check_name
from grader.courses.people.pseudonyms import Blinding
from grader.courses.reviewing import reviews
from grader.courses.reviewing.desk import Desk
from grader.courses.rules.rubric import Mark
from grader.domain.policy import Late
from grader.domain.verdict import Verdict
from grader.errors import Conflict, JailFault
from grader.grading.content import Contents
from grader.grading.pipeline import ParsedSubmission, Pipeline, compute_seed
from grader.grading.processes import Graders, ScriptJob
from grader.library import PassedChecks
from grader.service.demo.answers import build_pools
from grader.service.demo.cast import DemoLearner, PlannedAnswer, choose_due_dates, draw_learners, plan_answers
from grader.service.opening import open_database
from grader.settings import Settings
from grader.store import submissions
from grader.store.engine.database import Database
from grader.store.results import LearnerAt
from grader.store.submissions import NEEDS_REVIEW, SubmissionFilter
from grader.store.tables import Member, Submission
from grader.store.upkeep.installation import blind_review_secret

INSTRUCTOR = "instructor"
"""The name under which `grader serve` signs its instructor in."""

REVIEWED_AFTER = timedelta(days=9)
"""Open answers that are older than this have been reviewed; younger ones wait."""

COMMENTS = {
    0.0: "This says that something changes, not what: name the term, and give a number.",
    0.5: "Right about stability. What would make you reject the change?",
    1.0: "Good: a check that can fail, and what follows if it does.",
}
"""What the instructor wrote, by the share of the points."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class DemoFilled:
    """What a demo course was filled with."""

    course: str
    learners: int
    answers: int
    judged: int
    """Different scripts, each judged once."""
    waiting: int
    """Open answers that wait for a person."""


def fill_demo(
    settings: Settings, say: Say, *, course: str | None = None, learners: int = 30, seed: int = 1,
    beside: bool = False, now: datetime,
) -> DemoFilled:  # fmt: skip
    """Fills a course. The same seed, course, content and time give the same learners and answers. Raises Conflict where
    the course has answers already, or, unless `beside` is given, another course of the database; ContentError."""
    course = check_name("course", course or DEFAULT_COURSE)
    rng = Random(f"{seed} {course}")  # ids are unique in the database
    database = open_database(settings)
    try:
        refuse_other_data(database, course, beside=beside)
        passed = PassedChecks(settings.cache)
        pipeline = Contents(settings.content, settings.courses, database, passed).get(course).pipeline
        library = pipeline.library
        cast = draw_learners(rng, learners)
        planned = plan_answers(rng, library, cast, build_pools(library), now)
        secret = f"demo {seed}".encode()
        parsed = [parse_planned(pipeline, secret, answer) for answer in planned]
        say(f"{len(cast)} learners with {len(planned)} answers; judging the scripts among them, each once")
        verdicts = judge_answers(settings, pipeline, passed, parsed, say)
        who = add_members(database, course, cast, now)
        set_dates(database, pipeline, who, now)
        store_answers(database, course, [*zip(planned, parsed, strict=True)], verdicts, rng)
        count_results(database, pipeline, course)
        review_old_answers(database, pipeline, who, now, rng)
        with database.read() as session:
            waiting = count_waiting(session, course)
    finally:
        database.close()
    scripts = {submission.digest for submission in parsed if not submission.is_instant}
    return DemoFilled(course, len(cast), len(planned), len(scripts), waiting)


def refuse_other_data(database: Database, course: str, *, beside: bool) -> None:
    """Raises Conflict where answers of people may be mixed with made-up ones."""
    with database.read() as session:
        used = set(session.scalars(select(Submission.course).distinct()))
    if course in used:
        raise Conflict(f"The course {course} has answers already: name another one with --course, or a new --data.")
    if used and not beside:
        raise Conflict(
            f"This database holds answers of other courses ({', '.join(sorted(used)[:5])}): name a new folder with "
            "--data, or pass --beside-others."
        )


def parse_planned(pipeline: Pipeline, secret: bytes, answer: PlannedAnswer) -> ParsedSubmission:
    """Reads an answer; scripts get hidden cases that follow from the seed of the demo."""
    parsed = pipeline.read(answer.quiz, answer.question, answer.answer)
    return parsed if parsed.is_instant else replace(parsed, seed=compute_seed(secret, parsed.digest))


def judge_answers(
    settings: Settings, pipeline: Pipeline, passed: PassedChecks, parsed: Sequence[ParsedSubmission], say: Say
) -> dict[str, Verdict]:
    """Returns the verdict on each answer by its digest. The jail starts only where a script's verdict is not kept."""
    verdicts = {submission.digest: pipeline.judge(submission) for submission in parsed if submission.is_instant}
    scripts = list({submission.digest: submission for submission in parsed if not submission.is_instant}.values())
    workers, opening = max(1, settings.workers), Lock()
    with ExitStack() as stack:
        start = cache(lambda: stack.enter_context(Graders(workers, allow_t2=settings.allow_t2)))

        def judge(submission: ParsedSubmission, _text_of: object) -> Verdict:
            with opening:
                graders = start()
            verdict = graders.judge(
                pipeline.library,
                ScriptJob(submission.quiz.id, submission.question.id, submission.answer, submission.seed),
            )
            if not verdict.status.uses_attempt:
                raise JailFault(f"a script of {submission.question.id} could not be judged: {verdict.diagnosis}")
            return verdict

        def judge_or_recall(submission: ParsedSubmission) -> Verdict:
            key = [submission.content_digest, submission.question.id, submission.text, str(submission.seed)]
            return passed.run(
                "demo verdict", key, partial(judge, submission), text_of=pipeline.library.text,
                write=lambda verdict: verdict.model_dump(mode="json"), read=Verdict.model_validate,
            )  # fmt: skip

        pool = stack.enter_context(ThreadPoolExecutor(workers))
        for number, (script, verdict) in enumerate(zip(scripts, pool.map(judge_or_recall, scripts), strict=True), 1):
            verdicts[script.digest] = verdict
            if number % 20 == 0 or number == len(scripts):
                say(f"{number} of {len(scripts)} scripts judged")
    return verdicts


def add_members(database: Database, course: str, cast: Sequence[DemoLearner], now: datetime) -> Identity:
    """Makes the learners members of the course; returns its instructor."""
    with database.write() as session:
        who = members.get_named(session, INSTRUCTOR, Role.INSTRUCTOR, course)
        for learner in cast:
            account = f"name:{learner.name}"
            joined = now - timedelta(days=28)
            session.add(Member(id=learner.member_id, course=course, name=learner.name, account=account,
                               role=Role.STUDENT.value, created_at=joined))  # fmt: skip
        return Identity(who.id, who.name, Role.INSTRUCTOR, course)


def set_dates(database: Database, pipeline: Pipeline, who: Identity, now: datetime) -> None:
    """Gives every quiz its due date, with two days more at half the points."""
    library = pipeline.library
    for quiz, due in choose_due_dates(list(library.quizzes.values()), now).items():
        late = Late(per_day=0.5, until=due + timedelta(days=2)).model_dump(mode="json")
        wanted = {"due": due.isoformat(), "late": late}
        change_policy(database, library, who, library.quiz(quiz), wanted, is_current=lambda _: True)


def store_answers(
    database: Database, course: str, answers: Sequence[tuple[PlannedAnswer, ParsedSubmission]],
    verdicts: Mapping[str, Verdict], rng: Random,
) -> None:  # fmt: skip
    """Stores the answers with their verdicts, as if they had come in at their times."""
    attempts: dict[tuple[str, str, str], int] = {}
    with database.write() as session:
        for planned, parsed in answers:
            verdict = verdicts[parsed.digest]
            place = (planned.learner.member_id, planned.quiz, planned.question)
            row = submissions.make(
                id=f"{int(planned.at.timestamp() * 1000):012x}{rng.getrandbits(80):020x}", course=course,
                learner=planned.learner.member_id, user=planned.learner.name, quiz=planned.quiz,
                question=planned.question, answer=parsed.text, seed=parsed.seed,
                content_digest=parsed.content_digest, attempt=1 + attempts.get(place, 0),
            )  # fmt: skip
            attempts[place] = attempts.get(place, 0) + verdict.status.uses_attempt
            submissions.add(session, [(row, verdict)], planned.at)
        database.tell_planner(session, len(answers))


def count_results(database: Database, pipeline: Pipeline, course: str) -> None:
    """Counts what the answers come to."""
    keys = select(*(getattr(Submission, name) for name in LearnerAt._fields)).where(Submission.course == course)
    with database.write() as session:
        for key in session.execute(keys.distinct()).all():
            results.recount(session, pipeline.library, LearnerAt(*key))


def review_old_answers(database: Database, pipeline: Pipeline, who: Identity, now: datetime, rng: Random) -> None:
    """Decides the open answers of the first weeks; what came later waits."""
    desk = Desk(database, pipeline.library, Blinding(blind_review_secret(database)))
    with database.write() as session:
        desk.lock(session, who.course)
        for row in list_waiting(session, who.course):
            if row.created_at > now - REVIEWED_AFTER:
                continue
            share = rng.choice(tuple(COMMENTS))
            points = share * desk_points(desk, row)
            reviews.decide(desk, session, who, row, Mark(None, points, COMMENTS[share]))


def desk_points(desk: Desk, row: Submission) -> float:
    """Returns the points of the answer's question."""
    question = desk.question(row)
    assert question is not None
    return question.points


def list_waiting(session: Session, course: str) -> Sequence[Submission]:
    """Returns the answers that wait for a person, oldest first."""
    waiting = select(Submission).where(*SubmissionFilter(course).conditions(), Submission.status == NEEDS_REVIEW)
    return session.scalars(waiting.order_by(Submission.id)).all()


def count_waiting(session: Session, course: str) -> int:
    """Returns how many answers wait for a person."""
    return len(list_waiting(session, course))
