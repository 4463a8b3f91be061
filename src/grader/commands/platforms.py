"""`grader lti ...`: learning platforms for the operator of an installation."""

import asyncio
import json
from typing import Annotated, Any

import typer

from grader.commands.options import Data, Json, begin_transaction, find_link_origin, open_database, read_settings, say
from grader.errors import Unprocessable

lti = typer.Typer(help="Learning platforms: LTI 1.3.", no_args_is_help=True)


def require_lti() -> None:
    """Raises Unprocessable without the packages of the extra."""
    from grader.platforms.tool import MISSING, is_installed

    if not is_installed():
        raise Unprocessable(MISSING)


@lti.command()
def addresses(data: Data = None) -> None:
    """Print what to type into a platform: where it begins logins, posts launches and fetches keys."""
    from grader.platforms.tool import list_addresses as of

    with begin_transaction(data) as session:
        origin = find_link_origin(session, data)
    for name, url in of(origin).items():
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
    from grader.platforms.administration import read_registration

    registration = read_registration({
        "name": name, "issuer": issuer, "client_id": client_id, "login_url": login_url, "token_url": token_url,
        "keys_url": keys_url, "token_audience": token_audience, "origins": frame_origin,
    })  # fmt: skip
    with begin_transaction(data) as session:
        print(rules.add(session, None, registration, deployment).id)


@lti.command("list")
def list_(data: Data = None, as_json: Json = False) -> None:
    """List the platforms with their deployments, and the courses there with those that they are linked with."""
    from grader.platforms.administration import list_contexts, list_platforms

    with begin_transaction(data) as session:
        shown: dict[str, Any] = {"platforms": list_platforms(session), "contexts": list_contexts(session)}
    if as_json:
        print(json.dumps(shown, indent=2))
        return
    for platform in shown["platforms"]:
        name = platform["name"], platform["issuer"], platform["client_id"]
        print("\t".join((f"platform {platform['id']}", *name, describe_approval(platform))))
        for deployment in platform["deployments"]:
            print("\t".join((f"  deployment {deployment['deployment_id']}", describe_approval(deployment))))
    for context in shown["contexts"]:
        state = context["course"] or (f"asks for {context['wanted']}" if context["wanted"] else "not linked")
        print("\t".join((f"course {context['id']}", context["title"], context["platform"], state)))


def describe_approval(row: dict[str, Any]) -> str:
    """Says whether a platform or a deployment is approved."""
    return "approved" if row["approved"] else "waits for approval"


@lti.command()
def approve(
    platform: Annotated[int, typer.Argument(help="The number that `grader lti list` shows.")],
    deployment: Annotated[str | None, typer.Option(help="This one alone; all that wait if not given.")] = None,
    data: Data = None,
) -> None:
    """Approve a platform, and the deployments of it that wait."""
    from grader.courses.people import platforms as rules

    with begin_transaction(data) as session:
        print(rules.approve(session, None, platform, deployment).name)


@lti.command()
def remove(platform: int, data: Data = None) -> None:
    """Remove a platform with all that its launches told. Members and answers stay."""
    from grader.courses.people import platforms as rules

    with begin_transaction(data) as session:
        rules.remove(session, None, platform)
    say(f"Removed platform {platform}.")


@lti.command()
def link(
    context: Annotated[int, typer.Argument(help="The number of the course there, as `grader lti list` shows it.")],
    course: Annotated[str, typer.Option(help="The course here.")],
    data: Data = None,
) -> None:
    """Link a platform's course with a course here: who teaches there becomes an instructor here."""
    from grader.courses.people import platforms as rules

    with begin_transaction(data) as session:
        rules.link(session, None, context, course)


@lti.command()
def unlink(context: int, data: Data = None) -> None:
    """End the link of a platform's course. Members and answers stay."""
    from grader.courses.people import platforms as rules

    with begin_transaction(data) as session:
        rules.unlink(session, None, context)


@lti.command()
def rotate_keys(data: Data = None) -> None:
    """Sign with a new key from now on, and print its id. The old one stays published for a day."""
    from grader.platforms.keys import ToolKeys

    require_lti()
    with open_database(data) as database:
        print(ToolKeys(database).rotate())


@lti.command()
def register_link(data: Data = None) -> None:
    """Print a single-use address for a platform's dynamic registration. It is valid for two days."""
    from grader.platforms.administration import registration_link

    require_lti()
    with begin_transaction(data) as session:
        print(registration_link(session, find_link_origin(session, data)))


@lti.command()
def roster(context: int, data: Data = None) -> None:
    """Pull the members of a platform's course into the linked course, and print how many there are."""
    require_lti()
    from grader.platforms.administration import pull_roster
    from grader.service.app import build_tool

    with open_database(data) as database:
        tool = build_tool(read_settings(data=data), database)
        assert tool is not None  # it is installed
        pulled = asyncio.run(pull_roster(database, tool.authorized, None, context))
    print(f"{pulled.members} members, {pulled.removed} others whom an instructor had removed")
