"""Every query on results and on their feed."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple, Self

from sqlalchemy import (
    ColumnElement,
    Integer,
    SQLColumnExpression,
    Text,
    and_,
    bindparam,
    case,
    false,
    func,
    or_,
    select,
    tuple_,
    update,
)
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import Session
from sqlalchemy.sql.functions import FunctionElement

from grader.domain.verdict import Status
from grader.store.engine.bulk import TableRows, insert_rows
from grader.store.engine.names import Folded, holds
from grader.store.reviewing.reviews import select_unseen_places
from grader.store.submissions import NEWEST
from grader.store.tables import Credential, Member, Result, ResultRevision, Submission, VerdictRow

COUNTED = ("submission_id", "attempt", "points", "max_points", "is_late", "is_final")
"""The columns of a result whose change is a new revision, and a row of the feed."""

OF_FEED = ("course", "learner", "quiz", "question", *COUNTED, "revision")
"""The columns of a result that a row of the feed has."""

Columns = dict[str, Any]
"""The columns of a result by name."""

BATCH = 1000
"""Rows fetched at a time."""


class LearnerAt(NamedTuple):
    """A learner at a question: the key of a result."""

    course: str
    learner: str
    quiz: str
    question: str

    @classmethod
    def from_submission(cls, submission: Submission) -> Self:
        """The key of the result that a submission counts for."""
        return cls(submission.course, submission.learner, submission.quiz, submission.question)


ATTEMPTS = (
    select(
        Submission.id, Submission.attempt, Submission.created_at, Submission.outcome,
        VerdictRow.points, VerdictRow.max_points,
    )
    .outerjoin(VerdictRow, NEWEST)
    .where(*(getattr(Submission, name) == bindparam(name) for name in LearnerAt._fields), Submission.uses_attempt)
    .order_by(Submission.id)
)  # fmt: skip
ATTEMPT = (
    select(Submission.id, Submission.attempt, Submission.created_at, Submission.outcome, VerdictRow.points)
    .join(VerdictRow, NEWEST)
    .where(Submission.id == bindparam("id"), Submission.uses_attempt)
)


COLUMNS_AT = select(*Result.__table__.columns).where(
    *(getattr(Result, name) == bindparam(name) for name in LearnerAt._fields)
)


def list_attempts(session: Session, key: LearnerAt) -> Sequence[Any]:
    """The attempts of a learner at a question, oldest first, with their newest verdicts."""
    return session.execute(ATTEMPTS, key._asdict()).all()


def attempt(session: Session, submission_id: str) -> Any:
    """One attempt with the points of its newest verdict; None if it used none."""
    return session.execute(ATTEMPT, {"id": submission_id}).one_or_none()


def find(session: Session, key: LearnerAt) -> Result | None:
    """The result of a learner at a question, if there is one."""
    return session.get(Result, key)


def read_columns(session: Session, key: LearnerAt) -> Columns | None:
    """The columns of a result as they are in the database now; None without one."""
    row = session.execute(COLUMNS_AT, key._asdict()).one_or_none()
    return None if row is None else dict(row._mapping)


def change(before: Columns | None, key: LearnerAt, values: Mapping[str, Any]) -> Columns:
    """The columns of a result with new values, which count as a change; `before` itself where none differs. A change of
    one of the columns `COUNTED` is a new revision."""
    if before is None:
        return {**key._asdict(), **values, "changes": 1, "revision": 1}
    if all(before[name] == value for name, value in values.items()):
        return before
    is_revised = any(before[name] != values[name] for name in COUNTED)
    count = {"changes": before["changes"] + 1, "revision": before["revision"] + is_revised}
    return {**before, **values, **count}


def save(session: Session, changed: Sequence[Columns], revised: Sequence[Columns], clock: datetime) -> None:
    """Writes results, and a row of the feed for each new revision. The caller holds the learners' locks."""
    insert_rows(session, *build_rows(changed, revised, clock), replace=Result)


def build_rows(changed: Sequence[Columns], revised: Sequence[Columns], clock: datetime) -> list[TableRows]:
    """The rows of results, which replace those before, and a row of the feed for each new revision."""
    return [
        (Result, changed),
        (ResultRevision, [read_feed_columns(result) | {"created_at": clock} for result in revised]),
    ]


def read_feed_columns(result: Columns) -> Columns:
    """The columns of a result that a row of the feed has."""
    return {name: result[name] for name in OF_FEED}


