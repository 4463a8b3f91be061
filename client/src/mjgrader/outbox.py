"""Answers on their way. Each is written down before it is sent, with a key under which the server takes it once."""

import json
import uuid
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from mjgrader.accounts import find_folder, write_private
from mjgrader.connection import Connection
from mjgrader.errors import Offline, Refusal, SignInAgain


@dataclass(frozen=True)
class Waiting:
    """An answer that the server has not confirmed: a script or model, or a file in base64, under the name `form`.
    `account` tells whose token it was to be sent with."""

    key: str
    site: str
    account: str
    quiz: str
    question: str
    source: str
    at: str
    form: str = "source"

    @property
    def path(self) -> Path:
        """The file that keeps it."""
        return find_folder() / "outbox" / f"{self.key}.json"


def keep(connection: Connection, quiz: str, question: str, source: str, form: str = "source") -> Waiting:
    """Writes an answer down. The same one that waits already keeps its key."""
    account = connection.account
    for one in list_waiting(account.site):
        if (one.account, one.quiz, one.question, one.source) == (account.id, quiz, question, source):
            return one
    at = datetime.now(timezone.utc).isoformat(timespec="seconds")  # noqa: UP017 - Python 3.10 has no datetime.UTC
    waiting = Waiting(str(uuid.uuid4()), account.site, account.id, quiz, question, source, at, form)
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


def deliver_all(connection: Connection, *, of_others: bool, but: Waiting | None = None) -> list[tuple[Waiting, Any]]:
    """Sends what waits for this server, and returns each with its submission. What was kept under another sign-in is
    sent only with `of_others`: it may be another person's. `but` is left out. Raises Offline and SignInAgain."""
    sent = []
    for one in list_waiting(connection.account.site):
        if one == but:
            continue
        if one.account != connection.account.id and not of_others:
            connection.say(f"An answer to {one.question} waits from an earlier sign-in: g.sync() sends it as yours.")
            continue
        try:
            sent.append((one, deliver(connection, one)))
        except Refusal as error:
            connection.say(f"Your answer to {one.question} of {one.at} was refused: {error}")
    return sent
