"""Sign-in with OpenID Connect, against a small provider of our own that can also misbehave."""

import base64
import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
from fastapi import FastAPI, HTTPException, Request
from joserfc import jwt
from joserfc.jwk import KeySet, OctKey, RSAKey
from pydantic import SecretStr, ValidationError

from grader.errors import Conflict
from grader.settings import Settings
from support.servers import serving
from support.sites import Site, open_site, write_content

API = "/api/v1"
CLIENT, SECRET = "grader", "a secret of the client"
OWN, FOREIGN = (RSAKey.generate_key(2048, {"kid": "one"}) for _ in range(2))
ANSWER = {"quiz": "small", "question": "q1", "answer": 1}
OURS = {"Sec-Fetch-Site": "same-origin"}

Forge = Callable[["Provider", dict[str, Any]], str]


@dataclass
class Provider:
    """An OpenID provider with one user; `forge` makes the ID token out of the right claims."""

    issuer: str = ""
    named: str = ""
    user: dict[str, Any] = field(default_factory=lambda: {"sub": "u1", "name": "Ada Lovelace"})
    forge: Forge | None = None
    asked: dict[str, dict[str, str]] = field(default_factory=dict)

    def app(self) -> FastAPI:
        app = FastAPI()

        @app.get("/.well-known/openid-configuration")
        def metadata() -> dict[str, str]:
            places = {"authorization_endpoint": "authorize", "token_endpoint": "token", "jwks_uri": "keys"}
            return {"issuer": self.named or self.issuer, **{key: f"{self.issuer}/{at}" for key, at in places.items()}}

        @app.get("/keys")
        def keys() -> dict[str, Any]:
            return dict(KeySet([OWN]).as_dict(private=False))

        @app.post("/token")
        async def token(request: Request) -> dict[str, Any]:
            form = {key: values[0] for key, values in parse_qs((await request.body()).decode()).items()}
            basic = base64.b64encode(f"{CLIENT}:{SECRET}".encode()).decode()
            asked = self.asked.pop(form.get("code", ""), None)
            if asked is None or request.headers["authorization"] != f"Basic {basic}":
                raise HTTPException(400)
            digest = hashlib.sha256(form["code_verifier"].encode()).digest()
            challenge = base64.urlsafe_b64encode(digest).decode().rstrip("=")
            if (asked["code_challenge"], asked["redirect_uri"]) != (challenge, form["redirect_uri"]):
                raise HTTPException(400)
            return {"access_token": "at", "token_type": "Bearer", "id_token": self.id_token(asked["nonce"])}

        return app

    def id_token(self, nonce: str) -> str:
        now = int(time.time())
        claims = {"iss": self.issuer, "aud": CLIENT, "iat": now, "exp": now + 60, "nonce": nonce, **self.user}
        return signed(claims) if self.forge is None else self.forge(self, claims)

    def authorize(self, address: str) -> dict[str, str]:
        """The user agrees: the query with which the browser is sent back."""
        asked = {key: values[0] for key, values in parse_qs(urlsplit(address).query).items()}
        assert (asked["client_id"], asked["response_type"]) == (CLIENT, "code")
        assert (asked["code_challenge_method"], asked["scope"].split()[0]) == ("S256", "openid")
        code = f"code-{len(self.asked)}-{time.monotonic_ns()}"
        self.asked[code] = asked
        return {"code": code, "state": asked["state"]}


def signed(claims: dict[str, Any], key: Any = OWN, alg: str = "RS256", **header: Any) -> str:
    return str(jwt.encode({"alg": alg, "kid": "one", **header}, claims, key, algorithms=[alg]))


def unsigned(claims: dict[str, Any]) -> str:
    parts = (b'{"alg":"none"}', str(claims).replace("'", '"').encode(), b"")
    return ".".join(base64.urlsafe_b64encode(part).decode().rstrip("=") for part in parts)


@dataclass
class Both:
    site: Site
    provider: Provider

    def sign_in(self, browser: httpx.Client) -> httpx.Response:
        """Goes the whole way: to the provider, back, in."""
        begun = browser.get("/oidc/login")
        assert begun.status_code == 303
        return browser.get("/oidc/callback", params=self.provider.authorize(begun.headers["location"]))


