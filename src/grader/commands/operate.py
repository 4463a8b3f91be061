"""Commands for the operator of an installation.

`grader backup | migrate | prune | erase | export | rotate-secret | deliveries | replay`.
"""

import sys
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path
from typing import Annotated

import typer

from grader.commands.options import (
    Course,
    Data,
    begin_transaction,
    connect_database,
    open_database,
    read_settings,
    require_one,
    say,
)
from grader.errors import Conflict, Unprocessable

cli = typer.Typer()

User = Annotated[
    str | None,
    typer.Option(help="A learner by a name that an instructor or operator gave, or by NAMESPACE:ID of another system."),
]

WHY_MAX = 200
"""Characters of the reason in a list of deliveries."""


@cli.command()
def backup(file: Path, data: Data = None) -> None:
    """Copy the SQLite database to a new file, also while the server is running."""
    from grader.store.upkeep.backup import back_up

    back_up(read_settings(data=data).database, file)
    print(file)


@cli.command()
def migrate(
    revision: Annotated[str | None, typer.Argument(help="The newest if not given, as `grader serve` does.")] = None,
    data: Data = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Bring tables back without asking, on PostgreSQL also beside servers.")
    ] = False,
) -> None:
    """Bring the tables to a revision, forward or back. Stop servers and workers first."""
    from grader.metrics import locked

    folder = read_settings(data=data).sqlite_folder
    with ExitStack() as held:
        if folder is not None and folder.is_dir():
            try:
                held.enter_context(locked(folder))
            except BlockingIOError:
                raise Conflict(f"A server works on {folder}: stop it first.") from None
        database = held.enter_context(connect_database(data))
        before = database.revision
        if revision is not None and before is not None and revision < before:
            lost = f"Going back from revision {before} to {revision} loses for good what only later versions knew."
            if sys.stdin.isatty() and not yes:
                typer.confirm(f"{lost} Go on?", abort=True)
            else:
                say(lost)
        database.migrate(revision, beside_others=yes)
        print(database.revision)


@cli.command()
def prune(
    older_than: Annotated[int, typer.Option(min=1, help="Age of what is deleted, in days.")], data: Data = None
) -> None:
    """Delete old idempotency keys, passed events, and sessions and invitations that have ended."""
    from grader.courses.people.sign_in import PRUNED
    from grader.store.tables import now
    from grader.store.upkeep import pruning

    before = now() - timedelta(days=older_than)
    with open_database(data) as database:
        print(f"{pruning.idempotency_keys(database, before)} idempotency keys")
        print(f"{pruning.prune_events(database, before)} events")
        print(f"{pruning.prune_deliveries(database, before)} webhook deliveries")
        print(f"{pruning.ended_credentials(database, PRUNED, before)} sessions and invitations")


@cli.command()
def erase(
    user: User = None,
    member_id: Annotated[str | None, typer.Option("--id", help="Any learner, by the id of the member.")] = None,
    course: Course = None,
    data: Data = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask; a script is not asked either.")] = False,
) -> None:
    """Erase a learner's name, answers, sessions and tokens for good. Points stay, under the name that is printed."""
    from grader.courses.people.erasure import erase_learner, find_member

    require_one(user, member_id)
    with open_database(data) as database:
        if sys.stdin.isatty() and not yes:
            with database.read() as session:
                member = find_member(session, course, user, member_id)
            typer.confirm(f"Erase {member.name}, {member.id}, and all answers for good?", abort=True)
        with database.write() as session:
            name = erase_learner(database, session, user=user, member_id=member_id, course=course)
        database.empty_log()
    print(name)


@cli.command()
def export(
    user: User = None,
    member_id: Annotated[str | None, typer.Option("--id", help="Any learner, by the id of the member.")] = None,
    course: Course = None,
    out: Annotated[
        Path | None, typer.Option(help="A new zip file, or a new folder; learner-ID.zip here if not given.")
    ] = None,
    data: Data = None,
) -> None:
    """Write all that is held of one learner, as JSON and scripts, to a zip file or a folder, and print its path."""
    from grader.courses.people.export import export_learner, name_file, write_export

    require_one(user, member_id)
    with begin_transaction(data) as session:
        files = export_learner(session, user=user, member_id=member_id, course=course)
        place = Path(name_file(files)) if out is None else out
        write_export(files, place)
    print(place)


@cli.command()
def rotate_secret(data: Data = None) -> None:
    """Replace the key of the hidden cases. Restart servers afterwards: they go on with the old one until then."""
    from grader.courses.people.audit import Action, record
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.store.upkeep.installation import rotate_hidden_case_secret

    with begin_transaction(data) as session:
        rotate_hidden_case_secret(session)
        record(session, None, DEFAULT_COURSE, Action.HIDDEN_CASES_ROTATED)


@cli.command()
def deliveries(
    state: Annotated[str, typer.Option(help="waiting, held, sent or dead.")] = "dead",
    course: Annotated[str | None, typer.Option(help="Name of the course; all courses if not given.")] = None,
    data: Data = None,
) -> None:
    """List webhooks and scores, by default those that could not be delivered: one a line, with the reason and where it
    goes."""
    from grader.courses.sending.outbox import name_receiver
    from grader.store import outbox

    if state not in outbox.STATES:
        raise Unprocessable(f"--state is one of {', '.join(outbox.STATES)}.")
    with open_database(data) as database, database.read() as session:
        for row, to in outbox.list_all(session, state, course):
            place = "/".join(filter(None, (row.quiz, row.question)))
            told = (put_on_a_line(row.error or ""), name_receiver(session, row, to))
            print("\t".join((str(row.id), to.kind, row.course, row.learner, place, str(row.attempts), *told)))


def put_on_a_line(text: str) -> str:
    """Returns a text without line ends, cut to `WHY_MAX`: another server's answer may be a page of HTML."""
    line = " ".join("".join(char if char.isprintable() else " " for char in text).split())
    return line if len(line) <= WHY_MAX else f"{line[: WHY_MAX - 1]}…"


@cli.command()
def replay(delivery: int, data: Data = None) -> None:
    """Deliver a dead letter once more. A score then replaces what a person has entered at the platform."""
    from grader.courses.sending.outbox import replay as again

    with begin_transaction(data) as session:
        again(session, None, delivery, None)
