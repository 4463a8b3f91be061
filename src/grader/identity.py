"""Who is asking, and what may they do: bearer tokens, browser sessions and one-time sign-in codes.

All three are one thing, a Credential: `prefix_id_secret` with 256 random bits, of which only a hash is kept.
"""

import hashlib
import hmac
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from enum import StrEnum
from typing import NamedTuple

from sqlalchemy.orm import Session

from grader.errors import Forbidden, Unauthorized, Unprocessable
from grader.store import credentials
from grader.store.database import Database
from grader.store.tables import NAME, Credential, now

DEFAULT_COURSE = "default"
COOKIE = "grader_session"
SECURE_COOKIE = "__Host-grader_session"
"""Under https: the browser then takes it from this host alone."""

LEARNER_SESSION = timedelta(days=180)
INSTRUCTOR_SESSION = timedelta(hours=12)
SIGN_IN_CODE = timedelta(hours=24)
TOUCH = timedelta(minutes=1)
"""How exact `last_used_at` is: not every request writes."""

FAILED = "Send a valid token as `Authorization: Bearer ...`, or sign in."


class Role(StrEnum):
    """What somebody is in their course."""

    STUDENT = "student"
    INSTRUCTOR = "instructor"
    SERVICE = "service"


class Kind(StrEnum):
    """What a credential is for; the value is the prefix by which it is recognised, in a leaked file too."""

    TOKEN = "grt"  # noqa: S105
    SESSION = "grs"
    SIGN_IN = "gri"


@dataclass(frozen=True)
class Identity:
    """Somebody in a course. `by_cookie`: a browser sent it along unasked, so what it asks for is checked for origin."""

    user: str
    role: Role
    course: str
    by_cookie: bool = False

    @property
    def is_instructor(self) -> bool:
        """Whether everything of the course may be seen."""
        return self.role is Role.INSTRUCTOR

    def require(self, *roles: Role) -> None:
        """Raises Forbidden for any other role."""
        if self.role not in roles:
            raise Forbidden(f"This is for the role {' or '.join(roles)}; yours is {self.role}.")

    def may_see(self, user: str, course: str) -> bool:
        """Whether what `user` handed in is theirs to see."""
        return self.course == course and (self.is_instructor or self.user == user)


def create_token(session: Session, user: str, role: Role | str, course: str | None = None) -> str:
    """A new bearer token for a program or a person, good until it is revoked. Raises Unprocessable."""
    return _issue(session, Kind.TOKEN, Named(user, role, course))


def create_sign_in_code(session: Session, user: str, role: Role | str, course: str | None = None) -> str:
    """A code that opens one browser session and is then used up."""
    return _issue(session, Kind.SIGN_IN, Named(user, role, course), SIGN_IN_CODE)


def start_anonymous_session(session: Session) -> str:
    """A browser session of a learner whom nobody needs to know by name."""
    return _issue(session, Kind.SESSION, Named(f"learner-{secrets.token_hex(3)}", Role.STUDENT), LEARNER_SESSION)


def redeem_sign_in_code(session: Session, code: str) -> tuple[Identity, str]:
    """Uses the code up for a browser session. Raises Unauthorized where it is unknown, used or too old."""
    credential = _find(session, Kind.SIGN_IN, code)
    if credential is None or not credentials.revoke(session, credential.id, now()):
        raise Unauthorized(
            "This sign-in link is unknown, has been used, or is too old. Start the server again for one."
        )
    lifetime = INSTRUCTOR_SESSION if credential.role == Role.INSTRUCTOR else LEARNER_SESSION
    holder = Named(credential.user, credential.role, credential.course)
    secret = _issue(session, Kind.SESSION, holder, lifetime)
    return _identity(credential, by_cookie=True), secret


def end_session(session: Session, cookie: str) -> None:
    """Signs out; a cookie that is not valid any more is no error."""
    if credential := _find(session, Kind.SESSION, cookie):
        credentials.revoke(session, credential.id, now())


def revoke_all(session: Session, user: str, course: str | None = None) -> int:
    """Ends every bearer token, browser session and sign-in code of a user; how many there were."""
    return credentials.revoke_all(session, user, course or DEFAULT_COURSE, now())


def authenticate(database: Database, authorization: str | None, cookies: Mapping[str, str]) -> Identity:
    """Who sent these headers: the bearer token decides where there is one, else the session cookie.

    Raises Unauthorized.
    """
    if authorization is not None:
        scheme, _, token = authorization.partition(" ")
        kind, presented = Kind.TOKEN, token.strip() if scheme.lower() == "bearer" else ""
    else:
        kind, presented = Kind.SESSION, cookies.get(SECURE_COOKIE) or cookies.get(COOKIE) or ""
    with database.read() as session:
        credential = _find(session, kind, presented)
    if credential is None:
        raise Unauthorized(FAILED)
    if credential.last_used_at is None or credential.last_used_at < now() - TOUCH:
        with database.write() as session:
            credentials.touch(session, credential.id, now())
    return _identity(credential, by_cookie=kind is Kind.SESSION)


class Named(NamedTuple):
    """Whom a credential is for, as it was asked for."""

    user: str
    role: Role | str
    course: str | None = None


def _issue(session: Session, kind: Kind, holder: Named, lifetime: timedelta | None = None) -> str:
    if holder.role not in set(Role):
        raise Unprocessable(f"The role is one of {', '.join(Role)}, not {holder.role!r}.")
    credential_id, secret = secrets.token_hex(8), secrets.token_hex(32)
    credential = Credential(
        id=credential_id,
        kind=kind.value,
        secret_hash=_hash(secret),
        user=checked_name("user", holder.user),
        role=str(holder.role),
        course=checked_name("course", DEFAULT_COURSE if holder.course is None else holder.course),
        expires_at=None if lifetime is None else now() + lifetime,
    )
    credentials.add(session, credential)
    return f"{kind.value}_{credential_id}_{secret}"


def _find(session: Session, kind: Kind, presented: str) -> Credential | None:
    prefix, _, rest = presented.partition("_")
    credential_id, _, secret = rest.partition("_")
    if prefix != kind.value or not credential_id.isalnum() or not credential_id.isascii():
        return None
    credential = credentials.find(session, credential_id, kind.value, now())
    if credential is None or not hmac.compare_digest(credential.secret_hash, _hash(secret)):
        return None
    return credential


def checked_name(what: str, name: str) -> str:
    """The name as it is. Raises Unprocessable where it is empty, too long, or holds what cannot be printed."""
    if not name.strip() or len(name) > NAME or not name.isprintable():
        raise Unprocessable(f"A {what} has a name of 1 to {NAME} printable characters.")
    return name


def _hash(secret: str) -> str:
    """A plain digest is enough: nobody guesses 256 random bits."""
    return hashlib.sha256(secret.encode(errors="surrogatepass")).hexdigest()


def _identity(credential: Credential, by_cookie: bool) -> Identity:
    return Identity(credential.user, Role(credential.role), credential.course, by_cookie)
