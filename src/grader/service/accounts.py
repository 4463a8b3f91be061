"""Revocations, sign-in links and extensions for the database of an installation, as the command line gives them."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people.identity import DEFAULT_COURSE, Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.courses.people.tokens import revoke_all
from grader.domain.policy import Extension
from grader.settings import Settings
from grader.store.engine.database import Database
from grader.store.engine.unusable import naming
from grader.store.upkeep.installation import note_origin

Result = TypeVar("Result")


def in_database(settings: Settings, change: Callable[[Session], Result]) -> Result:
    """Calls `change` in a transaction on a newly opened database, and returns its result."""
    return in_opened(settings, lambda _, session: change(session))


def in_opened(settings: Settings, change: Callable[[Database, Session], Result]) -> Result:
    """As `in_database`, for what also needs the database's locks. Raises NotReady where it is away or full."""
    with naming(settings.database):
        database = Database(settings.database)
        try:
            database.migrate()
            with database.write() as session:
                return change(database, session)
        finally:
            database.close()


def revoke_tokens(settings: Settings, user: str, course: str | None) -> int:
    """Revokes the tokens and sessions of a user. Returns how many were valid."""
    return in_database(settings, lambda session: revoke_all(session, user, course))


def sign_in_url(settings: Settings) -> str:
    """The address where the instructor signs in; good for one sign-in."""
    return in_database(settings, lambda session: make_sign_in_url(session, settings.origin))


def make_sign_in_url(session: Session, origin: str) -> str:
    """As `sign_in_url`, in a transaction that is under way."""
    return f"{origin}/signin?code={create_sign_in_code(session, 'instructor', Role.INSTRUCTOR)}"


def tell_addresses(settings: Settings, jail: Mapping[str, Any]) -> None:
    """Prints the addresses of the pages, and the state of the jail where there is one. The database keeps the origin
    for the links that commands print. A public server prints no link: its output is a log that others read."""

    def prepare(session: Session) -> str:
        note_origin(session, settings.origin)
        if settings.public_origin is not None:
            return f'{settings.origin}/instructor  (to sign in: grader invite --role instructor "YOUR NAME")'
        return f"{make_sign_in_url(session, settings.origin)}  (good for one sign-in)"

    page = in_database(settings, prepare)
    print(f"Student page:    {settings.origin}/")
    print(f"Instructor page: {page}", flush=True)
    if jail:
        print(f"Jail:            tier {jail['tier']}, {jail['self_test']}", flush=True)


def give_extension(settings: Settings, key: tuple[str | None, str, str], granted: Extension) -> None:
    """Gives (course, quiz, user) an extension. Raises NotFound if the course has no such quiz or member, and
    Unprocessable."""
    from grader.courses.answering import results  # it loads MuJoCo, which the other functions do not need
    from grader.library import PassedChecks, load

    course, quiz, user = key

    def give(database: Database, session: Session) -> None:
        learner = members.find_named(session, user, course or DEFAULT_COURSE)
        library = load(settings.courses.get(learner.course, settings.content), passed=PassedChecks(settings.cache))
        results.grant(database, library, session, learner, quiz, granted=granted, by=None)

    in_opened(settings, give)
