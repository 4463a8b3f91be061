"""The key pair with which this tool signs, and its public half for platforms, as a JWK set with rotation. Source: RFC
7517 (JWK), RFC 7519 (JWT); 1EdTech Security Framework 1.1, section 6.3: RS256 with a `kid`."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.identity import DEFAULT_COURSE
from grader.store.engine.database import Database
from grader.store.tables import now
from grader.store.upkeep import installation

BITS = 2048
PUBLISHED = timedelta(days=1)
"""How long a replaced key stays published: tokens that it has signed are under way."""


@dataclass(frozen=True)
class ToolKeys:
    """The keys of an installation, shared by all its servers and workers through the database."""

    database: Database
    clock: Callable[[], datetime] = now

    def sign(self, claims: dict[str, Any]) -> str:
        """Signs a JWT with the newest key, whose `kid` is in the header."""
        from joserfc import jwt
        from joserfc.jwk import RSAKey

        newest = self._kept()[-1]["jwk"]
        header = {"alg": "RS256", "kid": newest["kid"], "typ": "JWT"}
        return jwt.encode(header, claims, RSAKey.import_key(newest), algorithms=["RS256"])

    def public(self) -> dict[str, Any]:
        """Returns the JWK set to publish: the newest key, and those that it has lately replaced."""
        from joserfc.jwk import RSAKey

        return {"keys": [RSAKey.import_key(key["jwk"]).as_dict(private=False) for key in self._kept()]}

    def rotate(self) -> str:
        """Makes a new key that signs from now on, and records it. Returns its `kid`."""
        new_key = make_key()
        kid = str(new_key["jwk"]["kid"])
        with self.database.write() as session:
            self.database.lock(session, "lti-keys")
            keys = [{**key, "until": key["until"] or self._end()} for key in self._read(session)]
            self._write(session, [*keys, new_key])
            record(session, None, DEFAULT_COURSE, Action.SIGNING_KEY_ROTATED, kid)
        return kid

    def _kept(self) -> list[dict[str, Any]]:
        """Returns the keys that are published, the newest last; the first call on a database makes one."""
        with self.database.read() as session:
            keys = self._read(session)
        if keys:
            return keys
        new_key = make_key()
        with self.database.write() as session:
            self.database.lock(session, "lti-keys")
            keys = self._read(session) or [new_key]
            self._write(session, keys)
        return keys

    def _end(self) -> str:
        return (self.clock() + PUBLISHED).isoformat()

    def _read(self, session: Session) -> list[dict[str, Any]]:
        keys = json.loads(installation.lti_keys(session) or b"[]")
        return [key for key in keys if key["until"] is None or datetime.fromisoformat(key["until"]) > self.clock()]

    def _write(self, session: Session, keys: list[dict[str, Any]]) -> None:
        installation.keep_lti_keys(session, json.dumps(keys).encode())


def make_key() -> dict[str, Any]:
    """Returns a new private key, as it is kept: `until` says how long it stays published once another replaces it."""
    from joserfc.jwk import RSAKey

    key = RSAKey.generate_key(BITS, {"use": "sig", "alg": "RS256"}, private=True, auto_kid=True)
    return {"jwk": key.as_dict(private=True), "until": None}
