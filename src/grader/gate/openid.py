"""OpenID Connect: the authorization code flow with PKCE, and the members that come from a provider. Source: OpenID
Connect Core 1.0, section 3.1; RFC 7636. Needs the extra `oidc`: Authlib and its HTTP client."""

import hashlib
import secrets
from dataclasses import dataclass, field
from typing import Any

import structlog
from sqlalchemy.orm import Session

from grader.courses.people import members
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Role, visible_part
from grader.courses.people.sign_in import BrowserSession, start_session
from grader.errors import Forbidden, Unauthorized
from grader.store import people as stored_people
from grader.store.tables import NAME

log = structlog.get_logger()

LEEWAY_S = 30
TIMEOUT_S = 10.0
SIGNATURES = ["RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "EdDSA"]
"""Accepted algorithms, all asymmetric: `none` is no signature, and HS256 would take a public key for a secret."""

FAILED = "The sign-in could not be finished. Go back and start again."


@dataclass(frozen=True)
class Attempt:
    """A sign-in in progress. It is kept in a cookie of the browser that began it, so that no other can finish it."""

    state: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    nonce: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    verifier: str = field(default_factory=lambda: secrets.token_urlsafe(48))

    @classmethod
    def read(cls, cookie: str) -> "Attempt":
        """Reads the cookie's value. Raises Unauthorized."""
        parts = cookie.split(".")
        if len(parts) != 3 or not all(parts):
            raise Unauthorized(FAILED)
        return cls(*parts)

    def __str__(self) -> str:
        """The cookie's value."""
        return f"{self.state}.{self.nonce}.{self.verifier}"


@dataclass(frozen=True)
class Provider:
    """An OpenID provider, and the course whose students its users become."""

    issuer: str
    client_id: str
    client_secret: str | None
    course: str

    def address(self, attempt: Attempt, redirect_uri: str) -> str:
        """Returns the address at the provider where the sign-in continues."""
        with self._client(redirect_uri) as client:
            endpoint = self._metadata(client)["authorization_endpoint"]
            url, _ = client.create_authorization_url(
                endpoint, state=attempt.state, nonce=attempt.nonce, code_verifier=attempt.verifier
            )
        return str(url)

    def claims(self, attempt: Attempt, code: str, redirect_uri: str) -> dict[str, Any]:
        """Exchanges the code for an ID token, and checks it. Raises Unauthorized."""
        from authlib.integrations.base_client import OAuthError
        from authlib.oidc.core import CodeIDToken
        from httpx2 import HTTPError
        from joserfc import jwt
        from joserfc.errors import JoseError
        from joserfc.jwk import KeySet

        try:
            with self._client(redirect_uri) as client:
                metadata = self._metadata(client)
                token = client.fetch_token(metadata["token_endpoint"], code=code, code_verifier=attempt.verifier)
                keys = fetch_json(client, metadata["jwks_uri"])
            decoded = jwt.decode(token["id_token"], KeySet.import_key_set(keys), algorithms=SIGNATURES)
            options = {"iss": {"value": self.issuer}, "aud": {"value": self.client_id}, "sub": {"essential": True}}
            params = {"nonce": attempt.nonce, "client_id": self.client_id, "access_token": token.get("access_token")}
            claims = CodeIDToken(decoded.claims, decoded.header, options, params)
            claims.validate(leeway=LEEWAY_S)
        except (OAuthError, HTTPError, JoseError, KeyError, ValueError, TypeError) as error:
            log.warning("OIDC sign-in refused", why=type(error).__name__)
            raise Unauthorized(FAILED) from error
        return dict(claims)

    def open_session(self, session: Session, claims: dict[str, Any]) -> BrowserSession:
        """Starts a session of the member with these claims, who becomes a student at the first sign-in. Raises
        Forbidden if an instructor has removed the member."""
        digest = hashlib.sha256(f"{self.issuer}\n{claims['sub']}".encode()).hexdigest()
        account = f"oidc:{digest}"
        known = stored_people.find_with_account(session, self.course, account)
        if known is not None and known.removed_at is not None:
            raise Forbidden("You were removed from this course. Ask its instructor.")
        member = known or members.get_with_account(session, account, read_name(claims), Role.STUDENT, self.course)
        opened = start_session(session, member)
        record(session, opened.identity, self.course, Action.SIGNED_IN, member.name, by="oidc")
        return opened

    def _client(self, redirect_uri: str) -> Any:
        from authlib.integrations.httpx_client import OAuth2Client

        return OAuth2Client(
            self.client_id, self.client_secret, scope="openid profile email", redirect_uri=redirect_uri,
            code_challenge_method="S256", timeout=TIMEOUT_S, follow_redirects=False,
            token_endpoint_auth_method="client_secret_basic" if self.client_secret else "none",
        )  # fmt: skip

    def _metadata(self, client: Any) -> dict[str, Any]:
        """Returns the provider's metadata. Raises ValueError if they name another issuer."""
        url = f"{self.issuer.rstrip('/')}/.well-known/openid-configuration"
        metadata: dict[str, Any] = fetch_json(client, url)
        if metadata.get("issuer") != self.issuer:
            raise ValueError("the metadata are of another issuer")
        return metadata


def fetch_json(client: Any, url: str) -> Any:
    """A JSON document of the provider; no token is sent for it. Raises HTTPError, ValueError."""
    return client.request("GET", url, withhold_token=True).raise_for_status().json()


def read_name(claims: dict[str, Any]) -> str:
    """The user's name as far as the provider tells it, cleaned to what a name may be."""
    for claim in ("name", "preferred_username", "email", "sub"):
        text = visible_part(str(claims.get(claim) or "")).strip()
        if text:
            return text[:NAME]
    return "learner"