@contextmanager
def both_in(folder: Path) -> Iterator[Both]:
    provider = Provider()
    with serving(provider.app()) as provider.issuer:
        settings = Settings(
            content=write_content(folder / "content"), data=folder / "data", workers=0, oidc_issuer=provider.issuer,
            oidc_client_id=CLIENT, oidc_client_secret=SecretStr(SECRET), oidc_course="robots",
        )  # fmt: skip
        with open_site(settings) as site:
            yield Both(site, provider)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Both]:
    with both_in(tmp_path_factory.mktemp("oidc")) as both:
        yield both


@pytest.fixture
def both(shared: Both) -> Both:
    shared.provider.forge, shared.provider.named = None, ""
    shared.provider.user = {"sub": "u1", "name": "Ada Lovelace"}
    return shared


@pytest.mark.slow
def test_a_user_of_the_provider_gets_in_and_finds_the_work_again(both: Both) -> None:
    first, second = both.site.anonymous(OURS), both.site.anonymous(OURS)
    done = both.sign_in(first)
    assert (done.status_code, done.headers["location"]) == (303, "/")
    made = first.post(f"{API}/submissions", json=ANSWER).json()
    assert made["user"] == "Ada Lovelace"
    both.provider.user["name"] = "Ada King"  # a name may change, the subject does not
    both.sign_in(second)
    assert [item["id"] for item in second.get(f"{API}/submissions").json()["items"]] == [made["id"]]
    assert "lost" not in second.get("/signout").text


def test_two_users_of_one_name_are_two_learners(both: Both) -> None:
    browsers = []
    for subject in ("u2", "u3"):
        both.provider.user = {"sub": subject, "name": "Sam"}
        browsers.append(both.site.anonymous(OURS))
        both.sign_in(browsers[-1])
    made = [browser.post(f"{API}/submissions", json=ANSWER).json() for browser in browsers]
    assert made[0]["learner"] != made[1]["learner"]
    with pytest.raises(Conflict, match="2 members have the name 'Sam' already"):
        both.site.client("Sam", course="robots")


FORGERIES: dict[str, Forge] = {
    "another nonce": lambda _, claims: signed(claims | {"nonce": "other"}),
    "no nonce": lambda _, claims: signed({key: value for key, value in claims.items() if key != "nonce"}),
    "another audience": lambda _, claims: signed(claims | {"aud": "other"}),
    "two audiences without azp": lambda _, claims: signed(claims | {"aud": ["other", CLIENT]}),
    "another azp": lambda _, claims: signed(claims | {"azp": "other"}),
    "another issuer": lambda _, claims: signed(claims | {"iss": "https://evil.example"}),
    "expired": lambda _, claims: signed(claims | {"exp": claims["exp"] - 3600}),
    "not yet valid": lambda _, claims: signed(claims | {"nbf": claims["exp"] + 3600}),
    "no expiry": lambda _, claims: signed({key: value for key, value in claims.items() if key != "exp"}),
    "no subject": lambda _, claims: signed({key: value for key, value in claims.items() if key != "sub"}),
    "an empty subject": lambda _, claims: signed(claims | {"sub": ""}),
    "a foreign key": lambda _, claims: signed(claims, FOREIGN),
    "HS256 with the public key": lambda _, claims: signed(
        claims, OctKey.import_key(OWN.as_pem(private=False)), "HS256"
    ),
    "unsigned": lambda _, claims: unsigned(claims),
    "garbage": lambda *_: "a.b.c",
    "no text": lambda *_: "",
}


@pytest.mark.parametrize("name", FORGERIES)
@pytest.mark.filterwarnings("ignore::joserfc.errors.SecurityWarning")
def test_a_forged_id_token_opens_nothing(both: Both, name: str) -> None:
    both.provider.forge = FORGERIES[name]
    browser = both.site.anonymous()
    refused = both.sign_in(browser)
    assert refused.status_code == 401, refused.text
    assert browser.get(f"{API}/quizzes").status_code == 401


def test_only_the_browser_that_began_can_finish(both: Both) -> None:
    ann, eve = both.site.anonymous(), both.site.anonymous()
    back = both.provider.authorize(ann.get("/oidc/login").headers["location"])
    assert eve.get("/oidc/callback", params=back).status_code == 401  # no attempt of its own
    eve.get("/oidc/login")
    assert eve.get("/oidc/callback", params=back).status_code == 401  # another state
    assert eve.get("/oidc/callback", params=back | {"state": "ü"}).status_code == 401
    assert ann.get("/oidc/callback", params=back).status_code == 303
    assert ann.get("/oidc/callback", params=back).status_code == 401  # once
    assert ann.get("/oidc/callback", params={"error": "access_denied"}).status_code == 401


