"""Authentication and roles: who sent a request, by a bearer token or a browser session. Both are Credentials, as
sign-in links are: `prefix_id_secret` with 256 random bits, of which only a hash is stored. The room `courses` issues
and revokes them."""

import hashlib
import hmac
import re
import secrets
import time
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from enum import StrEnum

from sqlalchemy.orm import Session

from grader.errors import Forbidden, Unauthorized, Unprocessable
from grader.store import credentials
from grader.store.engine.database import Database
from grader.store.tables import NAME, Credential, Member, now

DEFAULT_COURSE = "default"
COOKIE = "grader_session"
SECURE_COOKIE = "__Host-grader_session"
"""The cookie's name under https: its prefix makes browsers accept it from this host alone."""

TOUCH = timedelta(minutes=5)
"""Resolution of `last_used_at`: not every request writes it. A learner answers every minute or two, and an answer that
writes it takes several times as long."""

FAILED = "Send a valid token as `Authorization: Bearer ...`, or sign in."


INVISIBLE = re.compile("[\\u034f\\u115f\\u1160\\u17b4\\u17b5\\u2800\\u3164\\uffa0]")
"""Letters, marks and symbols that show nothing: with one, two names look the same. `isprintable` refuses the others.
Source: Unicode, Default_Ignorable_Code_Point in the categories L and M but for variation selectors, and the empty
braille pattern."""


class Role(StrEnum):
    """A user's role in a course."""

    STUDENT = "student"
    INSTRUCTOR = "instructor"
    SERVICE = "service"


class Scope(StrEnum):
    """The scopes to which a token may be restricted. The routes of each are listed in one place: `gate/scopes.py`."""

    READ = "read"
    ANSWER = "answer"
    REVIEW = "review"
    REGRADE = "regrade"
    RESULTS = "results"
    LMS = "lms"
    CONTENT = "content"
    PEOPLE = "people"


class CredentialKind(StrEnum):
    """The kind of a credential; the value is its prefix, by which scanners recognise a leaked one."""

    TOKEN = "grt"  # noqa: S105
    SESSION = "grs"
    SIGN_IN = "gri"


@dataclass(frozen=True)
class Identity:
    """An authenticated member of a course: `id` identifies it, `user` is its name, which need not be unique.
    `by_cookie` requests may be forged by other sites: check their origin."""

    id: str
    user: str
    role: Role
    course: str
    by_cookie: bool = False
    scopes: frozenset[Scope] | None = None
    """The scopes of a restricted token; None for all rights of the role."""
    credential: str = ""
    """The id of the credential that was presented."""
    platform: int | None = None
    """The learning platform whose launch opened the session; its pages may show ours in a frame."""

    @property
    def is_instructor(self) -> bool:
        """Whether the user is an instructor, who may see everything of the course."""
        return self.role is Role.INSTRUCTOR

    @property
    def drawn_for(self) -> str:
        """Whose numbers a question with drawn numbers has: those of the learner; empty for anybody else."""
        return f"{self.course}/{self.id}" if self.role is Role.STUDENT else ""

    def require(self, *roles: Role) -> None:
        """Raises Forbidden unless the user has one of `roles`."""
        if self.role not in roles:
            raise Forbidden(f"This is for the role {' or '.join(roles)}; yours is {self.role}.")

    def require_scope(self, scope: Scope | None) -> None:
        """Raises Forbidden unless the token has the scope; None asks for an unrestricted token."""
        if self.scopes is not None and scope not in self.scopes:
            wanted = "no scope" if scope is None else f"the scope `{scope}`"
            raise Forbidden(f"This needs a token with {wanted}; yours has: {', '.join(sorted(self.scopes))}.")

    def may_see(self, learner: str, course: str) -> bool:
        """Says whether this identity may see a submission in `course` of the learner with this id."""
        return self.course == course and (self.is_instructor or self.id == learner)


def authenticate(database: Database, authorization: str | None, cookies: Mapping[str, str]) -> Identity:
    """Authenticates a request by its bearer token if it has one, else by its session cookie. Raises Unauthorized."""
    kind, presented = read_presented(authorization, cookies)
    with database.read() as session:
        credential = find(session, kind, presented)
    if credential is None:
        raise Unauthorized(FAILED)
    if credential.last_used_at is None or credential.last_used_at < now() - TOUCH:
        with database.write(hasty=True) as session:  # a power cut may undo it
            credentials.touch(session, credential.id, now())
    return read_identity(credential)


def read_presented(authorization: str | None, cookies: Mapping[str, str]) -> tuple[CredentialKind, str]:
    """Returns the kind and the text of the credential that a request carries; an empty text if it carries none."""
    if authorization is not None:
        scheme, _, token = authorization.partition(" ")
        return CredentialKind.TOKEN, token.strip() if scheme.lower() == "bearer" else ""
    return CredentialKind.SESSION, cookies.get(SECURE_COOKIE) or cookies.get(COOKIE) or ""


