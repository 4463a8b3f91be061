"""The jobs of the outbox: one row at a time, outside of any transaction and any request."""

import asyncio
import random
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any, Protocol

import structlog
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from grader.platforms.sending.replies import Again, DeadLetter, Gone, HeldReply, Later, Reply, SentReply, UnneededReply
from grader.queue import jobs
from grader.queue.worker import JobOutcome
from grader.store import outbox
from grader.store.outbox import DEAD, HELD, SENT, WAITING, WEBHOOK, Delivery, Destination
from grader.store.tables import now

PAUSES_S = (5.0, 300.0, 1800.0, 7200.0, 18_000.0, 36_000.0, 50_400.0, 72_000.0, 86_400.0)
"""The pause after each failure, 75 hours in all. Source: Standard Webhooks, "Retry schedule"."""

JITTER = 0.1
"""Share by which a pause is lengthened at random, so that not all come at once."""

REST_S = 60.0
"""How long a receiver that did not answer in time is sent nothing [s]: it takes a thread for 20 s each time, and others
wait for one too."""

NO_SENDER_S = 3600.0
"""Pause where this process has no sender of the kind: without LTI, for scores [s]."""

OUR_FAULT = "The grader itself failed; its log has the reason."

log = structlog.get_logger()


class Sender(Protocol):
    """Delivers to one kind of destination."""

    def prepare(self, session: Session, row: Delivery, destination: Destination) -> Any | Reply:
        """Says what `send` needs, or a reply if nothing is sent now. In a transaction, with the row locked."""

    async def send(self, prepared: Any) -> Reply:
        """Sends it, outside of any transaction."""


@dataclass(frozen=True)
class StartedDelivery:
    """A row whose delivery is in progress; `version` is the change that it delivers, and `receiver` who gets it."""

    row_id: int
    version: int
    receiver: str
    sender: Sender | None
    prepared: Any


@dataclass(frozen=True)
class Delivering:
    """Does the jobs of the topic `deliver`. A change that comes while its row is being sent is sent next. A receiver
    that did not answer in time rests for `rest_s`, with all that waits for it."""

    senders: Mapping[str, Sender]
    pauses_s: tuple[float, ...] = PAUSES_S
    clock: Callable[[], datetime] = now
    rest_s: float = REST_S
    _rests_until: dict[str, float] = field(default_factory=dict)

    def start(self, session: Session, subject: str) -> StartedDelivery | None:
        """Prepares what is sent, unless the row waits no more."""
        row = outbox.lock(session, int(subject))
        if row is None:
            return None
        destination = session.get_one(Destination, row.destination)
        if row.state not in (WAITING, HELD):
            row.has_job = False
            return None
        row.state = WAITING
        receiver, sender = identify_receiver(destination), self.senders.get(destination.kind)
        prepared: Any = Later(NO_SENDER_S)  # without a sender: another process may have one
        if (rest_s := self._rests_until.get(receiver, 0.0) - time.monotonic()) > 0:
            jobs.delay(session, jobs.DELIVER, destination.id, rest_s)
            prepared = Later(rest_s)
        elif sender is not None:
            prepared = prepare_row(sender, session, row, destination)
        return StartedDelivery(row.id, row.version, receiver, sender, prepared)

    def run(self, started: StartedDelivery) -> JobOutcome:
        """Sends it."""
        if isinstance(started.prepared, Reply):
            reply = started.prepared
        else:
            assert started.sender is not None
            reply = asyncio.run(started.sender.send(started.prepared))
        if isinstance(reply, Again) and reply.is_slow:
            self._rests_until[started.receiver] = time.monotonic() + self.rest_s
            log.warning("a receiver did not answer in time, and rests", receiver=started.receiver, rest_s=self.rest_s)
        return JobOutcome(lambda session: self._store(session, started, reply))

    def give_up(self, started: StartedDelivery) -> JobOutcome:
        """Goes on by the schedule of deliveries: a fault of ours loses none."""
        return JobOutcome(lambda session: self._store(session, started, Again(OUR_FAULT)))

    def put_back(self, _session: Session, _subject: str) -> None:
        """Nothing: the row waits anyway."""

    def _store(self, session: Session, started: StartedDelivery, reply: Reply) -> None:
        row = outbox.lock(session, started.row_id)
        if row is None:
            return
        row.has_job = False
        if isinstance(reply, SentReply):
            row.sent_at, row.sent, row.tried, row.forced = self.clock(), reply.score, None, False
        if row.state != WAITING:
            return  # its webhook was disabled meanwhile
        if row.version != started.version and not isinstance(reply, Gone):
            self._again(session, row, self._pause_s(row, reply) if isinstance(reply, Again | Later) else 0.0)
        elif isinstance(reply, Again) and row.attempts < len(self.pauses_s):
            row.attempts, row.error = row.attempts + 1, reply.why
            self._again(session, row, self._pause_s(row, reply))
        else:
            self._settle(session, row, reply)

    def _settle(self, session: Session, row: Delivery, reply: Reply) -> None:
        match reply:
            case SentReply() | UnneededReply():
                row.state, row.attempts, row.error, row.next_at = SENT, 0, None, None
            case HeldReply(after_s):
                row.state, row.next_at = HELD, None
                if after_s is not None:
                    self._again(session, row, after_s)
            case Later(after_s):
                self._again(session, row, after_s)
            case Gone(why):
                outbox.disable(session, row.destination, why)
            case DeadLetter(why) | Again(why):
                row.state, row.error, row.next_at, row.forced = DEAD, why, None, False
                log.warning("a delivery is a dead letter", delivery=row.id, destination=row.destination, why=why)

    def _pause_s(self, row: Delivery, reply: Again | Later) -> float:
        if isinstance(reply, Later):
            return reply.after_s
        planned = self.pauses_s[min(max(row.attempts, 1), len(self.pauses_s)) - 1]
        return max(planned, reply.after_s) * random.uniform(1.0, 1.0 + JITTER)

    def _again(self, session: Session, row: Delivery, pause_s: float) -> None:
        row.has_job, row.next_at = True, self.clock() + timedelta(seconds=pause_s)
        jobs.put(session, jobs.DELIVER, str(row.id), share=row.destination, delay_s=pause_s)


def identify_receiver(destination: Destination) -> str:
    """Returns what destinations have in common that are slow together: a webhook is alone, and the columns of a course
    are on one platform."""
    return destination.id if destination.kind == WEBHOOK else f"scores of {destination.course}"


def prepare_row(sender: Sender, session: Session, row: Delivery, destination: Destination) -> Any | Reply:
    """Says what is sent. A fault of ours must not stop the rows behind this one: it is tried again by the schedule."""
    try:
        return sender.prepare(session, row, destination)
    except SQLAlchemyError:
        raise
    except Exception:
        log.exception("a delivery cannot be prepared", delivery=row.id)
        return Again(OUR_FAULT)
