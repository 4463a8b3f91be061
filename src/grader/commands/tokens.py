"""Bearer tokens for the operator: `grader token`."""

import json
import sys
from datetime import timedelta
from typing import Annotated

import typer

from grader.commands.options import (
    USAGE,
    Course,
    Data,
    Json,
    begin_transaction,
    require_course,
    require_one,
    say,
    say_if_new,
)
from grader.errors import Unprocessable

token = typer.Typer(help="Bearer tokens.", no_args_is_help=True)


@token.command("create")
def create(
    user: Annotated[str, typer.Option()],
    role: Annotated[str, typer.Option(help="student, instructor or service")],
    course: Course = None,
    data: Data = None,
    *,
    scope: Annotated[
        list[str] | None, typer.Option(help="What the token is restricted to; repeat it. All of the role if not given.")
    ] = None,
    expires: Annotated[str | None, typer.Option(help="Lifetime, as 12h, 30d or 26w. Unlimited if not given.")] = None,
) -> None:
    """Print a new bearer token, and nothing else, on stdout; stderr says if the user is new in the course."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.members import find_meant
    from grader.courses.people.tokens import create_token

    lifetime = None if expires is None else parse_lifetime(expires)
    with begin_transaction(data) as session:
        say_if_new(session, course or DEFAULT_COURSE)
        is_new = find_meant(session, user, course or DEFAULT_COURSE) is None
        text = create_token(session, user, role, course, scopes=scope or None, lifetime=lifetime)
    if is_new:
        say(f"{user} is a new {role} of the course {course or DEFAULT_COURSE}.")
    print(text)


def parse_lifetime(text: str) -> timedelta:
    """Reads a duration such as `12h`, `30d` or `26w`. Raises Unprocessable."""
    units = {"h": timedelta(hours=1), "d": timedelta(days=1), "w": timedelta(weeks=1)}
    number, unit = text[:-1], text[-1:]
    if not (number.isascii() and number.isdecimal() and 0 < int(number[:6]) < 100_000 and unit in units):
        raise Unprocessable(f"A lifetime is a whole number and h, d or w, as in 30d; {text!r} is not one.")
    return int(number) * units[unit]


@token.command("list")
def list_(course: Course = None, data: Data = None, as_json: Json = False) -> None:
    """List the valid tokens of a course, one a line: id, user, role, scopes, expiry and last use."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.tokens import describe_credential, list_tokens

    with begin_transaction(data) as session:
        require_course(session, course or DEFAULT_COURSE, data)
        rows = [describe_credential(valid) for valid in list_tokens(session, course or DEFAULT_COURSE)]
    if as_json:
        print(json.dumps(rows, indent=2, default=str))
        return
    for row in rows:
        times = (f"{row[key]:%Y-%m-%dT%H:%MZ}" if row[key] else "never" for key in ("expires_at", "last_used_at"))
        scopes = "all" if row["scopes"] is None else ",".join(row["scopes"])
        print("\t".join((row["id"], row["name"], row["role"], scopes, *times)))


@token.command("revoke")
def revoke_(
    user: Annotated[str | None, typer.Option(help="Ends every token, session and link of this user.")] = None,
    token_id: Annotated[str | None, typer.Option("--id", help="Ends this one token, by its id.")] = None,
    course: Course = None,
    data: Data = None,
) -> None:
    """Revoke every token and browser session of a user, or one token, and print how many there were."""
    from grader.courses.people.identity import DEFAULT_COURSE
    from grader.courses.people.tokens import revoke, revoke_all

    require_one(user, token_id)
    with begin_transaction(data) as session:
        if token_id is not None:
            revoke(session, token_id, course or DEFAULT_COURSE)
            ended = 1
        else:
            ended = revoke_all(session, user or "", course)
    print(f"{ended} revoked")
    sys.exit(0 if ended else USAGE)
