"""This tool as platforms see it: its keys, its addresses, and its ways to ask them."""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from grader.platforms.keys import ToolKeys
from grader.platforms.launching import claims as words
from grader.platforms.launching.fetching import PlatformKeys, Requester
from grader.platforms.launching.login import keys_url, launch_url, login_url
from grader.platforms.launching.registration import DESCRIPTION, NAME

if TYPE_CHECKING:  # it needs the packages of the extra
    from grader.platforms.sending.access_tokens import AccessTokens

NEEDED = ("joserfc", "httpx2")
MISSING = "LTI is not installed here. Install requirements-all.lock, which has its packages: docs/deploy.md"


@dataclass(frozen=True)
class Tool:
    """What serving launches takes."""

    keys: ToolKeys
    platform_keys: PlatformKeys
    requester: Requester
    authorized: "AccessTokens"


def is_installed() -> bool:
    """Says whether the packages of the extra `lti` are here."""
    return all(find_spec(name) is not None for name in NEEDED)


def list_addresses(origin: str) -> dict[str, str]:
    """Says what a platform's administrator types in, by what it is called in LTI."""
    return {
        "login_url": login_url(origin),
        "launch_url": launch_url(origin),
        "keys_url": keys_url(origin),
        "canvas_configuration_url": f"{origin}/lti/canvas.json",
    }


def canvas_configuration(origin: str) -> dict[str, Any]:
    """The configuration that Canvas takes for a developer key. Source: Canvas, "Configuring LTI Advantage Tools"."""
    placements = ("assignment_selection", "link_selection")
    launch = launch_url(origin)
    return {
        "title": NAME,
        "description": DESCRIPTION,
        "oidc_initiation_url": login_url(origin),
        "target_link_uri": launch,
        "public_jwk_url": keys_url(origin),
        "scopes": list(words.SCOPES),
        "extensions": [
            {
                "platform": "canvas.instructure.com",
                "domain": urlsplit(origin).netloc,
                "privacy_level": "name_only",
                "settings": {
                    "text": NAME,
                    "placements": [
                        {"placement": name, "message_type": words.DEEP_LINKING, "target_link_uri": launch}
                        for name in placements
                    ],
                },
            }
        ],
    }
