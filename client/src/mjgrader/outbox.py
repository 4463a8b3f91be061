"""Answers on their way. Each is written down before it is sent, with a key under which the server takes it once."""

import json
import uuid
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from mjgrader.accounts import Account, find_folder, write_private
from mjgrader.connection import Connection
from mjgrader.errors import Offline, Refusal, SignInAgain


@dataclass(frozen=True)
class Waiting:
    """An answer that the server has not confirmed: a script or model, or a file in base64, under the name `form`.
    `account` tells whose token it was to be sent with, `user` and `course` whose answer it is, which answers of earlier
    clients do not tell."""

    key: str
    site: str
    account: str
    quiz: str
    question: str
    source: str
    at: str
    form: str = "source"
    user: str | None = None
    course: str | None = None

    @property
    def path(self) -> Path:
        """The file that keeps it."""
        return find_folder() / "outbox" / f"{self.key}.json"

    def is_of(self, account: Account) -> bool:
        """Whether it is an answer of this account: of its token, or of the same person in the same course."""
        if self.site != account.site:
            return False
        whose = (self.user, self.course)
        return self.account == account.id or (None not in whose and whose == (account.user, account.course))

    def tell_owner(self) -> str:
        """Returns a sentence on whose answer it is, for somebody else who is signed in."""
        if self.user is None:
            return (
                f"An answer to {self.question} of {self.at} waits from another sign-in, and nobody knows whose it is: "
                f"it is not sent. If it is yours, take its text from {self.path} and hand it in again."
            )
        place = f" in the course {self.course}" if self.course else ""
        return f"An answer of {self.user}{place} to {self.question} waits here: it is sent once {self.user} signs in."


def keep(connection: Connection, quiz: str, question: str, source: str, form: str = "source") -> Waiting:
    """Writes an answer down. The same one that waits already keeps its key."""
    account = connection.account
    for one in list_waiting(account.site):
        if one.is_of(account) and (one.quiz, one.question, one.source) == (quiz, question, source):
            return one
    at = datetime.now(timezone.utc).isoformat(timespec="seconds")  # noqa: UP017 - Python 3.10 has no datetime.UTC
    key, owner = str(uuid.uuid4()), (account.user, account.course)
    waiting = Waiting(key, account.site, account.id, quiz, question, source, at, form, *owner)
    write_private(waiting.path, json.dumps(asdict(waiting)))
    return waiting


def list_waiting(site: str) -> Iterator[Waiting]:
    """Yields the answers that wait for a server, the oldest first."""
    found = []
    for path in (find_folder() / "outbox").glob("*.json"):
        try:
            found.append(Waiting(**json.loads(path.read_text(encoding="utf-8"))))
        except (OSError, ValueError, TypeError):
            continue
    yield from sorted((one for one in found if one.site == site), key=lambda one: one.at)


def deliver(connection: Connection, waiting: Waiting) -> Any:
    """Sends an answer, and returns its submission. It goes on waiting where no response comes, and is forgotten where
    the server refuses it for good. Raises Sentence."""
    body = {"quiz": waiting.quiz, "question": waiting.question, "answer": {waiting.form: waiting.source}}
    try:
        submission = connection.post("/submissions", body, **{"Idempotency-Key": waiting.key})
    except Offline as error:
        raise Offline(
            f"{error} Your answer to {waiting.question} is kept here and not handed in yet: g.sync() sends it, and so "
            "does your next g.submit(). It is never taken twice."
        ) from None
    except KeyboardInterrupt:
        raise Offline(
            f"Stopped while your answer to {waiting.question} was sent. It is kept here: g.sync() sends it, and so "
            "does your next g.submit(). It is never taken twice."
        ) from None
    except SignInAgain as error:
        raise SignInAgain(f"{error} Your answer is kept; send it with g.sync().") from None
    except Refusal:
        waiting.path.unlink(missing_ok=True)
        raise
    waiting.path.unlink(missing_ok=True)
    return submission


def deliver_all(connection: Connection, *, but: Waiting | None = None) -> list[tuple[Waiting, Any]]:
    """Sends what waits of the learner who is signed in, says so, and returns each with its submission. The answers of
    others are told, and go on waiting. `but` is left out. Raises Offline and SignInAgain."""
    sent = []
    for one in list_waiting(connection.account.site):
        if one == but:
            continue
        if not one.is_of(connection.account):
            connection.say(one.tell_owner())
            continue
        try:
            sent.append((one, deliver(connection, one)))
            connection.say(f"Your kept answer to {one.question} was sent.")
        except Refusal as error:
            connection.say(f"Your answer to {one.question} of {one.at} was refused: {error}")
    return sent
