"""Dynamic Registration: a platform hands over its configuration, and gets this tool's. Source: LTI Dynamic Registration
1.0; OpenID Connect Dynamic Client Registration 1.0."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from grader.courses.people.platforms import Registration
from grader.errors import Unprocessable
from grader.platforms.launching import claims as words
from grader.platforms.launching.addresses import is_of_platform, read_origin
from grader.platforms.launching.fetching import Requester
from grader.platforms.launching.launch import read_label
from grader.platforms.launching.login import keys_url, launch_url, login_url
from grader.platforms.sending.failures import Oversized

PURPOSE = "lti-registration"
LIFETIME = timedelta(days=2)
TOKEN_CHARACTERS_MAX = 8000
NAME = "MuJoCo grader"
DESCRIPTION = "Quizzes and exercises with MuJoCo, graded by simulation."
PLATFORM = "https://purl.imsglobal.org/spec/lti-platform-configuration"
TOOL = "https://purl.imsglobal.org/spec/lti-tool-configuration"
CREATED = (200, 201)
UNUSABLE = "The address of the platform's configuration, openid_configuration, cannot be used."
NO_HEADERS: Mapping[str, str] = {}


class Step(NamedTuple):
    """One of the two requests of a registration: what it asks for, and what the platform answers."""

    asked: str
    answer: str


CONFIGURATION = Step("to give its configuration", "configuration")
REGISTRATION = Step("the registration", "answer to the registration")


@dataclass(frozen=True)
class Offer:
    """What a platform's configuration says: its registration without a client id, and where this tool registers; with
    the token that the platform gave for that."""

    registration: Registration
    endpoint: str
    token: str


@dataclass(frozen=True)
class RegistrationReply:
    """What a platform answered: its registration, and its first deployment if it named one."""

    registration: Registration
    deployment_id: str | None


def tool_configuration(origin: str) -> dict[str, Any]:
    """Says what this tool tells platforms of itself; learners' addresses are not asked for."""
    launch = launch_url(origin)
    return {
        "application_type": "web",
        "response_types": ["id_token"],
        "grant_types": ["implicit", "client_credentials"],
        "initiate_login_uri": login_url(origin),
        "redirect_uris": [launch],
        "client_name": NAME,
        "jwks_uri": keys_url(origin),
        "logo_uri": f"{origin}/static/icon.svg",
        "token_endpoint_auth_method": "private_key_jwt",
        "scope": " ".join(words.SCOPES),
        TOOL: {
            "domain": urlsplit(origin).netloc,
            "description": DESCRIPTION,
            "target_link_uri": launch,
            "claims": ["iss", "sub", "name", "given_name", "family_name"],
            "messages": [
                {"type": words.RESOURCE_LINK, "target_link_uri": launch, "label": NAME},
                {"type": words.DEEP_LINKING, "target_link_uri": launch, "label": "Choose a quiz or an exercise"},
                {"type": words.SUBMISSION_REVIEW, "target_link_uri": launch, "label": "Answers and verdicts"},
            ],
        },
    }


async def fetch_offer(requester: Requester, configuration_url: str, token: str) -> Offer:
    """Fetches a platform's configuration; nothing is registered yet. Raises Unprocessable."""
    if not is_of_platform(configuration_url):
        raise Unprocessable(UNUSABLE)
    if len(token) > TOKEN_CHARACTERS_MAX or not token.isprintable():
        raise Unprocessable("The platform's registration_token cannot be used.")
    configuration = await exchange(requester, CONFIGURATION, "GET", configuration_url)
    registration = read_configuration(configuration, configuration_url)
    endpoint = configuration.get("registration_endpoint")
    if not is_of_platform(endpoint):
        raise Unprocessable("The platform's configuration has no registration_endpoint.")
    return Offer(registration, str(endpoint), token)


async def register(requester: Requester, offer: Offer, origin: str) -> RegistrationReply:
    """Registers this tool at a platform. Raises Unprocessable."""
    headers = {"Content-Type": "application/json"}
    headers |= {"Authorization": f"Bearer {offer.token}"} if offer.token else {}
    body = json.dumps(tool_configuration(origin)).encode()
    answer = await exchange(requester, REGISTRATION, "POST", offer.endpoint, headers, body=body)
    client_id, tool = read_id(answer.get("client_id")), answer.get(TOOL)
    if client_id is None:
        raise Unprocessable("The platform gave no client_id.")
    deployment = read_id(tool.get("deployment_id")) if isinstance(tool, dict) else None
    known = Registration(**{**vars(offer.registration), "client_id": client_id})
    return RegistrationReply(known, deployment)


def read_id(value: object) -> str | None:
    """Returns an id that a platform gave, a number as its decimal text; None for anything else."""
    is_id = isinstance(value, str | int) and not isinstance(value, bool)
    return str(value) if is_id else None


def read_configuration(configuration: Mapping[str, Any], url: str) -> Registration:
    """Says what a platform's configuration says; its client id is not known yet. Raises Unprocessable."""
    issuer = configuration.get("issuer")
    if not isinstance(issuer, str) or urlsplit(issuer).hostname != urlsplit(url).hostname:
        raise Unprocessable("The platform's configuration is of another host than its issuer.")
    endpoints = {key: configuration.get(key) for key in ("authorization_endpoint", "token_endpoint", "jwks_uri")}
    for name, value in endpoints.items():
        if not is_of_platform(value):
            raise Unprocessable(f"The platform's configuration has no {name} with https.")
    login, token, keys = map(str, endpoints.values())
    about = configuration.get(PLATFORM)
    family = read_label(about.get("product_family_code")) if isinstance(about, dict) else ""
    audience = configuration.get("authorization_server")
    return Registration(
        name=f"{family} {urlsplit(issuer).hostname}".strip(), issuer=issuer, client_id="", login_url=login,
        token_url=token, keys_url=keys, token_audience=audience if isinstance(audience, str) else "",
        origins=tuple(dict.fromkeys((read_origin(issuer), read_origin(login)))),
    )  # fmt: skip


async def exchange(
    requester: Requester, step: Step, method: str, url: str, headers: Mapping[str, str] = NO_HEADERS, *,
    body: bytes | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Returns the JSON object that a platform answers. Raises Unprocessable, which names the step."""
    sent = {"Accept": "application/json", **headers}
    try:
        answer = await requester.request(method, url, headers=sent, body=body)
    except Oversized as error:
        raise Unprocessable(f"The platform's {step.answer} is too large. {error}") from error
    except Exception as error:  # whatever the other side, or the way to it, does wrong
        raise Unprocessable(f"The platform cannot be reached at {read_origin(url)}: {type(error).__name__}.") from error
    if answer.status not in CREATED:
        why = read_refusal(answer.body)
        raise Unprocessable(f"The platform refuses {step.asked}: it answers {answer.status}{why and f', {why}'}.")
    try:
        value = json.loads(answer.body)
    except (ValueError, RecursionError) as error:
        raise Unprocessable(f"The platform's {step.answer} is not JSON.") from error
    if not isinstance(value, dict):
        raise Unprocessable(f"The platform's {step.answer} is no JSON object.")
    return value


def read_refusal(body: bytes) -> str:
    """Returns why a platform refuses, if it says so: the error and its description. Source: RFC 7591, section 3.2.2."""
    try:
        told = json.loads(body)
    except (ValueError, RecursionError):
        return ""
    words = (read_label(told.get(name)) for name in ("error", "error_description")) if isinstance(told, dict) else ()
    return ": ".join(filter(None, words)).rstrip(".")
