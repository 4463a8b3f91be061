"""What is put into the outbox, and what a person does with it: every change of a result, in its transaction."""

from collections.abc import Collection, Sequence
from itertools import groupby
from operator import attrgetter

from sqlalchemy.orm import Session

from grader.courses.people.audit import COMMAND_LINE, Action, record
from grader.courses.people.identity import Identity
from grader.errors import Conflict, NotFound
from grader.queue import jobs
from grader.store import outbox
from grader.store.engine.database import Database
from grader.store.outbox import ALL, DEAD, WEBHOOK, Delivery, Destination, LinkedColumn, NotedRow
from grader.store.platforms import score_target
from grader.store.results import LearnerAt

REPLAY_MAX = 1000
"""Dead letters that are replayed at a time."""


def note(session: Session, changed: Collection[LearnerAt], only: str = ALL, kind: str = ALL) -> None:
    """Puts changed results into the outbox, for every destination of their courses, `only` one, or those of a `kind`.
    The caller holds the learners' locks, and changes the results in this transaction."""
    queue(session, [row for row in outbox.note(session, changed, only, kind) if not row.has_job])


def queue(session: Session, rows: Sequence[NotedRow]) -> None:
    """Gives rows their jobs. Destinations take turns with each other."""
    if not rows:
        return
    outbox.mark_queued(session, [row.id for row in rows])
    for destination, theirs in groupby(sorted(rows, key=attrgetter("destination")), key=attrgetter("destination")):
        jobs.put_all(session, jobs.DELIVER, [str(row.id) for row in theirs], share=destination)


def release(database: Database, session: Session, course: str, quiz: str, learner: str | None = None) -> None:
    """Delivers what was held back in a quiz, of one learner or of all, if they may see their feedback by now."""
    unsent = {(course, learner)} if learner is not None else {
        (of, who) for of, at, who in outbox.unsent_scores(session) if (of, at) == (course, quiz)
    }  # fmt: skip
    if not unsent:
        return
    database.lock_learners(session, unsent)  # before the rows: results are stored in that order
    rows = outbox.release_held(session, course, quiz, [who for _, who in unsent])
    jobs.hurry(session, jobs.DELIVER, [str(row.id) for row in rows if row.has_job])
    queue(session, [row for row in rows if not row.has_job])


def release_all(database: Database) -> None:
    """As `release`, for every quiz: policies may have changed with the content, or while no server ran."""
    with database.read() as session:
        unsent = {(course, quiz) for course, quiz, _ in outbox.unsent_scores(session)}
    for course, quiz in sorted(unsent):
        with database.write() as session:
            release(database, session, course, quiz)


def send_scores(
    database: Database, session: Session, course: str, quiz: str, question: str = ALL, *,
    learner: str | None = None, by: str = COMMAND_LINE, column: LinkedColumn | None = None,
) -> None:  # fmt: skip
    """Makes the scores of a quiz, or of one question, go to the learners' platforms from now on; with a `column` those
    of the `learner` to it, beside the columns of other links. Safe to repeat: call it whenever a learner comes in by a
    link with a line item. What the `learner` has by then is sent too."""
    made = outbox.add_scores(session, course, quiz, question, by, column=column)
    if learner is not None:
        database.lock_learner(session, course, learner)
        if column is not None:
            outbox.expect(session, made, LearnerAt(course, learner, quiz, question))
        keys = outbox.list_results(session, course, quiz, learner)
        note(session, [key for key in keys if question in (ALL, key.question)], only=made)


def name_receiver(session: Session, row: Delivery, destination: Destination) -> str:
    """Says where a delivery goes: the URL of a webhook; for a score the platform, with the address of the column or of
    the service where it is looked for. Of a score that goes to no platform now, the address that its link had."""
    target = None if destination.kind == WEBHOOK else score_target(session, row)
    if target is None:
        return destination.url or ""
    return f"{target.platform.issuer} {target.line_item_url or target.line_items_url}".rstrip()


def replay(session: Session, who: Identity | None, delivery_id: int, course: str | None) -> Delivery:
    """Delivers a dead letter once more; a score even over what a person has entered at the platform. `who` is None for
    the command line, and `course` for any course. Raises NotFound, and Conflict if it is not dead."""
    row = outbox.lock_delivery(session, delivery_id, course)
    if row is None:
        raise NotFound("There is no such delivery.")
    if row.state != DEAD:
        raise Conflict(f"This delivery is {row.state}: only dead letters are replayed.")
    revive(session, [row])
    record(session, who, row.course, Action.REPLAYED, str(row.id), quiz=row.quiz, member=row.learner)
    return row


def replay_all(session: Session, who: Identity | None, destination_id: str, course: str) -> int:
    """As `replay`, for the dead letters of a destination, at most `REPLAY_MAX`. Returns how many. Raises NotFound."""
    if outbox.find_destination(session, destination_id, course) is None:
        raise NotFound("There is no such webhook.")
    rows = outbox.lock_dead(session, destination_id, REPLAY_MAX)
    revive(session, rows)
    record(session, who, course, Action.REPLAYED, destination_id, deliveries=len(rows))
    return len(rows)


def revive(session: Session, rows: Sequence[Delivery]) -> None:
    """Makes dead rows wait again. Raises Conflict if their destination is disabled."""
    for row in rows:
        destination = session.get_one(outbox.Destination, row.destination)
        if destination.disabled_at is not None:
            raise Conflict("This webhook is disabled: enable it first.")
        row.state, row.attempts, row.error, row.next_at, row.forced = outbox.WAITING, 0, None, None, True
    session.flush()
    queue(session, [NotedRow(row.id, row.destination, row.has_job) for row in rows if not row.has_job])