class CredentialCache:
    """Who lately authenticated with which credential, for callers who ask themselves whether it still holds. Only
    hashes of credentials are kept, and for `TOUCH` at most. Not thread-safe: for the event loop."""

    def __init__(self, count: int = 10_000, clock: Callable[[], float] = time.monotonic) -> None:
        self._count, self._clock = count, clock
        self._kept: dict[str, tuple[float, Identity]] = {}

    def get(self, authorization: str | None, cookies: Mapping[str, str]) -> Identity | None:
        """Returns the identity, if it was put lately."""
        until, identity = self._kept.get(self._key(authorization, cookies), (0.0, None))
        return identity if self._clock() < until else None

    def put(self, authorization: str | None, cookies: Mapping[str, str], identity: Identity) -> None:
        """Keeps an identity; drops the oldest of too many."""
        key = self._key(authorization, cookies)
        self._kept.pop(key, None)
        self._kept[key] = self._clock() + TOUCH.total_seconds(), identity
        if len(self._kept) > self._count:
            del self._kept[next(iter(self._kept))]

    def _key(self, authorization: str | None, cookies: Mapping[str, str]) -> str:
        return _hash(" ".join(read_presented(authorization, cookies)))


def issue(
    session: Session, kind: CredentialKind, member: Member, lifetime: timedelta | None = None, *,
    scopes: frozenset[Scope] | None = None, by: Identity | None = None, platform: int | None = None,
    label: str | None = None, home: str | None = None,
) -> str:  # fmt: skip
    """Stores a new credential of the member, valid for `lifetime` or until it is revoked. Returns its text.

    It has the member's role, and is of no use as soon as they have another.

    `by` is the member who issues it; None for the command line, and for sessions, which members start themselves.
    `platform` is the learning platform whose launch opens a session, `label` what a device calls itself, `home` the
    session of another course from which one is opened.
    """
    credential_id, secret = secrets.token_hex(8), secrets.token_hex(32)
    credential = Credential(
        id=credential_id, kind=kind.value, secret_hash=_hash(secret), member=member.id, user=member.name,
        role=member.role, course=member.course, scopes=None if scopes is None else " ".join(sorted(scopes)),
        created_by=None if by is None else by.user, platform=platform, label=label, home=home,
        expires_at=None if lifetime is None else now() + lifetime,
    )  # fmt: skip
    credentials.add(session, credential)
    return f"{kind.value}_{credential_id}_{secret}"


def find(session: Session, kind: CredentialKind, presented: str) -> Credential | None:
    """Returns the credential with this text; None if it is unknown, revoked or expired."""
    prefix, _, rest = presented.partition("_")
    credential_id, _, secret = rest.partition("_")
    if prefix != kind.value or not credential_id.isalnum() or not credential_id.isascii():
        return None
    credential = credentials.find(session, credential_id, kind.value, now())
    if credential is None or not hmac.compare_digest(credential.secret_hash, _hash(secret)):
        return None
    return credential


def still_holds(session: Session, who: Identity) -> bool:
    """Says whether the credential that was presented has not ended meanwhile."""
    kind = CredentialKind.SESSION if who.by_cookie else CredentialKind.TOKEN
    return credentials.find(session, who.credential, kind.value, now()) is not None


def read_identity(credential: Credential) -> Identity:
    """Returns the identity that a credential proves."""
    by_cookie = credential.kind == CredentialKind.SESSION
    scopes = None if credential.scopes is None else frozenset(map(Scope, credential.scopes.split()))
    return Identity(
        credential.member, credential.user, Role(credential.role), credential.course, by_cookie, scopes, credential.id,
        credential.platform,
    )  # fmt: skip


def check_name(what: str, name: str) -> str:
    """Returns the name, composed, as one letter may be written as two characters. Raises Unprocessable if it is empty,
    too long, or has characters that cannot be seen."""
    name = unicodedata.normalize("NFC", name)
    if not name.strip() or len(name) > NAME or name != visible_part(name):
        raise Unprocessable(f"A {what} has a name of 1 to {NAME} printable characters, not {name[: NAME + 1]!r}.")
    return name


def visible_part(name: str) -> str:
    """Returns the name, composed, without characters that cannot be seen, which other systems may send."""
    return "".join(filter(str.isprintable, INVISIBLE.sub("", unicodedata.normalize("NFC", name))))


def check_role(role: str) -> Role:
    """Returns the role of this name. Raises Unprocessable if there is none."""
    if role not in set(Role):
        raise Unprocessable(f"The role is one of {', '.join(Role)}, not {role!r}.")
    return Role(role)


def check_scopes(names: Iterable[str]) -> frozenset[Scope]:
    """Returns the scopes of these names. Raises Unprocessable if there is none, or one does not exist."""
    chosen = set(names)
    if not chosen or not chosen <= set(Scope):
        raise Unprocessable(f"The scopes are {', '.join(Scope)}.")
    return frozenset(map(Scope, chosen))


def _hash(secret: str) -> str:
    """Returns the sha256 of a secret. 256 random bits need no slow or salted hash."""
    return hashlib.sha256(secret.encode(errors="surrogatepass")).hexdigest()
