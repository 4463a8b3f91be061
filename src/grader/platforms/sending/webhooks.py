"""Sends webhooks after Standard Webhooks 1: a thin message, signed, under an id that stays through all tries. Source:
https://github.com/standard-webhooks/standard-webhooks/blob/main/spec/standard-webhooks.md"""

import base64
import hashlib
import hmac
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from http import HTTPStatus
from typing import Any

from sqlalchemy.orm import Session

from grader.domain.addresses import RefusedURL
from grader.platforms.sending.failures import TooSlow, Unreachable
from grader.platforms.sending.outgoing import Outgoing
from grader.platforms.sending.replies import Again, DeadLetter, Gone, Reply, SentReply, UnneededReply, retry_after_s
from grader.store import results
from grader.store.outbox import Delivery, Destination
from grader.store.results import LearnerAt
from grader.store.tables import Result, now

CHANGED = "result.changed"

SECRET_PREFIX = "whsec_"  # noqa: S105


@dataclass(frozen=True)
class PreparedMessage:
    """A message on its way; it is signed with each of `secrets`."""

    url: str
    id: str
    body: bytes
    secrets: Sequence[str]


@dataclass(frozen=True)
class Webhooks:
    """The sender of webhooks."""

    outgoing: Outgoing
    clock: Callable[[], datetime] = now

    def prepare(self, session: Session, row: Delivery, destination: Destination) -> PreparedMessage | Reply:
        """Makes the message of a row: the same for every try, until the result changes again."""
        result = results.find(session, LearnerAt(row.course, row.learner, row.quiz, row.question))
        if result is None or destination.url is None or destination.secret is None:
            return UnneededReply()
        secrets = [destination.secret]
        if destination.old_secret is not None and destination.old_until is not None:
            secrets += [destination.old_secret] if self.clock() < destination.old_until else []
        body = build_message(row, result)
        return PreparedMessage(destination.url, make_message_id(destination.id, body), body, secrets)

    async def send(self, prepared: PreparedMessage) -> Reply:
        """Sends a message. Any success is one; 410 ends the webhook; all else is tried again."""
        try:
            response = await self.outgoing.request(
                "POST", prepared.url, headers=build_headers(prepared, self.clock()), body=prepared.body, reads=False
            )
        except RefusedURL as refused:
            return DeadLetter(str(refused))
        except Unreachable as error:
            return Again(str(error), is_slow=isinstance(error, TooSlow))
        if HTTPStatus.OK <= response.status < HTTPStatus.MULTIPLE_CHOICES:
            return SentReply()
        if response.status == HTTPStatus.GONE:
            return Gone("The receiver answered 410: it wants no more messages.")
        return Again(f"The receiver answered {response.status}.", retry_after_s(response.headers, self.clock()))


def build_message(row: Delivery, result: Result) -> bytes:
    """Returns the body: what changed, by ids alone. The receiver asks for the rest."""
    data: dict[str, Any] = {
        "course": row.course,
        "quiz": row.quiz,
        "question": row.question,
        "submission_id": result.submission_id,
        "revision": result.revision,
    }
    return json.dumps({"type": CHANGED, "timestamp": row.noted_at.isoformat(), "data": data}).encode()


def make_message_id(destination_id: str, body: bytes) -> str:
    """Returns the id of a message to a destination, from what it says. Numbers of rows would come again after a restore
    from a backup, and in another installation: receivers would take a new change for one that they have."""
    return "msg_" + hashlib.blake2b(body, key=destination_id.encode(), digest_size=16).hexdigest()


def build_headers(prepared: PreparedMessage, moment: datetime) -> Mapping[str, str]:
    """Returns the headers of one try, with the time of this try."""
    timestamp = str(int(moment.timestamp()))
    signed = b".".join((prepared.id.encode(), timestamp.encode(), prepared.body))
    signatures = " ".join(sign_message(secret, signed) for secret in prepared.secrets)
    return {
        "Content-Type": "application/json",
        "webhook-id": prepared.id,
        "webhook-timestamp": timestamp,
        "webhook-signature": signatures,
    }


def sign_message(secret: str, signed: bytes) -> str:
    """Returns the signature of a message with a secret `whsec_...`."""
    key = base64.b64decode(secret.removeprefix(SECRET_PREFIX))
    return "v1," + base64.b64encode(hmac.new(key, signed, hashlib.sha256).digest()).decode()
