"""Access tokens of platforms: client credentials with a signed assertion, kept until they expire. Source: 1EdTech
Security Framework 1.0, section 4.1; RFC 7523."""

import secrets
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any
from urllib.parse import urlencode

from grader.domain.platform import Platform
from grader.platforms.sending.failures import Unreachable
from grader.platforms.sending.outgoing import Outgoing, Response

ASSERTION_S = 60
"""Lifetime of an assertion [s]."""

LEEWAY_S = 60.0
"""A token is not used in the last part of its life [s]."""

DEFAULT_S = 300.0
"""Lifetime of a token whose platform names none [s]."""

KEPT_MAX = 1000


Sign = Callable[[dict[str, Any]], str]
"""Signs claims with the tool's key: RS256, as a compact JWT."""


class NoToken(Exception):
    """A platform refused to give a token; the message tells its answer."""

    def __init__(self, response: Response) -> None:
        self.response = response
        super().__init__(f"The platform gave no access token: {response.status} {response.text}".strip())


Key = tuple[str, str, tuple[str, ...]]
"""Issuer, client id and scopes: one issuer serves all hosted tenants of Canvas."""


@dataclass
class AccessTokens:
    """The tokens of one process. Two requests at once may ask for a token twice; either one is good."""

    outgoing: Outgoing
    sign: Sign
    clock: Callable[[], float] = time.time
    _kept: dict[Key, tuple[float, str]] = field(default_factory=dict)

    async def request(
        self, platform: Platform, scopes: Collection[str], method: str, url: str, *, headers: Mapping[str, str],
        body: bytes | None = None,
    ) -> Response:  # fmt: skip
        """Sends a request with a token, renewed once after a 401. Raises NoToken, RefusedURL, Unreachable."""
        key = (platform.issuer, platform.client_id, tuple(sorted(scopes)))
        for last in (False, True):
            token = await self._token(platform, key)
            sent = {**headers, "Authorization": f"Bearer {token}"}
            response = await self.outgoing.request(method, url, headers=sent, body=body)
            if response.status != HTTPStatus.UNAUTHORIZED or last:
                break
            if self._kept.get(key, (0.0, ""))[1] == token:
                del self._kept[key]
        return response

    async def _token(self, platform: Platform, key: Key) -> str:
        until, token = self._kept.get(key, (0.0, ""))
        if self.clock() < until:
            return token
        response = await self.outgoing.request(
            "POST",
            platform.token_url,
            headers={"Content-Type": "application/x-www-form-urlencoded", "Accept": "application/json"},
            body=urlencode(self._form(platform, key)).encode(),
        )
        if response.status != HTTPStatus.OK:
            raise NoToken(response)
        return self._keep(key, response.json())

    def _form(self, platform: Platform, key: Key) -> dict[str, str]:
        clock = int(self.clock())
        claims = {
            "iss": platform.client_id,
            "sub": platform.client_id,
            "aud": platform.token_audience or platform.token_url,
            "iat": clock,
            "exp": clock + ASSERTION_S,
            "jti": secrets.token_hex(16),
        }
        return {
            "grant_type": "client_credentials",
            "client_assertion_type": "urn:ietf:params:oauth:client-assertion-type:jwt-bearer",
            "client_assertion": self.sign(claims),
            "scope": " ".join(key[2]),
        }

    def _keep(self, key: Key, response: Any) -> str:
        token = response.get("access_token") if isinstance(response, dict) else None
        if not isinstance(token, str) or not token.isascii() or not token.isprintable() or not token:
            raise Unreachable("The platform's answer holds no access token.")
        lasting = response.get("expires_in")
        seconds = float(lasting) if isinstance(lasting, int | float) and 0 < lasting < 1e9 else DEFAULT_S
        if len(self._kept) >= KEPT_MAX:
            self._kept.clear()
        self._kept[key] = (self.clock() + seconds - LEEWAY_S, token)
        return token
