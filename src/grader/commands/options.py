"""Options that several commands share, the settings and the database that they name, and lines on stderr."""

from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from grader.errors import NotFound, Unprocessable

if TYPE_CHECKING:
    from sqlalchemy.orm import Session

    from grader.settings import Settings
    from grader.store.engine.database import Database

CORRECT, OTHER_VERDICT, USAGE, FAULT = range(4)
"""Exit codes. A fault of the grader is no verdict."""

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]
Course = Annotated[str | None, typer.Option(help="Name of the course.")]
Data = Annotated[Path | None, typer.Option(help="Folder of the database.")]

err = Console(stderr=True)


def say(message: str) -> None:
    """Prints a line of progress on stderr."""
    err.print(message, style="dim", markup=False, highlight=False, soft_wrap=True)


def complain(*lines: str) -> None:
    """Prints errors on stderr."""
    for line in lines:
        err.print(line, style="red", markup=False, soft_wrap=True)


def read_settings(**overrides: Any) -> "Settings":
    """Reads the settings from the environment; options of the command line override them."""
    from grader.settings import Settings

    return Settings(**{name: value for name, value in overrides.items() if value is not None})


@contextmanager
def connect_database(data: Path | None) -> Iterator["Database"]:
    """Opens the database of the settings with the tables that it has. Says on stderr if it makes a new one. Raises
    NotReady where the database is away or full."""
    from grader.store.engine.database import Database
    from grader.store.engine.unusable import naming

    settings = read_settings(data=data)
    file = settings.data.absolute() / "grader.db"
    if settings.database_url is None and not file.exists():
        say(f"{file} is a new database: a server with another folder does not see it. Name its folder with --data.")
    with naming(settings.database):
        database = Database(settings.database)
        try:
            yield database
        finally:
            database.close()


@contextmanager
def open_database(data: Path | None) -> Iterator["Database"]:
    """As `connect_database`, at the newest revision."""
    with connect_database(data) as database:
        before = database.revision
        database.migrate()
        if before not in (None, after := database.revision):
            say(f"The tables were brought from revision {before} to {after}, as `grader serve` would.")
        yield database


@contextmanager
def begin_transaction(data: Path | None) -> Iterator["Session"]:
    """Opens the database of the settings for a transaction that writes."""
    with open_database(data) as database, database.write() as session:
        yield session


def require_course(session: "Session", course: str, data: Path | None) -> None:
    """Raises NotFound for a course that does not exist, and names those that do: most likely it is mistyped."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.platforms import course_exists
    from grader.store.people import list_courses

    named = read_settings(data=data).courses
    if not course_exists(session, course, named):
        known = sorted({DEFAULT_COURSE, *named, *list_courses(session)})
        raise NotFound(f"There is no course {course!r}; the courses are {', '.join(known)}.")


def say_if_new(session: "Session", course: str) -> None:
    """Says on stderr that a course has no members yet, and which one with a similar name has: it may be mistyped."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.store.people import list_courses

    known = {DEFAULT_COURSE, *list_courses(session)}
    if course not in known:
        near = get_close_matches(course, known, n=1)
        say(f"{course} is a new course{f': did you mean {near[0]}?' if near else '.'}")


def find_link_origin(session: "Session", data: Path | None) -> str:
    """Returns the origin of links that a command prints: the setting, else that of the server that started last. Warns
    on stderr where neither is known."""
    from grader.store.upkeep.installation import find_origin

    settings = read_settings(data=data)
    known = settings.origin if settings.public_origin is not None else find_origin(session)
    if known is None:
        say(
            f"No server has started on this database yet: the link names {settings.origin}. Start `grader serve` first,"
            " or set GRADER_PUBLIC_ORIGIN."
        )
    return known or settings.origin


def require_one(user: str | None, member_id: str | None) -> None:
    """Raises Unprocessable unless one of the two options is given."""
    if (user is None) == (member_id is None):
        raise Unprocessable("Give either --user or --id.")
