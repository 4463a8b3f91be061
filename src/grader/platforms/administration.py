"""Administering platforms: what command line, page and API have in common."""

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from sqlalchemy.orm import Session

from grader.courses.people import platforms as rules
from grader.courses.people.identity import Identity
from grader.courses.people.platforms import Registration
from grader.errors import Unprocessable
from grader.platforms import roster
from grader.platforms.launching.addresses import is_of_platform, read_origin
from grader.platforms.launching.registration import LIFETIME, PURPOSE
from grader.platforms.roster import PulledRoster
from grader.store import platforms, tickets
from grader.store.engine.database import Database

if TYPE_CHECKING:  # it needs the packages of the extra
    from grader.platforms.sending.access_tokens import AccessTokens

URLS = ("login_url", "token_url", "keys_url")

ADDRESSES = {
    "issuer": "issuer",
    "login_url": "authentication request URL (login_url)",
    "token_url": "access token URL (token_url)",
    "keys_url": "public keyset URL (keys_url)",
}
"""What must be an https address, by its field. An issuer: OpenID Connect Core, section 2, `iss`."""


def read_registration(fields: Mapping[str, Any]) -> Registration:
    """Returns a registration as somebody typed it. Raises Unprocessable for an address that is not https. `origins` are
    those that may show our pages in a frame: of the issuer and the login if none is given."""
    texts = {
        name: str(fields.get(name) or "").strip() for name in ("name", "issuer", "client_id", "token_audience", *URLS)
    }
    for name, words in ADDRESSES.items():
        if not is_of_platform(texts[name]):
            raise Unprocessable(f"The {words} is an https address without user name, not {texts[name]!r}.")
    origins = [str(origin).strip() for origin in fields.get("origins") or ()]
    for origin in origins:
        if not is_of_platform(origin) or read_origin(origin) != origin.rstrip("/"):
            raise Unprocessable(f"An origin is https://host[:port] and nothing else, not {origin!r}.")
    normalised = [read_origin(origin) for origin in origins] or [
        read_origin(texts["issuer"]),
        read_origin(texts["login_url"]),
    ]
    texts["name"] = texts["name"] or texts["issuer"]
    return Registration(**texts, origins=tuple(dict.fromkeys(filter(None, normalised))))


def registration_link(session: Session, origin: str) -> str:
    """Returns a single-use address to type into a platform that knows dynamic registration."""
    return f"{origin}/lti/register?token={tickets.issue(session, PURPOSE, {}, LIFETIME)}"


def list_platforms(session: Session) -> list[dict[str, Any]]:
    """Lists every platform with its deployments, as command line, page and API show them."""
    return [describe_platform(session, row) for row in platforms.all_platforms(session)]


def describe_platform(session: Session, row: platforms.PlatformRow) -> dict[str, Any]:
    """Returns a platform with its deployments."""
    return {name: getattr(row, name) for name in ("id", "name", "issuer", "client_id", *URLS)} | {
        "origins": list(platforms.read_platform(row).origins),
        "approved": row.approved_at is not None,
        "deployments": [
            {"deployment_id": deployment.deployment_id, "approved": deployment.approved_at is not None}
            for deployment in platforms.list_deployments(session, row.id)
        ],
    }


def list_contexts(session: Session, course: str | None = None) -> list[dict[str, Any]]:
    """Returns the platforms' courses: those of a course here, and those that ask for it; or all."""
    return [
        {
            "id": context.id,
            "platform": platform.name,
            "title": context.title or context.context_id,
            "course": context.course,
            "wanted": context.wanted,
            "wanted_by": context.wanted_by,
            "has_roster": bool(context.members_url),
        }
        for context, platform in platforms.list_contexts(session, course)
    ]


async def pull_roster(
    database: Database, authorized: "AccessTokens", by: Identity | None, context_id: int
) -> PulledRoster:
    """Pulls the members of a platform's course into the linked one, of which `by` must be an instructor. Raises
    NotFound, Conflict, Unprocessable."""

    def source() -> tuple[platforms.Context, platforms.PlatformRow]:
        with database.read() as session:
            if by is not None:
                rules.get_own_context(session, by, context_id)
            context = roster.find_source(session, context_id)
            row = platforms.get(session, context.platform)
            assert row is not None  # a foreign key
            return context, row

    context, row = await asyncio.to_thread(source)
    people = await roster.pull(authorized, platforms.read_platform(row), context.members_url)

    def enter() -> PulledRoster:
        with database.write() as session:
            return roster.enter(session, by, roster.find_source(session, context_id), people)

    return await asyncio.to_thread(enter)