def test_metadata_of_another_issuer_are_refused(both: Both) -> None:
    both.provider.named = "https://evil.example"
    assert both.site.anonymous().get("/oidc/login").status_code == 401


def test_a_removed_member_stays_out(both: Both) -> None:
    both.provider.user = {"sub": "u9", "name": "Mallory"}
    browser = both.site.anonymous(OURS)
    both.sign_in(browser)
    teacher = both.site.client("tina", "instructor", course="robots")
    [member] = [item for item in teacher.get(f"{API}/members").json()["items"] if item["name"] == "Mallory"]
    assert member["way_in"] == "oidc"
    assert teacher.delete(f"{API}/members/{member['id']}").status_code == 204
    assert browser.get(f"{API}/quizzes").status_code == 401
    assert both.sign_in(browser).status_code == 403


def test_a_member_made_an_instructor_signs_in_as_one(both: Both) -> None:
    both.provider.user = {"sub": "u10", "email": "tom@example.org"}
    browser = both.site.anonymous(OURS)
    both.sign_in(browser)
    teacher = both.site.client("tina", "instructor", course="robots")
    [member] = [item for item in teacher.get(f"{API}/members").json()["items"] if item["name"] == "tom@example.org"]
    teacher.patch(f"{API}/members/{member['id']}", json={"role": "instructor"})
    assert both.sign_in(browser).headers["location"] == "/instructor"


def test_a_program_for_people_makes_no_instructor_of_a_user(both: Both) -> None:
    """The user's next sign-in would be a session without restriction."""
    both.provider.user = {"sub": "u11", "name": "Accomplice"}
    browser = both.site.anonymous(OURS)
    both.sign_in(browser)
    teacher = both.site.client("tina", "instructor", course="robots")
    made = {"user": "robot", "role": "instructor", "scopes": ["people"]}
    token = teacher.post(f"{API}/tokens", json=made).json()["token"]
    robot = both.site.anonymous({"Authorization": f"Bearer {token}"})
    [member] = [item for item in robot.get(f"{API}/members").json()["items"] if item["name"] == "Accomplice"]
    assert robot.patch(f"{API}/members/{member['id']}", json={"role": "instructor"}).status_code == 403
    assert both.sign_in(browser).headers["location"] == "/"


def test_a_demoted_user_signs_in_as_a_student(both: Both) -> None:
    both.provider.user = {"sub": "u12", "name": "Prof"}
    browser = both.site.anonymous(OURS)
    both.sign_in(browser)
    teacher = both.site.client("tina", "instructor", course="robots")
    [member] = [item for item in teacher.get(f"{API}/members").json()["items"] if item["name"] == "Prof"]
    teacher.patch(f"{API}/members/{member['id']}", json={"role": "instructor"})
    both.sign_in(browser)
    assert browser.get("/instructor").status_code == 200
    teacher.patch(f"{API}/members/{member['id']}", json={"role": "student"})
    assert browser.get("/instructor").status_code == 401
    assert both.sign_in(browser).headers["location"] == "/"


def test_without_settings_there_is_no_such_sign_in(tmp_path: Path) -> None:
    with open_site(Settings(content=write_content(tmp_path / "content"), data=tmp_path, workers=0)) as site:
        assert site.anonymous().get("/oidc/login").status_code == 404
        assert site.anonymous().get("/oidc/callback").status_code == 404
        assert "organisation" not in site.anonymous().get("/instructor").text


def test_the_page_offers_it_where_it_is_configured(both: Both) -> None:
    assert "/oidc/login" in both.site.anonymous().get("/instructor").text


@pytest.mark.parametrize(
    "changes",
    [
        {"oidc_issuer": "https://id.example"},
        {"oidc_client_id": "x"},
        {"oidc_issuer": "http://id.example", "oidc_client_id": "x"},
    ],
)
def test_half_a_provider_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="OIDC_ISSUER"):
        Settings(**changes)


def test_the_secret_is_not_shown(both: Both) -> None:
    assert SECRET not in repr(both.site.settings)