def find_of_learner(session: Session, course: str, learner: str, quiz: str) -> dict[str, Result]:
    """The results of a learner in a quiz, by question."""
    theirs = select(Result).where(Result.course == course, Result.learner == learner, Result.quiz == quiz)
    return {result.question: result for result in session.scalars(theirs)}


def find_everywhere(session: Session, course: str, learner: str) -> dict[tuple[str, str], Result]:
    """The results of a learner in all quizzes, by (quiz, question)."""
    theirs = select(Result).where(Result.course == course, Result.learner == learner)
    return {(result.quiz, result.question): result for result in session.scalars(theirs)}


def points_by_learner(session: Session, course: str, quizzes: Sequence[str]) -> Iterator[Any]:
    """Learner, quiz, points by question as a JSON object, name and member; a row for each learner and quiz, by learner.
    Points are null while an answer waits for its first mark. The database gathers the questions: to fetch one row for
    each takes several times as long."""
    known_yet = case((or_(Result.is_final, Result.points > 0), Result.points))  # null while the first answer waits
    gathered = select(Result.learner, Result.quiz, Gathered(Result.question, known_yet).label("points"))
    points = gathered.where(Result.course == course, _among(quizzes)).group_by(Result.learner, Result.quiz).subquery()
    name = func.coalesce(Member.name, points.c.learner).label("name")
    known = [getattr(Member, column) for column in KNOWN]
    rows = select(points, name, *known).outerjoin(Member, Member.id == points.c.learner).order_by(points.c.learner)
    yield from session.execute(rows.execution_options(yield_per=BATCH))


@dataclass(frozen=True)
class Ranking:
    """Which learners of some quizzes are looked for, and in which order. `asked` has the questions of each quiz:
    results at others, which it has lost, neither count nor wait."""

    course: str
    asked: Mapping[str, Collection[str]]
    without: Collection[str] = ()
    find: str = ""
    """A part of the name, in any case."""
    show: str = "all"
    """Of `SHOWS`."""
    by: str = "name"
    """Of `ORDERS`."""
    descending: bool = False
    reviewer: str = ""
    """The instructor who looks: first marks that they must not see yet add no points. Empty where there are none."""

    @property
    def quizzes(self) -> Sequence[str]:
        """The ids of the quizzes."""
        return list(self.asked)


SHOWS = ("all", "waiting", "incomplete")
ORDERS = ("name", "points", "answered")


def rank_learners(session: Session, wanted: Ranking, start: int, limit: int) -> list[tuple[str, str]]:
    """The ids and names of at most `limit` learners of quizzes after the first `start`. Sums up what the order and the
    filter need, and nothing else: the index alone tells who has results, and how many."""
    answered, points, is_final = _sums(wanted)
    keys: dict[str, ColumnElement[Any]] = {"points": points, "answered": answered}
    key = keys.get(wanted.by, func.count())
    theirs = (Result.course == wanted.course, _among(wanted.quizzes), Result.learner.not_in(wanted.without))
    each = select(Result.learner, key.label("key")).where(*theirs).group_by(Result.learner)
    if wanted.show == "waiting":
        each = each.having(is_final == 0)
    elif wanted.show == "incomplete":
        each = each.having(answered < sum(map(len, wanted.asked.values())))
    ranked = each.subquery()  # a name is looked up once for each learner
    name = func.coalesce(Member.name, ranked.c.learner)
    rows = select(ranked.c.learner, name).outerjoin(Member, Member.id == ranked.c.learner)
    if wanted.find:
        rows = rows.where(holds(name, wanted.find))
    first, *then = (Folded(name),) if wanted.by == "name" else (ranked.c.key, Folded(name))
    order = (first.desc() if wanted.descending else first, *then, ranked.c.learner)
    return [(row[0], row[1]) for row in session.execute(rows.order_by(*order).offset(start).limit(limit))]


def _sums(wanted: Ranking) -> tuple[ColumnElement[int], ColumnElement[float], ColumnElement[int]]:
    """How many results of a group are at questions that are asked; their points; whether all of them are final, 0 or 1.
    What is not asked is no condition of the query, whose index stays one on quizzes and learners."""
    asked = or_(false(), *(and_(Result.quiz == quiz, Result.question.in_(ids)) for quiz, ids in wanted.asked.items()))
    is_final = case((asked, Result.is_final.cast(Integer)), else_=1)
    points = case((asked, _seen_points(wanted)), else_=0.0)
    return func.sum(case((asked, 1), else_=0)), func.sum(points), func.min(is_final)


