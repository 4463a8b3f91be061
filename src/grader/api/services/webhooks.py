"""`/webhooks` and `/deliveries`: who hears of changed results, and which deliveries wait or failed."""

from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import Query, Response
from pydantic import ConfigDict, Field
from sqlalchemy import ColumnElement

from grader.api.bodies import RequestBody, ResponseBody
from grader.api.paging import NO_NUL, CursorQuery, Cut, Page, build_page
from grader.courses.sending import outbox, webhooks
from grader.domain.addresses import LENGTH
from grader.errors import NotFound
from grader.gate.admission import PREFIX
from grader.gate.callers import Staff, api_router
from grader.gate.problems import refusals
from grader.gate.services import AppServices
from grader.store import outbox as stored
from grader.store.outbox import Delivery, Destination

router = api_router("webhooks")

DIGITS = 18
"""Longest number of a delivery."""


class WebhookBody(RequestBody):
    """Where to send messages."""

    url: str = Field(min_length=1, max_length=LENGTH, pattern=NO_NUL)


class WebhookView(ResponseBody):
    """A webhook without its secrets. `disabled_at` is set once the receiver has answered 410."""

    id: str
    url: str
    created_by: str
    created_at: datetime
    old_secret_until: datetime | None
    disabled_at: datetime | None
    why_disabled: str | None


class NewSecret(WebhookView):
    """A webhook with its secret, which is shown this once."""

    secret: str


class DeliveryView(ResponseBody):
    """What has to be delivered: the newest change of a learner's result. `question` is null for a whole quiz."""

    id: str
    kind: Literal["webhook", "scores"]
    destination: str
    learner: str
    quiz: str
    question: str | None
    state: Literal["waiting", "held", "sent", "dead"]
    attempts: int
    error: str | None
    noted_at: datetime
    next_at: datetime | None
    sent_at: datetime | None


class Replayed(ResponseBody):
    """How many dead letters are delivered once more."""

    replayed: int


class DeliveryQuery(CursorQuery):
    """Which deliveries, and which page of them."""

    model_config = ConfigDict(extra="forbid")

    state: Literal["waiting", "held", "sent", "dead"] | None = None
    destination: str | None = Field(default=None, max_length=32, pattern=NO_NUL)
    learner: str | None = Field(default=None, max_length=32, pattern=NO_NUL)

    def where(self, course: str) -> list[ColumnElement[bool]]:
        """The same, as conditions on rows."""
        filters = self.model_dump(include={"state", "destination", "learner"}, exclude_none=True)
        return [Delivery.course == course, *(getattr(Delivery, name) == value for name, value in filters.items())]


@router.post("/webhooks", status_code=201, response_model=NewSecret, responses=refusals(401, 403, 409, 413, 422, 429))
def create_webhook(body: WebhookBody, who: Staff, services: AppServices, response: Response) -> dict[str, Any]:
    """Tells a URL of every changed result of the course. The secret is shown this once."""
    with services.database.write() as session:
        webhook = webhooks.create(services.database, session, who, body.url, services.settings.private_hosts)
        response.headers["Location"] = f"{PREFIX}/webhooks/{webhook.id}"
        return describe_webhook(webhook) | {"secret": webhook.secret}


@router.get("/webhooks", response_model=Page[WebhookView], responses=refusals(401, 403, 422, 429))
def list_webhooks(who: Staff, services: AppServices, cut: Cut) -> dict[str, Any]:
    """Lists the webhooks of the course, oldest first; never their secrets."""
    with services.database.read() as session:
        return cut([describe_webhook(webhook) for webhook in stored.list_webhooks(session, who.course)])


@router.get("/webhooks/{webhook_id}", response_model=WebhookView, responses=refusals(401, 403, 404, 422, 429))
def show_webhook(webhook_id: str, who: Staff, services: AppServices) -> dict[str, Any]:
    """Shows a webhook, without its secrets."""
    with services.database.read() as session:
        return describe_webhook(webhooks.get(session, webhook_id, who.course))


