"""The webhooks of a course: who made them, and the secrets that sign their messages."""

import base64
import secrets
from collections.abc import Collection
from datetime import timedelta
from importlib.util import find_spec

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.courses.people.members import require_credential
from grader.domain.addresses import RefusedURL, resolve_endpoint
from grader.errors import Conflict, NotFound, Unprocessable
from grader.store import outbox
from grader.store.engine.database import Database
from grader.store.outbox import WEBHOOK, Destination
from grader.store.tables import now

WEBHOOKS_MAX = 20
"""Webhooks of one course: each change of a result is sent to all of them."""

SECRET_BYTES = 32
ROTATION = timedelta(days=1)
"""How long messages are signed with the old secret too."""


def make_secret() -> str:
    """256 random bits, as Standard Webhooks writes them."""
    return "whsec_" + base64.b64encode(secrets.token_bytes(SECRET_BYTES)).decode()


def create(
    database: Database, session: Session, who: Identity, url: str, private_hosts: Collection[str]
) -> Destination:
    """Adds a webhook; its secret is shown this once. Raises Unprocessable for a URL that is not allowed, Conflict if
    there are too many, and Unauthorized."""
    if find_spec("httpx2") is None:
        raise Unprocessable("Webhooks need the package httpx2: install requirements-all.lock, as in docs/deploy.md")
    try:
        resolve_endpoint(url, private_hosts)
    except RefusedURL as refused:
        raise Unprocessable(f"url: {refused}") from refused
    require_credential(session, who)
    database.lock(session, f"webhooks\n{who.course}")
    if len(outbox.list_webhooks(session, who.course)) >= WEBHOOKS_MAX:
        raise Conflict(f"A course has at most {WEBHOOKS_MAX} webhooks: delete one first.")
    webhook = outbox.add_webhook(session, who.course, {"url": url, "secret": make_secret(), "created_by": who.user})
    record(session, who, who.course, Action.WEBHOOK_CREATED, webhook.id, url=url)
    return webhook


def get(session: Session, webhook_id: str, course: str) -> Destination:
    """Returns the webhook. Raises NotFound."""
    destination = outbox.find_destination(session, webhook_id, course) if webhook_id.isalnum() else None
    if destination is None or destination.kind != WEBHOOK:
        raise NotFound("There is no such webhook.")
    return destination


def rotate(session: Session, who: Identity, webhook_id: str) -> Destination:
    """Gives a webhook a new secret; the old one signs for one more day. Raises NotFound, Unauthorized."""
    require_credential(session, who)
    destination = get(session, webhook_id, who.course)
    destination.old_secret, destination.old_until = destination.secret, now() + ROTATION
    destination.secret = make_secret()
    record(session, who, who.course, Action.WEBHOOK_ROTATED, destination.id)
    return destination


def enable(session: Session, who: Identity, webhook_id: str) -> Destination:
    """Delivers to a webhook again that has answered 410. Raises NotFound."""
    destination = get(session, webhook_id, who.course)
    if destination.disabled_at is not None:
        destination.disabled_at, destination.why_disabled = None, None
        record(session, who, who.course, Action.WEBHOOK_ENABLED, destination.id)
    return destination


def delete(session: Session, who: Identity, webhook_id: str) -> None:
    """Deletes a webhook with all that waits for it. Raises NotFound."""
    destination = get(session, webhook_id, who.course)
    record(session, who, who.course, Action.WEBHOOK_DELETED, destination.id, url=destination.url)
    outbox.remove(session, destination)
