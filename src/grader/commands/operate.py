"""Commands for the operator of an installation.

`grader backup | migrate | prune | erase | export | rotate-secret | deliveries | replay`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grader.errors import Unprocessable

if TYPE_CHECKING:
    from grader.settings import Settings
    from grader.store.engine.database import Database

operate = typer.Typer()

Data = Annotated[Path | None, typer.Option(help="Folder of the database.")]


def settings_in(data: Path | None) -> "Settings":
    """The settings from the environment, with another data folder if one is given."""
    from grader.settings import Settings

    return Settings() if data is None else Settings(data=data)


@contextmanager
def opened(data: Path | None, revision: str | None = None) -> Iterator["Database"]:
    """The database of the settings, brought to the newest revision or another one."""
    from grader.store.engine.database import Database

    database = Database(settings_in(data).database)
    try:
        database.migrate(revision)
        yield database
    finally:
        database.close()


@operate.command()
def backup(file: Path, data: Data = None) -> None:
    """Copy the SQLite database to a new file, also while the server is running."""
    from grader.store.upkeep.backup import back_up

    back_up(settings_in(data).database, file)
    print(file)


@operate.command()
def migrate(
    revision: Annotated[str | None, typer.Argument(help="The newest if not given, as `grader serve` does.")] = None,
    data: Data = None,
) -> None:
    """Bring the tables to a revision, forward or back. Stop servers and workers first."""
    with opened(data, revision) as database:
        print(database.revision)


@operate.command()
def prune(
    older_than: Annotated[int, typer.Option(min=1, help="Age of what is deleted, in days.")],
    data: Data = None,
) -> None:
    """Delete old idempotency keys, passed events, and sessions and invitations that have ended."""
    from grader.courses.people.sign_in import PRUNED
    from grader.store.tables import now
    from grader.store.upkeep import pruning

    before = now() - timedelta(days=older_than)
    with opened(data) as database:
        print(f"{pruning.idempotency_keys(database, before)} idempotency keys")
        print(f"{pruning.events(database, before)} events")
        print(f"{pruning.deliveries(database, before)} webhook deliveries")
        print(f"{pruning.ended_credentials(database, PRUNED, before)} sessions and invitations")


@operate.command()
def erase(
    user: Annotated[str | None, typer.Option(help="A learner with a name that an instructor or operator gave.")] = None,
    member_id: Annotated[str | None, typer.Option("--id", help="Any learner, by the id of the member.")] = None,
    course: Annotated[str | None, typer.Option(help="Name of the course.")] = None,
    data: Data = None,
) -> None:
    """Erase a learner's name, answers, sessions and tokens for good. Points stay, under the name that is printed."""
    from grader.courses.people.erasure import erase_learner

    if (user is None) == (member_id is None):
        raise Unprocessable("Give either --user or --id.")
    with opened(data) as database:
        with database.write() as session:
            name = erase_learner(database, session, user=user, member_id=member_id, course=course)
        database.empty_log()
    print(name)


@operate.command()
def export(
    user: Annotated[str | None, typer.Option(help="A learner with a name that an instructor or operator gave.")] = None,
    member_id: Annotated[str | None, typer.Option("--id", help="Any learner, by the id of the member.")] = None,
    course: Annotated[str | None, typer.Option(help="Name of the course.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="A new zip file, or a new folder; learner-ID.zip here if not given.")
    ] = None,
    data: Data = None,
) -> None:
    """Write all that is held of one learner, as JSON and scripts, to a zip file or a folder, and print its path."""
    from grader.courses.people.export import export_learner, name_of, write_export

    if (user is None) == (member_id is None):
        raise Unprocessable("Give either --user or --id.")
    with opened(data) as database, database.write() as session:
        files = export_learner(session, user=user, member_id=member_id, course=course)
        place = Path(name_of(files)) if out is None else out
        write_export(files, place)
    print(place)


@operate.command()
def rotate_secret(data: Data = None) -> None:
    """Replace the key of the hidden cases. Restart servers afterwards: they go on with the old one until then."""
    from grader.courses.people.audit import Action, record
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.store.upkeep.installation import rotate_hidden_case_secret

    with opened(data) as database, database.write() as session:
        rotate_hidden_case_secret(session)
        record(session, None, DEFAULT_COURSE, Action.HIDDEN_CASES_ROTATED)


@operate.command()
def deliveries(
    state: Annotated[str, typer.Option(help="waiting, held, sent or dead.")] = "dead",
    course: Annotated[str | None, typer.Option(help="Name of the course; all courses if not given.")] = None,
    data: Data = None,
) -> None:
    """List webhooks and scores, by default those that could not be delivered: one a line, with the reason."""
    from grader.store import outbox

    if state not in outbox.STATES:
        raise Unprocessable(f"--state is one of {', '.join(outbox.STATES)}.")
    with opened(data) as database, database.read() as session:
        for row, kind in outbox.every(session, state, course):
            place = "/".join(filter(None, (row.quiz, row.question)))
            print("\t".join((str(row.id), kind, row.course, row.learner, place, str(row.attempts), row.error or "")))


@operate.command()
def replay(delivery: int, data: Data = None) -> None:
    """Deliver a dead letter once more. A score then replaces what a person has entered at the platform."""
    from grader.courses.sending.outbox import replay as again

    with opened(data) as database, database.write() as session:
        again(session, None, delivery, None)
