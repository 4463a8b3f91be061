"""Browser sessions, and the single-use links that open them."""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import CredentialKind, Identity, Role, check_role, find, issue, read_identity
from grader.courses.people.members import get_named, give_role, make_unnamed
from grader.errors import Unauthorized
from grader.store import credentials, people
from grader.store.tables import Credential, Member, now

LEARNER_SESSION = timedelta(days=180)
INSTRUCTOR_SESSION = timedelta(hours=12)
SIGN_IN_CODE = timedelta(hours=24)
RETURN_CODE = LEARNER_SESSION

PRUNED = (CredentialKind.SESSION, CredentialKind.SIGN_IN)
"""Kinds of credentials that are deleted once they have ended. Tokens stay listed."""

SPENT = "This sign-in link is unknown, has been used, or is too old."


@dataclass(frozen=True)
class BrowserSession:
    """A new browser session: whose it is, the value of its cookie, and how long both are valid."""

    identity: Identity
    secret: str
    lifetime: timedelta


def create_sign_in_code(session: Session, user: str, role: Role | str, course: str | None = None) -> str:
    """Creates a code that opens one browser session for a named member, for the operator, who also gives the role.
    Raises Unprocessable."""
    checked = check_role(role)
    member = get_named(session, user, checked, course)
    give_role(session, None, member, checked)
    return issue(session, CredentialKind.SIGN_IN, member, SIGN_IN_CODE)


def start_session(
    session: Session, member: Member, platform: int | None = None, *, home: str | None = None,
    until: datetime | None = None,
) -> BrowserSession:  # fmt: skip
    """Starts a browser session, and deletes sessions and codes that have ended. `platform` is the learning platform
    that launched it; each launch opens another one, so they are short. `home` is the session of another course from
    which it is opened; it ends at `until` at the latest."""
    people.prune(session, credentials.prune(session, PRUNED, now()))
    is_short = member.role != Role.STUDENT or platform is not None
    lifetime = INSTRUCTOR_SESSION if is_short else LEARNER_SESSION
    if until is not None:
        lifetime = min(lifetime, until - now())
    secret = issue(session, CredentialKind.SESSION, member, lifetime, platform=platform, home=home)
    session.flush()
    credential = session.get_one(Credential, secret.split("_")[1])
    return BrowserSession(replace(read_identity(credential), by_cookie=True), secret, lifetime)


def start_anonymous_session(session: Session) -> BrowserSession:
    """Starts a browser session for a new learner with a made-up name."""
    return start_session(session, make_unnamed(session))


def find_identity(session: Session, code: str) -> Identity | None:
    """Says who would sign in with the code, which stays valid; None if it is unknown, used or expired."""
    credential = find(session, CredentialKind.SIGN_IN, code)
    return None if credential is None else read_identity(credential)


def redeem_sign_in_code(session: Session, code: str) -> BrowserSession:
    """Exchanges a code for a browser session. Raises Unauthorized if it is unknown, used or expired."""
    credential = find(session, CredentialKind.SIGN_IN, code)
    if credential is None or not credentials.revoke(session, credential.id, now()):
        raise Unauthorized(SPENT)
    opened = start_session(session, session.get_one(Member, credential.member))
    record(session, opened.identity, opened.identity.course, Action.SIGNED_IN, opened.identity.user)
    return opened


def create_return_code(session: Session, who: Identity) -> str:
    """Creates a code with which the owner of a browser session comes back; it revokes the earlier ones. An instructor's
    is as short as any other sign-in code: it must not outlive their session by half a year."""
    credentials.revoke_all(session, who.id, now(), [CredentialKind.SIGN_IN])
    member = session.get_one(Member, who.id)
    return issue(session, CredentialKind.SIGN_IN, member, RETURN_CODE if member.role == Role.STUDENT else SIGN_IN_CODE)


def is_only_in_browser(session: Session, who: Identity) -> bool:
    """Says whether the session is the learner's only way to the work: no name that an instructor knows, no account."""
    return session.get_one(Member, who.id).account is None


def end_session(session: Session, cookie: str) -> None:
    """Revokes the session of a cookie, and the one that it was opened from; an invalid cookie is ignored."""
    if credential := find(session, CredentialKind.SESSION, cookie):
        credentials.revoke(session, credential.home or credential.id, now())