def _seen_points(wanted: Ranking) -> SQLColumnExpression[float]:
    """The points of a result; 0 for a first mark that the reviewer must not see yet."""
    if not wanted.reviewer:
        return Result.points
    place = tuple_(Result.learner, Result.quiz, Result.question)
    return case((place.in_(select_unseen_places(wanted.course, wanted.reviewer)), 0.0), else_=Result.points)


class QuizSum(NamedTuple):
    """The results of a learner in a quiz: their points and number, and whether one of them waits."""

    points: float
    answered: int
    waits: bool


def sums_of_learners(session: Session, wanted: Ranking, learners: Sequence[str]) -> dict[str, dict[str, QuizSum]]:
    """The sums of some learners by quiz in which they have answered. They come out of the index alone."""
    answered, points, final = _sums(wanted)
    here = (Result.course == wanted.course, _among(wanted.quizzes), Result.learner.in_(learners))
    each = select(Result.learner, Result.quiz, points, answered, final).where(*here).having(answered > 0)
    sums: dict[str, dict[str, QuizSum]] = {learner: {} for learner in learners}
    for learner, quiz, total, number, is_final in session.execute(each.group_by(Result.quiz, Result.learner)):
        sums[learner][quiz] = QuizSum(total, number, not is_final)
    return sums


AT_PAGE = (Result.course, Result.learner, Result.quiz, Result.question, Result.points, Result.max_points,
           Result.is_late, Result.is_final)  # fmt: skip
"""The columns of a result that a page of the gradebook shows."""


def find_of_learners(session: Session, course: str, quiz: str, learners: Sequence[str]) -> dict[str, list[Any]]:
    """The columns `AT_PAGE` of the results of some learners in a quiz, by learner."""
    theirs = select(*AT_PAGE).where(Result.course == course, Result.quiz == quiz, Result.learner.in_(learners))
    by_learner: dict[str, list[Any]] = {learner: [] for learner in learners}
    for row in session.connection().execute(theirs):
        by_learner[row.learner].append(row)
    return by_learner


def find_right_but_late(
    session: Session, course: str, learners: Sequence[str], averaged: Collection[str]
) -> set[LearnerAt]:
    """Where late right answers of some learners count, whose points are fewer than those of the question. An average
    over several attempts, as in the quizzes `averaged`, is of no one answer."""
    late = select(*(getattr(Result, name) for name in LearnerAt._fields)).join(Submission)
    right = (Result.is_late, Submission.outcome == Status.CORRECT.value)
    of_one = or_(Result.attempt == 1, Result.quiz.not_in(averaged))
    rows = session.execute(late.where(Result.course == course, Result.learner.in_(learners), *right, of_one))
    return {LearnerAt(*row) for row in rows}


KNOWN = ("account", "namespace", "external_id", "email")
"""The columns of a member that say who somebody is to other systems."""


class Gathered(FunctionElement[str]):
    """Keys and values of a group as the text of a JSON object."""

    type = Text()
    inherit_cache = True


@compiles(Gathered, "sqlite")
def _gathered_in_sqlite(element: Gathered, compiler: Any, **kw: Any) -> str:
    return f"json_group_object({compiler.process(element.clauses, **kw)})"


@compiles(Gathered, "postgresql")
def _gathered_in_postgresql(element: Gathered, compiler: Any, **kw: Any) -> str:
    return f"CAST(json_object_agg({compiler.process(element.clauses, **kw)}) AS text)"


ROWS_FETCHED = 500
"""Rows that are fetched together. To hold tens of thousands costs memory, and for each look for garbage a walk."""

STATISTICS = (
    select(
        Result.learner, Result.question, Result.points, Result.max_points,
        Result.first_status, Result.first_option, Result.first_value, Result.diagnoses, Result.first_several,
    )
    .where(
        Result.course == bindparam("course"), Result.quiz == bindparam("quiz"), Result.is_final,
    )
)  # fmt: skip


def iterate_of_quiz(session: Session, course: str, quiz: str) -> Iterator[Sequence[Any]]:
    """Yields the columns of `STATISTICS` of every result in a quiz that waits neither for a verdict nor a person, in
    lists of `ROWS_FETCHED`. These are the driver's own rows: SQLAlchemy would take as long again to wrap tens of
    thousands. One list is held at a time."""
    with session.connection().execute(STATISTICS, {"course": course, "quiz": quiz}) as cursor_result:
        while rows := cursor_result.cursor.fetchmany(ROWS_FETCHED):
            yield rows


