"""The login that precedes a launch: third-party initiated login of OpenID Connect. Source: 1EdTech Security Framework
1.1, section 5.1.1; LTI OIDC Login with Client Side postMessages 1.0."""

import hmac
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy.orm import Session

from grader.domain.platform import Platform
from grader.errors import Unauthorized, Unprocessable
from grader.platforms.launching.addresses import add_query, is_at
from grader.store import platforms, tickets

PURPOSE = "lti-login"
LIFETIME = timedelta(minutes=10)
FIELDS = ("iss", "login_hint", "target_link_uri", "lti_message_hint", "client_id", "lti_storage_target")
FIELD_CHARACTERS_MAX = 8000
"""Canvas packs a signed token into its message hint."""
STORAGE = "lti_storage_target"


@dataclass(frozen=True)
class Login:
    """A login in progress. `state` finds it again; `key` proves that the same browser comes back. `address` is where
    the platform signs the launch. `storage` names the platform's frame that keeps the key for browsers that keep no
    cookies of ours; empty where it has none."""

    platform: Platform
    state: str
    key: str
    address: str
    storage: str


@dataclass(frozen=True)
class AnsweredLogin:
    """A login that its own browser came back to: it is used up. The launch must bear `nonce`."""

    platform: Platform
    nonce: str


@dataclass(frozen=True)
class UnboundLogin:
    """A login whose browser did not prove itself. It stays valid. `fields` begin it again; `storage` names the
    platform's frame that may still hold the key."""

    platform: Platform
    fields: dict[str, str]
    storage: str


def read_fields(pairs: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Returns the parameters of a login. Raises Unprocessable if one is there twice, or too long."""
    known = [(name, value) for name, value in pairs if name in FIELDS]
    fields = dict(known)
    if len(fields) < len(known):
        raise Unprocessable("A parameter of the login is there twice.")
    if any(len(value) > FIELD_CHARACTERS_MAX or not value.isprintable() for value in fields.values()):
        raise Unprocessable("A parameter of the login is too long, or not printable.")
    return fields


def begin(session: Session, fields: Mapping[str, str], origin: str) -> Login:
    """Begins a login at a registered platform. `origin` is where this tool is reached. Raises Unprocessable for a
    missing or foreign parameter, and Unauthorized for an unknown platform."""
    if not fields.get("login_hint"):
        raise Unprocessable("The login has no login_hint: start it from your learning platform.")
    if not is_at(origin, fields.get("target_link_uri")):
        raise Unprocessable("The login leads to an address that is not this service's.")
    platform = find_platform(session, fields)
    nonce, key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
    body = {"platform": platform.id, "nonce": nonce, "key": tickets.hash_secret(key), "fields": dict(fields)}
    state = tickets.issue(session, PURPOSE, body, LIFETIME)
    hint = fields.get("lti_message_hint")
    address = add_query(
        platform.login_url, scope="openid", response_type="id_token", response_mode="form_post", prompt="none",
        client_id=platform.client_id, redirect_uri=launch_url(origin), state=state, nonce=nonce,
        login_hint=fields["login_hint"], **({} if hint is None else {"lti_message_hint": hint}),
    )  # fmt: skip
    return Login(platform, state, key, address, fields.get(STORAGE, ""))


def find_platform(session: Session, fields: Mapping[str, str]) -> Platform:
    """Returns the approved platform that begins a login. Raises Unauthorized."""
    issuer = fields.get("iss", "")
    registered = platforms.find_registered(session, issuer, fields.get("client_id"))
    if not registered:
        raise Unauthorized("This learning platform is not registered here: its administrator can do so.")
    if len(registered) > 1:
        raise Unauthorized("This platform is registered several times: its login must name the client_id.")
    if registered[0].approved_at is None:
        raise Unauthorized("The registration of this learning platform waits for approval here.")
    return platforms.read_platform(registered[0])


def answer(session: Session, state: str, key: str) -> AnsweredLogin | UnboundLogin:
    """The login of a state, used up if the browser's key is right. Raises Unauthorized if it is unknown or used."""
    body = tickets.peek(session, PURPOSE, state)
    row = None if body is None else platforms.get(session, body["platform"])
    if body is None or row is None or row.approved_at is None:
        raise Unauthorized("This launch was used already, or is too old. Start it again from your learning platform.")
    if not hmac.compare_digest(body["key"], tickets.hash_secret(key)):
        fields: dict[str, str] = body["fields"]
        again = {name: value for name, value in fields.items() if name != STORAGE}
        return UnboundLogin(platforms.read_platform(row), again, fields.get(STORAGE, ""))
    if tickets.take(session, PURPOSE, state) is None:
        raise Unauthorized("This launch was used already. Start it again from your learning platform.")
    return AnsweredLogin(platforms.read_platform(row), body["nonce"])


def make_name(state: str) -> str:
    """Says what the browser's key of a login is called, in a cookie or in the platform's storage."""
    return f"grader_lti_{tickets.hash_secret(state)[:16]}"


def login_url(origin: str) -> str:
    """Says where platforms begin a login."""
    return f"{origin}/lti/login"


def launch_url(origin: str) -> str:
    """Returns the redirect URI to register: where launches are posted to."""
    return f"{origin}/lti/launch"


def keys_url(origin: str) -> str:
    """Says where platforms fetch this tool's public keys."""
    return f"{origin}/lti/keys.json"
