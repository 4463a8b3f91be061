"""Stopping one's own script: one that waits leaves the queue, one that runs is ended by its worker. It uses no attempt
unless the script had its hidden inputs: a script that runs on, or not, as these decide would tell of them, and to stop
it for free would be a look for free. A run that ends by itself meanwhile wins: its worker alone stores what came of it,
in the transaction that ends the job."""

import threading
import time
from contextlib import suppress

from grader.courses.answering import results
from grader.courses.people.identity import Identity
from grader.domain.verdict import Status, Verdict
from grader.errors import Conflict, NotFound, ScriptStopped
from grader.library import Library
from grader.queue import jobs
from grader.store import intake, submissions
from grader.store.engine.database import Database
from grader.store.events import EVENTS
from grader.store.submissions import STOP
from grader.store.tables import Submission

STOPPED = "This script was stopped before it ran. No attempt was used."
STOPPED_RUNNING = "This script was stopped while it ran. No attempt was used."
STOPPED_LATE = "This script was stopped after its hidden cases had begun, which uses an attempt."
NOT_STOPPED = "The script was at its end, and gets its verdict."
STOPPING = "The script is being stopped."
TOO_LATE = "This script cannot be stopped any more: it has its verdict, or is being stopped."

WAIT_S = 5.0
"""How long a request waits for the worker to end a script; a worker that is away ends it later, or not at all [s]."""


def stop(database: Database, library: Library, who: Identity, submission_id: str) -> str:
    """Stops a learner's script; says what came of it. Raises NotFound, and Conflict if it is judged or stopping."""
    changed = threading.Event()
    with database.signals.listening(EVENTS, changed.set, submission_id):
        with database.write() as session:
            submission = submissions.get(session, submission_id) if submission_id.isalnum() else None
            if submission is None or (submission.course, submission.learner) != (who.course, who.id):
                raise NotFound("There is no such submission.")
            if jobs.withdraw(session, jobs.GRADE, submission.id, who.id):
                results.append_verdict(
                    database, library, session, submission, judge_unrun(library, submission), cause=STOP
                )
                intake.forget_key(session, submission.id)
                return STOPPED
            if not jobs.ask_to_stop(session, jobs.GRADE, submission.id):
                raise Conflict(TOO_LATE)
        deadline = time.monotonic() + WAIT_S
        while (left_s := deadline - time.monotonic()) > 0 and changed.wait(left_s):
            changed.clear()
            with database.read() as session:
                verdict = submissions.read_verdicts_by_id(session, [submission_id]).get(submission_id)
            if verdict is not None:
                diagnosis = verdict["diagnosis"]
                return str(diagnosis) if diagnosis in (STOPPED_RUNNING, STOPPED_LATE) else NOT_STOPPED
    return STOPPING


def judge_unrun(library: Library, submission: Submission) -> Verdict:
    """The verdict on a script that was stopped before it ran: as one that cannot be read, it touches nothing."""
    worth = 0.0
    with suppress(NotFound):  # the content has lost the question
        worth = library.question(submission.quiz, submission.question).points
    return Verdict(
        status=Status.INVALID_ANSWER,
        points=0.0,
        max_points=worth,
        diagnosis=STOPPED,
        content_digest=submission.content_digest,
    )


def judge_stopped(stopped: ScriptStopped, fault: Verdict) -> Verdict:
    """The verdict on a script that was stopped while it ran, made of the verdict on one that we failed to grade."""
    late = {"status": Status.TIMED_OUT, "diagnosis": STOPPED_LATE}
    free = {"status": Status.INVALID_ANSWER, "diagnosis": STOPPED_RUNNING}
    return fault.model_copy(update=late if stopped.has_seen_hidden else free)
