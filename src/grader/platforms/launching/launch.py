"""Reads what a verified launch says: who comes, from which course, by which link, and what the platform offers. Source:
LTI 1.3 core, section 5; LTI Advantage: AGS 2.0, NRPS 2.0, Deep Linking 2.0."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs, urlsplit

from grader.courses.people.identity import visible_part
from grader.courses.people.platforms import NAMELESS
from grader.domain.platform import Platform
from grader.errors import Unauthorized
from grader.platforms.launching import claims as words
from grader.platforms.launching.addresses import is_at, is_of_platform
from grader.store.platforms import ID
from grader.store.tables import NAME

ROLES_MAX = 50
NAME_CLAIMS = ("name", "given_name", "family_name", "preferred_username")
QUIZ_CHARACTERS_MAX = 64


@dataclass(frozen=True)
class Gradebook:
    """The Assignment and Grade Services of a launch. An address is empty where the platform gives none."""

    line_item_url: str = ""
    line_items_url: str = ""
    scopes: tuple[str, ...] = ()


@dataclass(frozen=True)
class ContentSelection:
    """What a platform asks for when its instructor chooses content here (Deep Linking)."""

    return_url: str
    data: str | None
    takes_many: bool
    takes_line_items: bool


@dataclass(frozen=True)
class Launch:
    """A verified launch. `subject` is None where the platform does not say who comes. `link_id` is empty, and
    `selection` given, in a Deep Linking request. `reviewed` is the user whose work a Submission Review asks for; its
    `link_id` may be empty, too. `quiz` and `question` are what the link leads to, if it says so
    itself."""

    platform: Platform
    deployment_id: str
    subject: str | None
    name: str
    teaches: bool
    context_id: str
    context_title: str
    link_id: str
    quiz: str | None
    question: str | None
    gradebook: Gradebook
    members_url: str
    selection: ContentSelection | None
    reviewed: str | None


def read_launch(claims: Mapping[str, Any], platform: Platform, origin: str) -> Launch:
    """Returns the launch that verified claims describe. `origin` is where this tool is reached. Raises Unauthorized."""
    if claims.get(f"{words.CLAIM}version") != words.VERSION:
        raise Unauthorized(f"The launch is not of LTI {words.VERSION}.")
    message = claims.get(f"{words.CLAIM}message_type")
    if message not in (words.RESOURCE_LINK, words.DEEP_LINKING, words.SUBMISSION_REVIEW):
        raise Unauthorized("This kind of launch is not offered here.")
    target = claims.get(f"{words.CLAIM}target_link_uri")
    is_selection = message == words.DEEP_LINKING
    if not (is_selection and target is None) and not is_at(origin, target):
        raise Unauthorized("The launch leads to an address that is not this service's.")
    context = read_part(claims, f"{words.CLAIM}context")
    quiz, question = read_chosen(read_part(claims, f"{words.CLAIM}custom"), str(target or ""))
    return Launch(
        platform=platform, deployment_id=read_identifier(claims, f"{words.CLAIM}deployment_id"),
        subject=read_identifier(claims, "sub") if "sub" in claims else None, name=read_name(claims),
        teaches=words.teaches(read_roles(claims)), context_id=read_identifier(context, "id") if context else "",
        context_title=read_label(context.get("title")) or read_label(context.get("label")),
        link_id="" if is_selection else read_link(claims, is_required=message == words.RESOURCE_LINK), quiz=quiz,
        question=question, reviewed=read_reviewed(claims) if message == words.SUBMISSION_REVIEW else None,
        gradebook=read_gradebook(read_part(claims, words.AGS_CLAIM)),
        members_url=read_address(read_part(claims, words.NRPS_CLAIM).get("context_memberships_url")),
        selection=read_selection(claims) if is_selection else None,
    )  # fmt: skip


def read_link(claims: Mapping[str, Any], *, is_required: bool) -> str:
    """Returns the id of the platform's link, empty for none where it is not required. Raises Unauthorized."""
    link = read_part(claims, f"{words.CLAIM}resource_link")
    if not link and not is_required:
        return ""
    if "id" not in link:
        raise Unauthorized(
            "The launch does not say which link was opened: it has no resource_link with an id. Open the grader by a "
            "link of the course, such as an assignment, and not from a menu of the platform."
        )
    return read_identifier(link, "id")


