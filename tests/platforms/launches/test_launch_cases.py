"""Every case of a login and a launch that a tool must get right, with what must come of it."""

import base64
import hmac
import json
import time
from collections.abc import Callable
from typing import Any

import httpx
import pytest

from grader.courses.people import platforms as rules
from grader.courses.people.identity import COOKIE
from grader.platforms.launching.login import FIELD_CHARACTERS_MAX
from platforms.joined import Joined, signed_in
from platforms.platform import (
    AGS,
    AGS_SCOPE,
    CLAIM,
    INSTITUTION,
    INSTRUCTOR,
    KEYS,
    LEARNER,
    ROLE,
    Claims,
    running_platform,
)

API = "/api/v1"
Forge = Callable[[Joined, Claims], str]
ENTERED, REFUSED = 303, 401
PUBLIC = KEYS[1].as_dict(private=False)


def without(*names: str) -> Forge:
    return lambda pair, claims: pair.platform.sign({name: claims[name] for name in claims if name not in names})


def with_(**changes: Any) -> Forge:
    """Right claims with some changed; the keywords are names of plain claims."""
    return lambda pair, claims: pair.platform.sign(claims | changes)


def lti(**changes: Any) -> Forge:
    """Right claims with some of LTI's own changed; None leaves one out."""

    def forge(pair: Joined, claims: Claims) -> str:
        changed = claims | {f"{CLAIM}{name}": value for name, value in changes.items()}
        return pair.platform.sign({name: value for name, value in changed.items() if value is not None})

    return forge


def at(**offsets: float) -> Forge:
    """Right claims with some moments so far from now [s]."""
    return lambda pair, claims: pair.platform.sign(
        claims | {name: time.time() + offset for name, offset in offsets.items()}
    )


def encoded(part: Any) -> str:
    text = part if isinstance(part, bytes) else json.dumps(part).encode()
    return base64.urlsafe_b64encode(text).decode().rstrip("=")


def raw(header: Any, signature: bytes = b"") -> Forge:
    """A token with a header as it is, and a signature that is none."""
    return lambda _, claims: ".".join((encoded(header), encoded(claims), encoded(signature)))


def tampered(pair: Joined, claims: Claims) -> str:
    header, _, signature = pair.platform.sign(claims).split(".")
    return ".".join((header, encoded(claims | {"sub": "somebody else"}), signature))


def for_audience(*audience: str, **more: str) -> Forge:
    return lambda pair, claims: pair.platform.sign(
        claims | {"aud": [one.format(us=pair.platform.client_id) for one in audience]}
        | {name: value.format(us=pair.platform.client_id) for name, value in more.items()}
    )  # fmt: skip


def target(url: str) -> Forge:
    return lambda pair, claims: pair.platform.sign(
        claims | {f"{CLAIM}target_link_uri": url.format(us=pair.site.origin, host=pair.site.origin.partition("//")[2])}
    )


def with_the_public_key_as_secret(_: Joined, claims: Claims) -> str:
    signed = f"{encoded({'alg': 'HS256', 'kid': 'key-0'})}.{encoded(claims)}"
    return f"{signed}.{encoded(hmac.digest(KEYS[0].as_pem(private=False), signed.encode(), 'sha256'))}"


REVIEW = "LtiSubmissionReviewRequest"

