"""Checks the signature and the claims of an `id_token`. Source: 1EdTech Security Framework 1.1, section 5.1.3; OpenID
Connect Core 1.0, section 3.1.3.7."""

import base64
import json
import time
from collections.abc import Callable
from typing import Any

from grader.domain.platform import Platform
from grader.errors import Unauthorized
from grader.platforms.launching.fetching import PlatformKeys

TOKEN_CHARACTERS_MAX = 48 * 1024
LEEWAY_S = 30
AGE_MAX_S = 3600
"""The oldest `iat` [s]. A login is answered within minutes."""

LATEST = 1e12
"""No moment of a token is later [s since 1970], nor infinite, nor not a number."""

ALGORITHM = "RS256"


async def verify(
    token: str, platform: Platform, nonce: str, keys: PlatformKeys, clock: Callable[[], float] = time.time
) -> dict[str, Any]:
    """Returns the claims of a token that `platform` has signed for the login with this nonce. Raises Unauthorized."""
    if len(token) > TOKEN_CHARACTERS_MAX or token.count(".") != 2:
        raise Unauthorized("The launch holds no token that can be read.")
    kid = read_kid(read_header(token))
    claims = read_object(signed_payload(token, await keys.key(platform.keys_url, kid)))
    check_parties(claims, platform, nonce)
    check_times(claims, clock())
    return claims


def read_header(token: str) -> dict[str, Any]:
    """Returns the header of a token, which nothing has proved yet. Raises Unauthorized."""
    text = token.partition(".")[0]
    try:
        return read_object(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)))
    except ValueError as error:
        raise Unauthorized("The header of the launch's token cannot be read.") from error


def read_kid(header: dict[str, Any]) -> str:
    """Returns the key's id. Keys that the header itself brings along are not looked at. Raises Unauthorized."""
    if header.get("alg") != ALGORITHM:
        raise Unauthorized(f"The launch is not signed with {ALGORITHM}.")
    if "crit" in header:
        raise Unauthorized("The launch's token asks for an extension that is not known here.")
    kid = header.get("kid")
    if not isinstance(kid, str) or not kid:
        raise Unauthorized("The launch's token does not name its key.")
    return kid


def signed_payload(token: str, key: dict[str, Any]) -> bytes:
    """Says what the token's owner has signed with the key. Raises Unauthorized."""
    from joserfc import jws
    from joserfc.errors import JoseError
    from joserfc.jwk import RSAKey

    registry = jws.JWSRegistry(algorithms=[ALGORITHM], strict_check_header=False)
    try:
        public = RSAKey.import_key({name: key[name] for name in ("kty", "n", "e")})
        return jws.deserialize_compact(token, public, registry=registry).payload
    except (JoseError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise Unauthorized("The signature of the launch is not the platform's.") from error


def read_object(text: bytes) -> dict[str, Any]:
    """Returns the JSON object in a text. Raises Unauthorized."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Unauthorized("The launch's token cannot be read.") from error
    if not isinstance(value, dict):
        raise Unauthorized("The launch's token is no JSON object.")
    return value


def check_parties(claims: dict[str, Any], platform: Platform, nonce: str) -> None:
    """Raises Unauthorized unless the token is from the platform, for this tool, and for this login."""
    if claims.get("iss") != platform.issuer:
        raise Unauthorized("The launch is from another platform than the one that began it.")
    audience = claims.get("aud")
    listed = audience if isinstance(audience, list) else [audience]
    if platform.client_id not in listed:
        raise Unauthorized("The launch is meant for another tool.")
    if claims.get("azp", None if len(listed) > 1 else platform.client_id) != platform.client_id:
        raise Unauthorized("The launch is meant for several tools, and does not name this one as its party.")
    if not isinstance(claims.get("nonce"), str) or claims["nonce"] != nonce:
        raise Unauthorized("The launch does not belong to the login that began it.")


def check_times(claims: dict[str, Any], at: float) -> None:
    """Raises Unauthorized unless the token is valid now."""
    expires, issued = read_moment(claims, "exp"), read_moment(claims, "iat")
    if expires <= at - LEEWAY_S:
        raise Unauthorized("The launch has expired. Start it again.")
    if not at - AGE_MAX_S - LEEWAY_S <= issued <= at + LEEWAY_S:
        raise Unauthorized("The launch was not issued just now: compare the platform's clock with ours.")
    if "nbf" in claims and read_moment(claims, "nbf") > at + LEEWAY_S:
        raise Unauthorized("The launch is not valid yet: compare the platform's clock with ours.")


def read_moment(claims: dict[str, Any], name: str) -> float:
    """Returns a moment in seconds since 1970. Raises Unauthorized if it is missing, or no number."""
    value = claims.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < LATEST:
        raise Unauthorized(f"The launch does not say `{name}` as a number.")
    return float(value)