def count_taking_part(session: Session, course: str, quizzes: Sequence[str]) -> int:
    """The number of learners who have a result in one of the quizzes; removed ones do not count."""
    handed_in = select(1).where(Result.course == course, Result.learner == Member.id, _among(quizzes)).exists()
    learners = (Member.course == course, Member.role == "student", Member.removed_at.is_(None))
    return session.scalar(select(func.count()).select_from(Member).where(*learners, handed_in)) or 0


State = tuple[int, int]
"""The number of some results and of their changes: it changes whenever one of them does, as none is ever deleted."""


def count_learners(session: Session, courses: Sequence[str], quiz: str) -> dict[str, dict[float, int]]:
    """The number of learners of courses with a result, by question of a quiz and by what the result is out of;
    questions without one are left out."""
    here = (Result.course.in_(courses), Result.quiz == quiz)
    columns = (Result.question, Result.max_points)
    counts: dict[str, dict[float, int]] = {}
    for question, maximum, learners in session.execute(select(*columns, func.count()).where(*here).group_by(*columns)):
        counts.setdefault(question, {})[maximum] = learners
    return counts


STATE = (func.count(), func.coalesce(func.sum(Result.changes), 0))


def read_state(session: Session, course: str, quizzes: Sequence[str]) -> State:
    """The state of the results of these quizzes."""
    count, changes = session.execute(select(*STATE).where(Result.course == course, _among(quizzes))).one()
    return count, int(changes)


def touch(session: Session, course: str, learner: str) -> None:
    """Says that what gradebooks show of a learner has changed, such as the name, so that none is taken for current."""
    theirs = update(Result).where(Result.course == course, Result.learner == learner)
    session.execute(theirs.values(changes=Result.changes + 1), execution_options={"synchronize_session": False})


def list_keys(session: Session, course: str, quiz: str, learner: str | None = None) -> list[LearnerAt]:
    """Every learner and question of a quiz with an attempt."""
    columns = [getattr(Submission, name) for name in LearnerAt._fields]
    rows = select(*columns).where(Submission.course == course, Submission.quiz == quiz, Submission.uses_attempt)
    if learner is not None:
        rows = rows.where(Submission.learner == learner)
    return [LearnerAt(*row) for row in session.execute(rows.distinct())]


def list_instructors(session: Session, course: str) -> set[str]:
    """The ids of members who are instructors or held their credentials: their tries are no results of learners."""
    held = select(Credential.member).where(Credential.course == course, Credential.role == "instructor")
    are = select(Member.id).where(Member.course == course, Member.role == "instructor")
    return set(session.scalars(held.union(are)))


def has_new(session: Session, course: str) -> bool:
    """Whether rows of the feed wait for their position."""
    new = select(ResultRevision.id).where(ResultRevision.course == course, ResultRevision.position.is_(None))
    return session.execute(new.limit(1)).first() is not None


def number_new(session: Session, course: str) -> None:
    """Gives the committed rows of the feed that have no position the next ones, in the order of their ids. Call it
    under a lock, in a transaction of its own. A row that is committed later gets a later position, whatever its id: on
    PostgreSQL ids are drawn before the commit."""
    row = ResultRevision
    place = func.row_number().over(order_by=row.id).label("place")
    new = select(row.id, place).where(row.course == course, row.position.is_(None)).subquery()
    last = session.scalar(select(func.max(row.position)).where(row.course == course)) or 0
    numbered = update(row).where(row.id == new.c.id).values(position=last + new.c.place)
    session.execute(numbered, execution_options={"synchronize_session": False})


def _among(quizzes: Sequence[str]) -> ColumnElement[bool]:
    """One quiz as an equality, so that its rows come out of the index in the order of learners."""
    return Result.quiz == quizzes[0] if len(quizzes) == 1 else Result.quiz.in_(quizzes)


def list_feed(session: Session, course: str, after: int, limit: int) -> list[tuple[ResultRevision, str, Member | None]]:
    """At most `limit` rows of the feed after a position, in order, each with the learner's name, and as a member."""
    rows = (
        select(ResultRevision, Submission.user, Member)
        .join(Submission, Submission.id == ResultRevision.submission_id)
        .outerjoin(Member, Member.id == ResultRevision.learner)
    )
    later = rows.where(ResultRevision.course == course, ResultRevision.position > after)
    result = session.execute(later.order_by(ResultRevision.position).limit(limit))
    return [(row, name, member) for row, name, member in result]