def read_reviewed(claims: Mapping[str, Any]) -> str:
    """Returns the user whose work a Submission Review asks for. Raises Unauthorized. Source: LTI Submission Review 1.0,
    section 3.2."""
    return read_identifier(read_part(claims, f"{words.CLAIM}for_user"), "user_id")


def read_part(claims: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Returns a claim that is an object; empty if it is missing. Raises Unauthorized for anything else."""
    part = claims.get(name)
    if part is not None and not isinstance(part, dict):
        raise Unauthorized(f"The launch's claim {name} is no object.")
    return part or {}


def read_identifier(claims: Mapping[str, Any], name: str) -> str:
    """Returns an identifier of the platform: 1 to 255 printable characters. Raises Unauthorized."""
    identifier = claims.get(name)
    if not isinstance(identifier, str) or not 1 <= len(identifier) <= ID or not identifier.isprintable():
        short = name.removeprefix(words.CLAIM)
        raise Unauthorized(f"The launch does not say its {short}, as a text of 1 to {ID} characters.")
    return identifier


def read_label(text: object) -> str:
    """Returns a text as it may be shown: printable, and no longer than a name. Empty for anything else."""
    return visible_part(text)[:NAME].strip() if isinstance(text, str) else ""


def read_name(claims: Mapping[str, Any]) -> str:
    """Returns the user's name as far as the platform tells it."""
    whole, given, family, user = (read_label(claims.get(claim)) for claim in NAME_CLAIMS)
    return whole or f"{given} {family}".strip()[:NAME] or user or NAMELESS


def read_roles(claims: Mapping[str, Any]) -> list[str]:
    """Returns the roles; the list may be empty, but not missing. Raises Unauthorized."""
    roles = claims.get(f"{words.CLAIM}roles")
    if not isinstance(roles, list) or not all(isinstance(role, str) for role in roles[:ROLES_MAX]):
        raise Unauthorized("The launch does not list the user's roles.")
    return roles[:ROLES_MAX]


def read_chosen(custom: Mapping[str, Any], target: str) -> tuple[str | None, str | None]:
    """Quiz and question of a link: its custom parameters, else the query of its address."""
    query = {name: values[0] for name, values in parse_qs(urlsplit(target).query).items()}
    source = custom if read_short_id(custom.get("quiz")) else query
    quiz = read_short_id(source.get("quiz"))
    return quiz, read_short_id(source.get("question")) if quiz else None


def read_short_id(text: object) -> str | None:
    """Returns the id of a quiz or question; None for what cannot be one."""
    is_id = isinstance(text, str) and 1 <= len(text) <= QUIZ_CHARACTERS_MAX and text.isprintable()
    return str(text) if is_id else None


def read_address(url: object) -> str:
    """Returns an address that requests may be sent to; empty for anything else."""
    return str(url) if is_of_platform(url) else ""


def read_gradebook(claim: Mapping[str, Any]) -> Gradebook:
    """Returns the services that the launch grants."""
    listed = claim.get("scope")
    granted = listed if isinstance(listed, list) else []
    scopes = tuple(scope for scope in words.SCOPES if scope in granted)
    return Gradebook(read_address(claim.get("lineitem")), read_address(claim.get("lineitems")), scopes)


def read_selection(claims: Mapping[str, Any]) -> ContentSelection:
    """The settings of a Deep Linking request. Raises Unauthorized if nothing chosen here could be given back."""
    settings = read_part(claims, f"{words.DEEP_LINKING_CLAIM}deep_linking_settings")
    return_url, data = read_address(settings.get("deep_link_return_url")), settings.get("data")
    if not return_url:
        raise Unauthorized("The platform does not say where the choice goes to.")
    types = settings.get("accept_types")
    if not isinstance(types, list) or "ltiResourceLink" not in types:
        raise Unauthorized("The platform takes no links of this kind.")
    many, items = settings.get("accept_multiple"), settings.get("accept_lineitem", True)
    return ContentSelection(return_url, data if isinstance(data, str) else None, many is not False, items is not False)
