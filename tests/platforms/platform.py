"""A learning platform for tests: strict about what a tool sends it, and able to send a tool anything.

It signs launches, publishes its keys, gives access tokens, tells its roster and registers tools. Source: LTI 1.3 core,
1EdTech Security Framework 1.1, NRPS 2.0, Dynamic Registration 1.0.
"""

import json
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import httpx
from fastapi import FastAPI, HTTPException, Request
from fastapi.responses import JSONResponse, Response
from joserfc import jws, jwt
from joserfc.jwk import KeySet, RSAKey

from grader.courses.people.platforms import Registration
from support.servers import serving

CLAIM = "https://purl.imsglobal.org/spec/lti/claim/"
DL_CLAIM = "https://purl.imsglobal.org/spec/lti-dl/claim/"
AGS = "https://purl.imsglobal.org/spec/lti-ags/claim/endpoint"
AGS_SCOPE = "https://purl.imsglobal.org/spec/lti-ags/scope/"
NRPS = "https://purl.imsglobal.org/spec/lti-nrps/claim/namesroleservice"
NRPS_SCOPE = "https://purl.imsglobal.org/spec/lti-nrps/scope/contextmembership.readonly"
ROLE = "http://purl.imsglobal.org/vocab/lis/v2/membership"
LEARNER, INSTRUCTOR = f"{ROLE}#Learner", f"{ROLE}#Instructor"
INSTITUTION = "http://purl.imsglobal.org/vocab/lis/v2/institution/person#Instructor"
ROSTER = "application/vnd.ims.lti-nrps.v2.membershipcontainer+json"

KEYS = [RSAKey.generate_key(2048, {"kid": f"key-{number}"}) for number in range(2)]
"""The platform's own key, and one that is published after a rotation, or is foreign."""

Claims = dict[str, Any]


@dataclass
class Tool:
    """A tool as the platform knows it."""

    origin: str
    redirect_uris: list[str]
    keys_url: str


