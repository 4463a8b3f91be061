"""Commands for teachers: `grader extend | invite | pack | roster`."""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from grader.commands.options import (
    Course,
    Data,
    Json,
    begin_transaction,
    find_link_origin,
    open_database,
    read_settings,
    require_course,
    say,
    say_if_new,
)
from grader.errors import Unprocessable

if TYPE_CHECKING:
    from grader.courses.people.rosters.roster import Roster
    from grader.domain.policy import Extension

cli = typer.Typer()

roster = typer.Typer(help="The people of a course, from and to other systems.", no_args_is_help=True)
pack = typer.Typer(help="Exercises for other graders.", no_args_is_help=True)


@cli.command()
def extend(
    quiz: str,
    user: Annotated[str, typer.Option(help="The learner, by the name of their token.")],
    due: Annotated[str | None, typer.Option(help="A later due date, such as 2026-10-26T18:00+01:00.")] = None,
    until: Annotated[str | None, typer.Option(help="Late answers are taken until then.")] = None,
    attempts: Annotated[int, typer.Option(help="Further attempts at every question.")] = 0,
    *,
    course: Annotated[str | None, typer.Option()] = None,
    data: Data = None,
) -> None:
    """Give one learner an extension of a quiz; with no option but --user, take an earlier one back."""
    from grader.service.accounts import give_extension

    granted = parse_extension(due, until, attempts)
    give_extension(read_settings(data=data), (course, quiz, user), granted)
    print(granted.model_dump_json())


def parse_extension(due: str | None, until: str | None, attempts: int) -> "Extension":
    """Returns the extension that the options describe. Raises Unprocessable."""
    from pydantic import ValidationError

    from grader.domain.policy import Extension

    try:
        return Extension.model_validate({"due": due, "until": until, "attempts": attempts})
    except ValidationError as error:
        raise Unprocessable("; ".join(f"--{wrong['loc'][0]}: {wrong['msg']}" for wrong in error.errors())) from error


@cli.command()
def invite(
    names: list[str],
    course: Course = None,
    role: Annotated[str, typer.Option(help="student or instructor")] = "student",
    data: Data = None,
) -> None:
    """Print a single-use link for each name, in their order, one a line on stdout; the names go to stderr."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.invitations import invite as make

    with begin_transaction(data) as session:
        say_if_new(session, course or DEFAULT_COURSE)
        invitations = make(session, None, course, names, role)
        origin = find_link_origin(session, data)
    for invitation in invitations:
        say(f"{invitation.member.name}, until {invitation.expires_at:%Y-%m-%d %H:%M} UTC:")
        print(f"{origin}/signin?code={invitation.code}", flush=True)


@pack.callback()
def packing() -> None:
    """Exercises for other graders."""


@pack.command("gradescope")
def pack_for_gradescope(
    quiz: str,
    question: str,
    out: Annotated[
        Path | None, typer.Option(help="A zip file or a folder; QUIZ-QUESTION.zip here if not given.")
    ] = None,
    allow_t2: Annotated[
        bool, typer.Option("--allow-t2", help="Accept a container without user namespaces, as GRADER_ALLOW_T2 does.")
    ] = False,
) -> None:
    """Write the autograder of one exercise for Gradescope, and print its path."""
    from grader.library import load
    from grader.pack import pack_gradescope

    place = Path(f"{quiz}-{question}.zip") if out is None else out
    library = load(read_settings().content, quiz, question=question)
    print(pack_gradescope(library, quiz, question, place, allow_t2=allow_t2))


@roster.command("import")
def import_roster(
    file: Annotated[Path, typer.Argument(help="A CSV file, or a OneRoster zip file or folder.")],
    namespace: Annotated[str, typer.Option(help="The system whose ids the file has.")] = "roster",
    course: Course = None,
    data: Data = None,
    *,
    course_class: Annotated[
        str | None, typer.Option("--class", help="The classSourcedId, where OneRoster's files have several.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Change nothing.")] = False,
    as_json: Json = False,
) -> None:
    """Make the people on a roster members: all of them, or none if a row is faulty."""
    from grader.courses.people.identity import DEFAULT_COURSE, check_name
    from grader.courses.people.rosters.enrolment import enrol

    read = read_roster_file(file, namespace, course_class)
    with open_database(data) as database, database.write() as session:
        name = check_name("course", course or DEFAULT_COURSE)
        say_if_new(session, name)
        done = enrol(database, session, None, name, read, dry_run=dry_run)
    if as_json:
        print(json.dumps(asdict(done)))
        return
    would = "would be " if dry_run else ""
    left_out = f", {done.left_out} left out" if done.left_out else ""
    print(f"{done.created} {would}created, {done.changed} {would}changed, {done.unchanged} unchanged{left_out}")
    for change in done.roles:
        print(f"the role of {change.name} {would}changed: {change.before} -> {change.after}")
    for namesake in done.namesakes:
        print(f"no row finds the member {namesake.name} ({namesake.id}), who may be the person of this name twice")
    for reason in done.reasons:
        print(f"{reason.people} left out: {reason.why}")


def read_roster_file(file: Path, namespace: str, course_class: str | None) -> "Roster":
    """Returns the people on the roster. Raises OSError, Unprocessable, FaultyRows."""
    from grader.courses.people.rosters import oneroster, roster

    if file.is_dir():
        users, enrollments = (
            roster.decode(name, (file / name).read_bytes()) for name in (oneroster.USERS, oneroster.ENROLLMENTS)
        )
        return oneroster.read_files(users, enrollments, namespace, course_class)
    if file.suffix == ".zip":
        return oneroster.read_zip(file.read_bytes(), namespace, course_class)
    return roster.read_roster(roster.decode(file.name, file.read_bytes()), namespace, file.name)


@roster.command("export")
def export_roster(
    out: Annotated[Path | None, typer.Option(help="A file; for CSV, stdout if not given.")] = None,
    form: Annotated[Literal["csv", "oneroster"], typer.Option("--format", help="The form.")] = "csv",
    namespace: Annotated[str, typer.Option(help="The system whose ids OneRoster's files get.")] = "roster",
    course: Course = None,
    data: Data = None,
) -> None:
    """Write the members of a course as CSV, or as a OneRoster zip file."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.rosters import oneroster, roster
    from grader.courses.people.rosters.enrolment import list_roster, list_roster_with_ids

    name = course or DEFAULT_COURSE
    if form == "oneroster" and out is None:
        raise Unprocessable("Name the zip file with --out.")
    with open_database(data) as database, database.read() as session:
        require_course(session, name, data)
        if form == "csv":
            written = "".join(roster.write_roster(list_roster(session, name))).encode()
        else:
            written = oneroster.write_zip(list_roster_with_ids(session, name, namespace), name)
    if out is None:
        sys.stdout.buffer.write(written)
    else:
        out.write_bytes(written)
        print(out)