@router.delete("/webhooks/{webhook_id}", status_code=204, responses=refusals(401, 403, 404, 422, 429))
def delete_webhook(webhook_id: str, who: Staff, services: AppServices) -> None:
    """Deletes a webhook with its deliveries."""
    with services.database.write() as session:
        webhooks.delete(session, who, webhook_id)


@router.post("/webhooks/{webhook_id}:rotate", response_model=NewSecret, responses=refusals(401, 403, 404, 422, 429))
def rotate_webhook_secret(webhook_id: str, who: Staff, services: AppServices) -> dict[str, Any]:
    """Gives a webhook a new secret, shown this once. For a day messages bear signatures of both."""
    with services.database.write() as session:
        destination = webhooks.rotate(session, who, webhook_id)
        return describe_webhook(destination) | {"secret": destination.secret}


@router.post("/webhooks/{webhook_id}:enable", response_model=WebhookView, responses=refusals(401, 403, 404, 422, 429))
def enable_webhook(webhook_id: str, who: Staff, services: AppServices) -> dict[str, Any]:
    """Delivers again to a receiver that had answered 410. What has changed in the meantime is not sent: read `/results`
    from the last cursor on."""
    with services.database.write() as session:
        return describe_webhook(webhooks.enable(session, who, webhook_id))


@router.post("/webhooks/{webhook_id}:replay", response_model=Replayed, responses=refusals(401, 403, 404, 409, 422, 429))
def replay_webhook(webhook_id: str, who: Staff, services: AppServices) -> dict[str, int]:
    """Delivers the dead letters of a webhook once more, at most 1000 at a time. 409 while it is disabled."""
    with services.database.write() as session:
        webhooks.get(session, webhook_id, who.course)
        return {"replayed": outbox.replay_all(session, who, webhook_id, who.course)}


@router.get("/deliveries", response_model=Page[DeliveryView], responses=refusals(401, 403, 422, 429))
def list_deliveries(
    query: Annotated[DeliveryQuery, Query()], who: Staff, services: AppServices, response: Response
) -> dict[str, Any]:
    """Lists what was delivered, waits, or could not be delivered (`?state=dead`): webhooks and scores."""
    with services.database.read() as session:
        rows = stored.page(session, query.where(who.course), query.read_number(DIGITS), query.limit + 1)
        items = [describe_delivery(row, kind) for row, kind in rows]
    return build_page(items, query, "/deliveries", response)


@router.post(
    "/deliveries/{delivery_id}:replay", response_model=DeliveryView, responses=refusals(401, 403, 404, 409, 422, 429)
)
def replay_delivery(delivery_id: str, who: Staff, services: AppServices) -> dict[str, Any]:
    """Delivers a dead letter once more. A score then replaces what a person has entered at the platform."""
    if not (delivery_id.isascii() and delivery_id.isdecimal()) or len(delivery_id) > DIGITS:
        raise NotFound("There is no such delivery.")
    with services.database.write() as session:
        row = outbox.replay(session, who, int(delivery_id), who.course)
        return describe_delivery(row, session.get_one(Destination, row.destination).kind)


def describe_webhook(destination: Destination) -> dict[str, Any]:
    """A webhook as plain JSON."""
    names = ("id", "url", "created_by", "created_at", "disabled_at", "why_disabled")
    return {name: getattr(destination, name) for name in names} | {"old_secret_until": destination.old_until}


def describe_delivery(row: Delivery, kind: str) -> dict[str, Any]:
    """A delivery as plain JSON; `id` is text, as everywhere."""
    names = ("destination", "learner", "quiz", "state", "attempts", "error", "noted_at", "next_at", "sent_at")
    shown = {name: getattr(row, name) for name in names}
    return shown | {"id": str(row.id), "kind": kind, "question": row.question or None}