@dataclass
class Platform:
    """One platform with one tool; `published` are the keys at its address."""

    origin: str = ""
    client_id: str = field(default_factory=lambda: f"client-{secrets.token_hex(4)}")
    deployment_id: str = "deployment-1"
    published: list[RSAKey] = field(default_factory=lambda: KEYS[:1])
    key_fetches: int = 0
    roster: list[dict[str, Any]] = field(default_factory=list)
    roster_page: int = 2
    tokens: dict[str, list[str]] = field(default_factory=dict)
    registrations: list[dict[str, Any]] = field(default_factory=list)
    registration_token: str = "a token of the platform"
    configured: dict[str, Any] = field(default_factory=dict)
    """What the configuration says otherwise than it should."""
    registered: dict[str, Any] = field(default_factory=dict)
    """What the answer to a registration says otherwise."""
    refusal: dict[str, Any] | None = None
    """Why every registration is refused."""
    tool_keys: Any = None
    scores: list[dict[str, Any]] = field(default_factory=list)
    taken: list[tuple[str, str, Any]] = field(default_factory=list)
    """Column, user and points of each score."""
    services: str = ""
    """The origin of the services for tools, where it is not that of the pages."""

    @property
    def registration(self) -> Registration:
        services = self.services or self.origin
        return Registration(
            "A platform", self.origin, self.client_id, f"{self.origin}/auth", f"{services}/token",
            f"{services}/keys", origins=(self.origin,),
        )  # fmt: skip

    def login(self, tool: str, **changes: str | None) -> dict[str, str]:
        """The parameters with which a login at the tool begins; None leaves one out."""
        fields: dict[str, str | None] = {
            "iss": self.origin, "login_hint": "user 7", "target_link_uri": f"{tool}/lti/launch",
            "lti_message_hint": "hint 7", "client_id": self.client_id, **changes,
        }  # fmt: skip
        return {name: value for name, value in fields.items() if value is not None}

    def read_authentication_request(self, address: str, tool: str) -> dict[str, str]:
        """What the tool asks for; every parameter must be as the specification demands, and there once."""
        assert address.partition("?")[0] == f"{self.origin}/auth"
        pairs = parse_qsl(urlsplit(address).query, strict_parsing=True, keep_blank_values=True)
        asked = dict(pairs)
        assert len(asked) == len(pairs), pairs
        constant = {"scope": "openid", "response_type": "id_token", "response_mode": "form_post", "prompt": "none"}
        assert {name: asked[name] for name in constant} == constant
        assert asked["client_id"] == self.client_id
        assert asked["redirect_uri"] == f"{tool}/lti/launch"
        assert min(len(asked["state"]), len(asked["nonce"])) >= 22, "at least 128 bits"
        return asked

    def claims(self, asked: dict[str, str], **changes: Any) -> Claims:
        """The claims of a right launch of a learner."""
        at = int(time.time())
        return {
            "iss": self.origin, "aud": self.client_id, "sub": "user-7", "iat": at, "exp": at + 300,
            "nonce": asked["nonce"], "name": "Ada Lovelace",
            f"{CLAIM}deployment_id": self.deployment_id, f"{CLAIM}message_type": "LtiResourceLinkRequest",
            f"{CLAIM}version": "1.3.0", f"{CLAIM}roles": [LEARNER],
            f"{CLAIM}target_link_uri": asked["redirect_uri"],
            f"{CLAIM}context": {"id": "context-1", "title": "Robotics"},
            f"{CLAIM}resource_link": {"id": "link-1", "title": "A small quiz"},
            **changes,
        }  # fmt: skip

    def sign(self, claims: Claims, key: Any = KEYS[0], alg: str = "RS256", **header: Any) -> str:
        kid = {"kid": key.kid} if hasattr(key, "kid") and key.kid else {}
        whole, text = {"alg": alg, "typ": "JWT", **kid, **header}, json.dumps(claims)  # ASCII, as platforms write it
        registry = jws.JWSRegistry(algorithms=[alg], strict_check_header=False)
        return jws.serialize_compact(whole, text, key, registry=registry)

    def app(self) -> FastAPI:
        app = FastAPI()

        @app.get("/keys")
        def keys() -> dict[str, Any]:
            self.key_fetches += 1
            return dict(KeySet(list(self.published)).as_dict(private=False))

        @app.post("/token")
        async def token(request: Request) -> dict[str, Any]:
            return self.give_token(dict(parse_qsl((await request.body()).decode())))

        @app.get("/roster/{page}")
        def roster(page: int, request: Request) -> Response:
            self.require(request, NRPS_SCOPE)
            assert request.headers["accept"] == ROSTER
            start = page * self.roster_page
            members = self.roster[start : start + self.roster_page]
            more = start + self.roster_page < len(self.roster)
            headers = {"Link": f'<{self.origin}/roster/{page + 1}>; rel="next"'} if more else {}
            return JSONResponse({"id": "x", "context": {"id": "context-1"}, "members": members}, headers=headers)

        @app.post("/lineitem/scores")
        @app.post("/columns/{column}/scores")
        async def take_score(request: Request, column: str = "") -> Response:
            self.require(request, f"{AGS_SCOPE}score")
            assert request.headers["content-type"] == "application/vnd.ims.lis.v1.score+json"
            self.scores.append(await request.json())
            self.taken.append((column, self.scores[-1]["userId"], self.scores[-1]["scoreGiven"]))
            return Response(status_code=200)

        @app.get("/lineitem/results")
        @app.get("/columns/{column}/results")
        def results(request: Request, column: str = "", user_id: str = "") -> list[dict[str, Any]]:
            self.require(request, f"{AGS_SCOPE}result.readonly")
            theirs = [score for score, (at, user, _) in zip(self.scores, self.taken, strict=True)
                      if (at, user) == (column, user_id)]  # fmt: skip
            return [{"userId": user_id, "resultScore": one["scoreGiven"], "resultMaximum": one["scoreMaximum"]}
                    for one in theirs[-1:]]  # fmt: skip

        @app.get("/.well-known/openid-configuration")
        def configuration() -> dict[str, Any]:
            return {
                "issuer": self.origin,
                "authorization_endpoint": f"{self.origin}/auth",
                "token_endpoint": f"{self.origin}/token",
                "jwks_uri": f"{self.origin}/keys",
                "registration_endpoint": f"{self.origin}/register",
                "https://purl.imsglobal.org/spec/lti-platform-configuration": {"product_family_code": "simulated"},
            } | self.configured

        @app.post("/register")
        async def register(request: Request) -> Any:
            if request.headers.get("authorization") != f"Bearer {self.registration_token}":
                raise HTTPException(401)
            if self.refusal is not None:
                return JSONResponse(self.refusal, 400)
            told: dict[str, Any] = await request.json()
            assert told["application_type"] == "web"
            assert told["token_endpoint_auth_method"] == "private_key_jwt"
            assert set(told["grant_types"]) == {"implicit", "client_credentials"}
            self.registrations.append(told)
            return told | {
                "client_id": self.client_id,
                "https://purl.imsglobal.org/spec/lti-tool-configuration": {"deployment_id": self.deployment_id},
            } | self.registered  # fmt: skip

        return app

    def give_token(self, form: dict[str, str]) -> dict[str, Any]:
        """An access token for a tool that proves itself by its own key, once for each assertion."""
        assert form["grant_type"] == "client_credentials"
        assert form["client_assertion_type"] == "urn:ietf:params:oauth:client-assertion-type:jwt-bearer"
        decoded = jwt.decode(form["client_assertion"], KeySet.import_key_set(self.tool_keys), algorithms=["RS256"])
        said = decoded.claims
        assert (said["iss"], said["sub"], said["aud"]) == (
            self.client_id,
            self.client_id,
            f"{self.services or self.origin}/token",
        )
        assert said["iat"] <= time.time() + 1 < said["exp"]
        assert said["jti"]
        token = secrets.token_hex(8)
        self.tokens[token] = form["scope"].split()
        return {"access_token": token, "token_type": "Bearer", "expires_in": 3600, "scope": form["scope"]}

    def require(self, request: Request, scope: str) -> None:
        token = request.headers.get("authorization", "").removeprefix("Bearer ")
        if scope not in self.tokens.get(token, []):
            raise HTTPException(401)

    def read_selection(self, response: str, keys: Any) -> Claims:
        """The claims of a Deep Linking response, which the tool must have signed for this platform."""
        decoded = jwt.decode(response, KeySet.import_key_set(keys), algorithms=["RS256"])
        said: Claims = dict(decoded.claims)
        audience = said["aud"] if isinstance(said["aud"], list) else [said["aud"]]
        assert (said["iss"], audience) == (self.client_id, [self.origin])
        assert said["iat"] <= time.time() + 1 < said["exp"] <= said["iat"] + 3600
        assert said[f"{CLAIM}deployment_id"] == self.deployment_id
        assert said[f"{CLAIM}message_type"] == "LtiDeepLinkingResponse"
        assert said[f"{CLAIM}version"] == "1.3.0"
        assert said["nonce"]
        return said


@contextmanager
def running_platform() -> Iterator[Platform]:
    platform = Platform()
    with serving(platform.app()) as platform.origin:
        yield platform


def selection_claims(platform: Platform, asked: dict[str, str], **settings: Any) -> Claims:
    """The claims of a Deep Linking request of an instructor."""
    changes: Claims = {
        f"{CLAIM}message_type": "LtiDeepLinkingRequest",
        f"{CLAIM}roles": [INSTRUCTOR],
        f"{DL_CLAIM}deep_linking_settings": {
            "deep_link_return_url": f"{platform.origin}/return?course=1",
            "accept_types": ["ltiResourceLink", "link"],
            "accept_presentation_document_targets": ["iframe", "window"],
            "accept_multiple": True,
            "data": "a b&c",
            **settings,
        },
    }
    claims = platform.claims(asked, sub="teacher-1", name="Tina Teach", **changes)
    del claims[f"{CLAIM}resource_link"]
    return claims


def get_json(client: httpx.Client, path: str) -> Any:
    answered = client.get(path)
    assert answered.status_code == 200, answered.text
    return answered.json()
