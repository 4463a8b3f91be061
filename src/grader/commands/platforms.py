"""`grader lti ...`: learning platforms for the operator of an installation."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grader.commands.operate import opened, settings_in
from grader.errors import Unprocessable

if TYPE_CHECKING:
    from sqlalchemy.orm import Session

lti = typer.Typer(help="Learning platforms: LTI 1.3.", no_args_is_help=True)

Data = Annotated[Path | None, typer.Option(help="Folder of the database.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]


@contextmanager
def session_in(data: Path | None) -> Iterator["Session"]:
    """A transaction on the database of the settings."""
    with opened(data) as database, database.write() as session:
        yield session


def require_installed() -> None:
    """Raises Unprocessable without the packages of the extra."""
    from grader.platforms.tool import MISSING, is_installed

    if not is_installed():
        raise Unprocessable(MISSING)


@lti.command()
def addresses(data: Data = None) -> None:
    """Print what to type into a platform: where it begins logins, posts launches and fetches keys."""
    from grader.platforms.tool import addresses as of

    for name, url in of(settings_in(data).origin).items():
        print(f"{name}\t{url}")


@lti.command()
def add(
    issuer: Annotated[str, typer.Option(help="The platform's id, mostly its address.")],
    client_id: Annotated[str, typer.Option(help="The id that the platform gave this tool.")],
    login_url: Annotated[str, typer.Option(help="Authentication request URL.")],
    token_url: Annotated[str, typer.Option(help="Access token URL.")],
    keys_url: Annotated[str, typer.Option(help="Public keyset URL.")],
    *,
    name: Annotated[str, typer.Option(help="What to call it; the issuer if not given.")] = "",
    token_audience: Annotated[str, typer.Option(help="The audience of token requests, if not their URL.")] = "",
    deployment: Annotated[str | None, typer.Option(help="The deployment id, if it is known.")] = None,
    frame_origin: Annotated[
        list[str] | None,
        typer.Option(
            help="https://host that shows the grader in a frame; repeat it. Of issuer and login if not given."
        ),
    ] = None,
    data: Data = None,
) -> None:
    """Register a platform, which then waits for `grader lti approve`, and print its number."""
    from grader.courses.people import platforms as rules
    from grader.platforms.administration import registration_of

    given = registration_of({
        "name": name, "issuer": issuer, "client_id": client_id, "login_url": login_url, "token_url": token_url,
        "keys_url": keys_url, "token_audience": token_audience, "origins": frame_origin,
    })  # fmt: skip
    with session_in(data) as session:
        print(rules.add(session, None, given, deployment).id)


@lti.command("list")
def list_(data: Data = None, as_json: Json = False) -> None:
    """List the platforms with their deployments, and the courses there with those that they are linked with."""
    from grader.platforms.administration import contexts_of, platforms_of

    with session_in(data) as session:
        shown: dict[str, Any] = {"platforms": platforms_of(session), "contexts": contexts_of(session)}
    if as_json:
        print(json.dumps(shown, indent=2))
        return
    for one in shown["platforms"]:
        waits = "approved" if one["approved"] else "waits for approval"
        print("\t".join((f"platform {one['id']}", one["name"], one["issuer"], one["client_id"], waits)))
        for deployment in one["deployments"]:
            waits = "approved" if deployment["approved"] else "waits for approval"
            print("\t".join((f"  deployment {deployment['deployment_id']}", waits)))
    for one in shown["contexts"]:
        state = one["course"] or (f"asks for {one['wanted']}" if one["wanted"] else "not linked")
        print("\t".join((f"course {one['id']}", one["title"], one["platform"], state)))


@lti.command()
def approve(
    platform: Annotated[int, typer.Argument(help="The number that `grader lti list` shows.")],
    deployment: Annotated[str | None, typer.Option(help="This one alone; all that wait if not given.")] = None,
    data: Data = None,
) -> None:
    """Approve a platform, and the deployments of it that wait."""
    from grader.courses.people import platforms as rules

    with session_in(data) as session:
        print(rules.approve(session, None, platform, deployment).name)


@lti.command()
def remove(platform: int, data: Data = None) -> None:
    """Remove a platform with all that its launches told. Members and answers stay."""
    from grader.courses.people import platforms as rules

    with session_in(data) as session:
        rules.remove(session, None, platform)


@lti.command()
def link(
    context: Annotated[int, typer.Argument(help="The number of the course there, as `grader lti list` shows it.")],
    course: Annotated[str, typer.Option(help="The course here.")],
    data: Data = None,
) -> None:
    """Link a platform's course with a course here: who teaches there becomes an instructor here."""
    from grader.courses.people import platforms as rules

    with session_in(data) as session:
        rules.link(session, None, context, course)


@lti.command()
def unlink(context: int, data: Data = None) -> None:
    """End the link of a platform's course. Members and answers stay."""
    from grader.courses.people import platforms as rules

    with session_in(data) as session:
        rules.unlink(session, None, context)


@lti.command()
def rotate_keys(data: Data = None) -> None:
    """Sign with a new key from now on, and print its id. The old one stays published for a day."""
    from grader.platforms.keys import ToolKeys

    require_installed()
    with opened(data) as database:
        print(ToolKeys(database).rotate())


@lti.command()
def register_link(data: Data = None) -> None:
    """Print a single-use address for a platform's dynamic registration. It is valid for two days."""
    from grader.platforms.administration import registration_link

    require_installed()
    with session_in(data) as session:
        print(registration_link(session, settings_in(data).origin))


@lti.command()
def roster(context: int, data: Data = None) -> None:
    """Pull the members of a platform's course into the linked course, and print how many there are."""
    require_installed()
    from grader.platforms.administration import pull_roster
    from grader.service.app import tool_of

    with opened(data) as database:
        tool = tool_of(settings_in(data), database)
        assert tool is not None  # it is installed
        pulled = asyncio.run(pull_roster(database, tool.authorized, None, context))
    print(f"{pulled.members} members, {pulled.removed} others whom an instructor had removed")