CASES: dict[str, tuple[Forge, int]] = {
    "right": (with_(), ENTERED),
    # issuer and audience
    "iss unknown": (with_(iss="https://evil.example"), REFUSED),
    "iss missing": (without("iss"), REFUSED),
    "iss a list": (lambda pair, claims: pair.platform.sign(claims | {"iss": [claims["iss"]]}), REFUSED),
    "aud other": (with_(aud="other"), REFUSED),
    "aud missing": (without("aud"), REFUSED),
    "aud a list of us": (for_audience("{us}"), ENTERED),
    "aud a list without azp": (for_audience("other", "{us}"), REFUSED),
    "aud a list with our azp": (for_audience("other", "{us}", azp="{us}"), ENTERED),
    "aud a list with another azp": (for_audience("other", "{us}", azp="other"), REFUSED),
    "aud ours with another azp": (for_audience("{us}", azp="other"), REFUSED),
    "aud an object": (with_(aud={"x": 1}), REFUSED),
    # times
    "exp past": (at(exp=-60), REFUSED),
    "exp 20 s past": (at(exp=-20), ENTERED),
    "exp missing": (without("exp"), REFUSED),
    "exp a string": (lambda pair, claims: pair.platform.sign(claims | {"exp": str(claims["exp"])}), REFUSED),
    "exp true": (with_(exp=True), REFUSED),
    "exp beyond all numbers": (with_(exp=10**400), REFUSED),
    "iat missing": (without("iat"), REFUSED),
    "iat 20 s ahead": (at(iat=20), ENTERED),
    "iat an hour ahead": (at(iat=3600), REFUSED),
    "iat a day old": (at(iat=-86_400), REFUSED),
    "nbf ahead": (at(nbf=3600), REFUSED),
    "nbf 20 s ahead": (at(nbf=20), ENTERED),
    # nonce
    "nonce unknown": (with_(nonce="other"), REFUSED),
    "nonce missing": (without("nonce"), REFUSED),
    "nonce a list": (lambda pair, claims: pair.platform.sign(claims | {"nonce": [claims["nonce"]]}), REFUSED),
    # what LTI demands
    "deployment unknown": (lti(deployment_id="elsewhere"), 403),
    "deployment missing": (lti(deployment_id=None), REFUSED),
    "version unknown": (lti(version="1.1"), REFUSED),
    "version missing": (lti(version=None), REFUSED),
    "message type unknown": (lti(message_type="LtiEulaRequest"), REFUSED),
    "message type missing": (lti(message_type=None), REFUSED),
    "review of nobody": (lti(message_type=REVIEW), REFUSED),
    "review of a text": (lti(message_type=REVIEW, for_user="user-7"), REFUSED),
    "review of another": (lti(message_type=REVIEW, for_user={"user_id": "user-8"}), 403),
    "review of oneself": (lti(message_type=REVIEW, for_user={"user_id": "user-7"}), ENTERED),
    "review without a resource link": (
        lti(message_type=REVIEW, for_user={"user_id": "user-7"}, resource_link=None), ENTERED,
    ),
    "resource link missing": (lti(resource_link=None), REFUSED),
    "resource link without id": (lti(resource_link={"title": "x"}), REFUSED),
    "resource link no object": (lti(resource_link="link-1"), REFUSED),
    "roles missing": (lti(roles=None), REFUSED),
    "roles no list": (lti(roles=LEARNER), REFUSED),
    "roles empty": (lti(roles=[]), ENTERED),
    "sub missing": (without("sub"), ENTERED),
    "sub empty": (with_(sub=""), REFUSED),
    "sub a number": (with_(sub=7), REFUSED),
    "sub too long": (with_(sub="x" * 256), REFUSED),
    "sub unpaired surrogate": (with_(sub="\ud800"), REFUSED),
    "name unpaired surrogate": (with_(name="A\ud800da"), ENTERED),
    "context no object": (lti(context=["x"]), REFUSED),
    "context missing": (lti(context=None), 403),
    # where it leads
    "target foreign": (target("https://evil.example/lti/launch"), REFUSED),
    "target with us as user": (target("http://{host}@evil.example/"), REFUSED),
    "target of us with userinfo": (target("http://user@{host}/"), REFUSED),
    "target with javascript": (target("javascript:alert(1)//{us}"), REFUSED),
    "target with our name as prefix": (target("{us}.evil.example/"), REFUSED),
    "target missing": (lti(target_link_uri=None), REFUSED),
    "target another page of ours": (target("{us}/?quiz=small"), ENTERED),
    # signature
    "alg none": (raw({"alg": "none", "kid": "key-0"}), REFUSED),
    "alg nOnE": (raw({"alg": "nOnE", "kid": "key-0"}), REFUSED),
    "alg missing": (raw({"kid": "key-0"}), REFUSED),
    "HS256 with the public key": (with_the_public_key_as_secret, REFUSED),
    "RS384": (lambda pair, claims: pair.platform.sign(claims, alg="RS384"), REFUSED),
    "a foreign key under the right kid": (
        lambda pair, claims: pair.platform.sign(claims, KEYS[1], kid="key-0"), REFUSED,
    ),
    "kid missing": (lambda pair, claims: pair.platform.sign(claims, kid=""), REFUSED),
    "jwk injected": (
        lambda pair, claims: pair.platform.sign(claims, KEYS[1], kid="key-0", jwk=PUBLIC),
        REFUSED,
    ),
    "jku injected": (
        lambda pair, claims: pair.platform.sign(claims, KEYS[1], kid="key-0", jku=f"{pair.platform.origin}/keys"),
        REFUSED,
    ),
    "crit": (raw({"alg": "RS256", "kid": "key-0", "crit": ["x"], "x": 1}), REFUSED),
    "a header of the platform's own": (lambda pair, claims: pair.platform.sign(claims, x_vendor="1"), ENTERED),
    "body tampered": (tampered, REFUSED),
    # garbage
    "no token": (lambda *_: "", REFUSED),
    "garbage": (lambda *_: "a.b.c", REFUSED),
    "two parts": (lambda *_: "a.b", REFUSED),
    "header a list": (raw([1]), REFUSED),
    "header nested deep": (raw(b"[" * 20_000), REFUSED),
    "payload no object": (lambda pair, _: pair.platform.sign([1]), REFUSED),  # type: ignore[arg-type]
    "1 MB": (with_(name="x" * 1_000_000), 413),
    "50 KB": (with_(name="x" * 40_000), REFUSED),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
@pytest.mark.filterwarnings("ignore::joserfc.errors.SecurityWarning")
def test_a_launch(pair: Joined, name: str) -> None:
    forge, expected = CASES[name]
    browser = pair.browser()
    asked = pair.begin(browser)
    answered = pair.post(browser, asked, forge(pair, pair.claims(asked)))
    assert answered.status_code == expected, answered.text
    assert signed_in(browser) == (expected == ENTERED)
    if expected == ENTERED:
        assert answered.headers["location"] == ("/?quiz=small" if "another page" in name else "/")
    again = pair.post(
        browser, asked, pair.platform.sign(pair.claims(asked))
    )  # what was refused is used up all the same
    assert again.status_code == (ENTERED if expected == 413 else REFUSED)


def test_a_launch_without_a_link_says_so(pair: Joined) -> None:
    for link in (None, {"title": "x"}):
        refused = pair.launch(pair.browser(), **{f"{CLAIM}resource_link": link})
        assert refused.status_code == 401
        assert "it has no resource_link with an id" in refused.text


def test_keys_that_a_token_names_are_not_fetched(pair: Joined) -> None:
    pair.launch(pair.browser())  # now the platform's keys are known
    fetched = pair.platform.key_fetches
    pair.platform.published = KEYS
    for header in ({"jku": f"{pair.platform.origin}/keys"}, {"x5u": f"{pair.platform.origin}/keys"}, {"jwk": PUBLIC}):
        browser = pair.browser()
        asked = pair.begin(browser)
        forged = pair.platform.sign(pair.claims(asked), KEYS[1], kid="key-0", **header)
        assert pair.post(browser, asked, forged).status_code == REFUSED
    pair.platform.published = KEYS[:1]
    assert pair.platform.key_fetches == fetched


def test_the_platform_is_that_of_the_state_and_never_that_of_the_token(pair: Joined) -> None:
    """Another platform, registered and approved too, signs a launch for a login that began at the first one."""
    with running_platform() as other:
        with pair.database.write() as session:
            row = rules.add(session, None, other.registration, other.deployment_id)
            rules.approve(session, None, row.id)
        browser = pair.browser()
        asked = pair.begin(browser)
        foreign = pair.claims(asked) | {"iss": other.origin, "aud": other.client_id}
        forged = other.sign(foreign, KEYS[1], kid="key-of-the-other")
        other.published = [KEYS[1]]
        assert pair.post(browser, asked, forged).status_code == REFUSED
        assert (signed_in(browser), other.key_fetches) == (False, 0)


def test_who_is_not_named_has_no_grades(pair: Joined) -> None:
    browser = pair.browser(**{"Sec-Fetch-Site": "same-origin"})
    asked = pair.begin(browser)
    services = {"scope": [f"{AGS_SCOPE}score"], "lineitem": f"{pair.platform.origin}/lineitem"}
    claims = pair.claims(asked, **{AGS: services, f"{CLAIM}custom": {"quiz": "small"}})
    del claims["sub"]
    assert pair.post(browser, asked, pair.platform.sign(claims)).status_code == ENTERED
    body = {"quiz": "small", "question": "q1", "answer": 1}
    assert browser.post(f"{API}/submissions", json=body).status_code == 201
    teacher = pair.site.client("tina", "instructor", pair.course)
    assert teacher.get(f"{API}/deliveries").json()["items"] == []


def test_states_are_of_one_browser_and_used_once(pair: Joined) -> None:
    browser, other = pair.browser(), pair.browser()
    asked = pair.begin(browser)
    token = pair.platform.sign(pair.claims(asked))
    assert pair.post(browser, asked | {"state": ""}, token).status_code == REFUSED
    assert pair.post(browser, asked | {"state": "unknown"}, token).status_code == REFUSED
    foreign = pair.post(other, asked, token)  # another browser is led to a login of its own
    assert (foreign.status_code, signed_in(other)) == (REFUSED, False)
    assert "Open in a new tab" in foreign.text
    pair.begin(other)
    assert pair.post(other, asked, token).status_code == REFUSED  # nor with a cookie of another login
    assert pair.post(browser, asked, token).status_code == ENTERED
    browser.cookies.delete(COOKIE)
    assert pair.post(browser, asked, token).status_code == REFUSED
    assert not signed_in(browser)


def test_a_nonce_is_good_for_its_own_login(pair: Joined) -> None:
    browser = pair.browser()
    first, second = pair.begin(browser), pair.begin(browser)
    assert pair.post(browser, second, pair.platform.sign(pair.claims(first))).status_code == REFUSED
    assert pair.post(browser, first, pair.platform.sign(pair.claims(first))).status_code == ENTERED


def test_logins_side_by_side_do_not_disturb_each_other(pair: Joined) -> None:
    browser = pair.browser()
    started = [pair.begin(browser) for _ in range(3)]  # a page with three frames
    for asked in started:
        assert pair.post(browser, asked, pair.platform.sign(pair.claims(asked))).status_code == ENTERED


def test_an_old_login_is_no_login(pair: Joined) -> None:
    browser = pair.browser()
    asked = pair.begin(browser)
    with pair.database.write() as session:
        from sqlalchemy import text

        session.execute(text("UPDATE tickets SET expires_at = '2020-01-01 00:00:00'"))
    assert pair.post(browser, asked, pair.platform.sign(pair.claims(asked))).status_code == REFUSED


def test_a_platforms_error_is_told_plainly(pair: Joined) -> None:
    browser = pair.browser()
    asked = pair.begin(browser)
    refused = browser.post("/lti/launch", data={"state": asked["state"], "error": "login_required"})
    assert refused.status_code == REFUSED
    assert "did not sign you in" in refused.text


ROLES = {
    "Learner": ([LEARNER], "student"),
    "Instructor": ([INSTRUCTOR], "instructor"),
    "TeachingAssistant": ([f"{ROLE}/Instructor#TeachingAssistant"], "instructor"),
    "TeachingAssistant, principal": ([f"{ROLE}#TeachingAssistant"], "instructor"),
    "simple name": (["Instructor"], "instructor"),
    "Instructor of the institution": ([INSTITUTION, LEARNER], "student"),
    "Instructor of the institution alone": ([INSTITUTION], "student"),
    "administrator of the system": (["http://purl.imsglobal.org/vocab/lis/v2/system/person#Administrator"], "student"),
    "Mentor": ([f"{ROLE}#Mentor"], "student"),
    "look-alike": (["http://evil.example/membership#Instructor"], "student"),
}


@pytest.mark.parametrize("name", ROLES)
def test_a_role_in_the_course_is_the_role_here(pair: Joined, name: str) -> None:
    roles, expected = ROLES[name]
    browser = pair.browser(**{"Sec-Fetch-Site": "same-origin"})
    entered = pair.launch(browser, **{"sub": f"user {name}", f"{CLAIM}roles": roles})
    assert entered.headers["location"] == ("/instructor" if expected == "instructor" else "/")
    assert browser.get(f"{API}/members").status_code == (200 if expected == "instructor" else 403)


def test_who_is_not_named_is_no_instructor(pair: Joined) -> None:
    browser = pair.browser()
    asked = pair.begin(browser)
    claims = pair.claims(asked, **{f"{CLAIM}roles": [INSTRUCTOR]})
    del claims["sub"]
    assert pair.post(browser, asked, pair.platform.sign(claims)).headers["location"] == "/"
    assert browser.get(f"{API}/members").status_code == 403


LOGINS: dict[str, tuple[dict[str, str | None], int]] = {
    "right": ({}, 303),
    "without client id": ({"client_id": None}, 303),
    "without message hint": ({"lti_message_hint": None}, 303),
    "unknown issuer": ({"iss": "https://evil.example"}, 401),
    "no issuer": ({"iss": None}, 401),
    "unknown client": ({"client_id": "other"}, 401),
    "no hint": ({"login_hint": None}, 422),
    "empty hint": ({"login_hint": ""}, 422),
    "no target": ({"target_link_uri": None}, 422),
    "foreign target": ({"target_link_uri": "https://evil.example/lti/launch"}, 422),
    "target with javascript": ({"target_link_uri": "javascript:alert(1)"}, 422),
    "long hint": ({"login_hint": "x" * (FIELD_CHARACTERS_MAX + 1)}, 422),
    "parameter injection": ({"login_hint": "7&redirect_uri=https://evil.example&scope=x#y"}, 303),
    "line break": ({"login_hint": "7\r\nSet-Cookie: a=b"}, 422),
}


@pytest.mark.parametrize("method", ["GET", "POST"])
@pytest.mark.parametrize("name", LOGINS)
def test_a_login(pair: Joined, name: str, method: str) -> None:
    changes, expected = LOGINS[name]
    fields = pair.platform.login(pair.site.origin, **changes)
    browser = pair.browser(**{"Sec-Fetch-Site": "cross-site"})
    begun = browser.request(method, "/lti/login", **{"params" if method == "GET" else "data": fields})  # type: ignore[arg-type]
    assert begun.status_code == expected, begun.text
    if expected == 303:
        asked = pair.platform.read_authentication_request(begun.headers["location"], pair.site.origin)
        assert asked["login_hint"] == fields["login_hint"]
        assert asked.get("lti_message_hint") == fields.get("lti_message_hint")


def test_a_parameter_given_twice_is_refused(pair: Joined) -> None:
    fields: list[tuple[str, Any]] = [*pair.platform.login(pair.site.origin).items(), ("iss", "https://evil.example")]
    assert pair.browser().get("/lti/login", params=fields).status_code == 422
    browser = pair.browser()
    asked = pair.begin(browser)
    token = pair.platform.sign(pair.claims(asked))
    twice = httpx.QueryParams([("state", asked["state"]), ("id_token", token), ("state", "other")])
    headers = {"Content-Type": "application/x-www-form-urlencoded"}
    assert browser.post("/lti/launch", content=str(twice), headers=headers).status_code == 422
