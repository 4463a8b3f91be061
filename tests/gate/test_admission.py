"""Admission: tokens, roles, hosts, origins, rates; every refusal is a problem document."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import httpx
import pytest
from pydantic import ValidationError

from grader.courses.people.identity import CredentialCache, CredentialKind, Identity, Role, issue
from grader.courses.people.members import get_named
from grader.errors import (
    CallerError,
    ContentError,
    GraderError,
    InvalidAnswer,
    JailFault,
    LabRefused,
    TooManyRequests,
    Unprocessable,
)
from grader.gate.admission import drop_escaped_cookies
from grader.gate.problems import STATUS, describe_problem
from grader.gate.rate import RateLimit, read_address
from grader.service.accounts import revoke_tokens, sign_in_url
from grader.settings import Settings
from grader.store.engine.database import Database
from support.sites import Site
from support.tokens import issue_token

API = "/api/v1"
ANSWER = {"quiz": "small", "question": "q1", "answer": 1}


def problem(response: httpx.Response) -> dict[str, Any]:
    """The body of a problem document, after checking its form."""
    assert response.headers["content-type"] == "application/problem+json"
    body: dict[str, Any] = response.json()
    assert body["status"] == response.status_code
    assert {"type", "title", "detail"} <= body.keys()
    return body


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/quizzes"),
        ("GET", "/quizzes/none"),
        ("GET", "/nothing/here"),
        ("GET", "/submissions?limit=x"),
        ("POST", "/submissions"),
        ("DELETE", "/submissions"),
        ("POST", "/content:reload"),
        ("GET", "/submissions/00/events"),
    ],
)
def test_without_a_token_everything_is_401(nobody: httpx.Client, method: str, path: str) -> None:
    response = nobody.request(method, API + path, content=b"{" if method == "POST" else None)
    assert response.status_code == 401
    assert response.headers["www-authenticate"] == "Bearer"
    problem(response)


@pytest.mark.parametrize(
    "header",
    ["", "Bearer", "Basic YTpi", "Bearer grt_0000000000000000_00", "Bearer \u00e9", "Bearer gri_a_b_c_d"],
)
def test_an_invalid_authorization_header_is_401(nobody: httpx.Client, header: str) -> None:
    response = nobody.get(f"{API}/quizzes", headers={b"Authorization": header.encode("latin-1")})
    assert response.status_code == 401


def test_a_token_is_valid_only_as_a_whole_and_until_it_is_revoked(site: Any) -> None:
    token = issue_token(site.settings, "ann", "student", None)
    assert len(token.split("_")[2]) == 64

    def status(presented: str) -> int:
        response = site.anonymous({"Authorization": f"Bearer {presented}"}).get(f"{API}/quizzes")
        return int(response.status_code)

    assert status(token) == 200
    assert status(token[:-1]) == 401
    assert status(token[:-1] + ("0" if token[-1] != "0" else "1")) == 401
    assert status(token.replace("grt_", "grs_")) == 401
    elsewhere = issue_token(site.settings, "ann", "student", "another course")
    assert revoke_tokens(site.settings, "ann", None) == 1
    assert (status(token), status(elsewhere)) == (401, 200)
    assert revoke_tokens(site.settings, "ann", None) == 0


def test_an_expired_token_is_401(site: Any) -> None:
    with site.app.state.services.database.write() as session:
        ann = get_named(session, "ann", Role.STUDENT)
        expiring = issue(session, CredentialKind.TOKEN, ann, timedelta(seconds=-1))
    response = site.anonymous({"Authorization": f"Bearer {expiring}"}).get(f"{API}/quizzes")
    assert response.status_code == 401


def test_no_secret_is_kept(site: Any) -> None:
    token = issue_token(site.settings, "ann", "student", None)
    site.anonymous({"Authorization": f"Bearer {token}"}).get(f"{API}/quizzes")
    kept = b"".join(path.read_bytes() for path in site.settings.data.iterdir())
    assert token.split("_")[1].encode() in kept
    assert token.split("_")[2].encode() not in kept


@pytest.mark.parametrize(
    ("user", "role", "course"),
    [
        ("", "student", None),
        ("ann", "king", None),
        ("a\nb", "student", None),
        ("a" * 201, "student", None),
        ("ann", "student", ""),
    ],
)
def test_a_token_needs_a_name_and_a_role(settings: Settings, user: str, role: str, course: str | None) -> None:
    with pytest.raises(Unprocessable):
        issue_token(settings, user, role, course)


@pytest.fixture
def settings(site: Any) -> Settings:
    chosen: Settings = site.settings
    return chosen


def test_the_wrong_role_is_403(site: Any, ann: httpx.Client, teacher: httpx.Client) -> None:
    robot = site.client("lms", "service")
    assert problem(ann.post(f"{API}/content:reload"))["status"] == 403
    assert problem(robot.post(f"{API}/submissions", json=ANSWER))["status"] == 403
    assert problem(robot.post(f"{API}/submissions", json={}))["status"] == 403
    assert problem(robot.get(f"{API}/submissions"))["status"] == 403
    assert robot.get(f"{API}/quizzes").status_code == 200
    assert teacher.post(f"{API}/submissions", json=ANSWER).status_code == 201


@pytest.mark.parametrize(
    "path", ["/nothing", f"{API}/nothing", f"{API}", f"{API}/quizzes/", f"{API}/quizzes/none", "/.env"]
)
def test_an_unknown_path_is_404(ann: httpx.Client, path: str) -> None:
    assert problem(ann.get(path))["status"] == 404


@pytest.mark.parametrize("path", ["/join?code=a%00b", "/instructor/learners/%00", f"{API}/members/a%00b"])
def test_an_address_with_nul_is_refused_on_both_databases(either_site: Site, path: str) -> None:
    for client in (either_site.client("tina", "instructor"), either_site.anonymous()):
        for method in ("GET", "DELETE"):
            assert client.request(method, path).status_code in {401, 422}


def test_a_form_and_a_body_with_nul_are_no_fault_of_ours(either_site: Site) -> None:
    form = {"Content-Type": "application/x-www-form-urlencoded", "Sec-Fetch-Site": "same-origin"}
    assert either_site.anonymous(form).post("/join", content="code=a%00b&name=Eve").status_code == 403
    teacher = either_site.client("tina", "instructor")
    assert problem(teacher.post(f"{API}/invitations", json={"member": "a\0b"}))["status"] == 422


def test_a_refusal_is_short_however_long_the_unknown_key_is(ann: httpx.Client) -> None:
    refused = ann.post(f"{API}/submissions", json={"k" * 100_000: 1, **ANSWER})
    assert (problem(refused)["status"], len(refused.content) < 1000) == (422, True)


def test_an_unknown_method_is_405_and_lists_the_allowed_ones(ann: httpx.Client) -> None:
    refused = ann.delete(f"{API}/submissions")
    assert problem(refused)["status"] == 405
    assert refused.headers["allow"] == "GET, HEAD, POST"
    assert ann.put(f"{API}/submissions/00", json={}).headers["allow"] == "GET, HEAD"
    for path, allowed in (("/", "GET, HEAD"), ("/quizzes/small/q1", "GET, HEAD, POST"), ("/openapi.json", "GET, HEAD")):
        refused = ann.options(path)
        assert (refused.status_code, refused.headers["allow"]) == (405, allowed)
    assert problem(ann.post("/healthz"))["status"] == 405


def test_an_unexpected_error_is_500_without_details(
    site: Any, ann: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("a path /srv/secret and a token grt_1")

    monkeypatch.setattr("grader.api.learning.quizzes.summarise_quiz", broken)
    body = problem(ann.get(f"{API}/quizzes"))
    assert body["status"] == 500
    assert "secret" not in str(body)


def kinds_of(error: type[GraderError]) -> set[type[GraderError]]:
    """All subclasses, at any depth."""
    return {kind for child in error.__subclasses__() for kind in (child, *kinds_of(child))}


def test_every_error_of_a_caller_has_one_status() -> None:
    assert STATUS.keys() == kinds_of(CallerError) | {ContentError, InvalidAnswer, LabRefused}
    assert all(400 <= status < 500 for status in STATUS.values())


def test_an_error_that_is_not_the_callers_has_no_problem_document() -> None:
    with pytest.raises(JailFault):
        describe_problem(JailFault("broken"))


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "[", "", "a b"])
def test_another_host_name_is_refused(nobody: httpx.Client, host: str) -> None:
    told = problem(nobody.get("/healthz", headers={"Host": host}))
    assert (told["status"], "GRADER_ALLOWED_HOSTS" in told["detail"]) == (421, True)


@pytest.mark.parametrize("host", ["localhost", "localhost:8000", "127.0.0.1", "[::1]:8000"])
def test_every_loopback_name_is_accepted(nobody: httpx.Client, host: str) -> None:
    assert nobody.get("/healthz", headers={"Host": host}).status_code == 200


def test_a_user_over_the_rate_limit_gets_429_and_others_do_not(open_site_with: Callable[..., Any]) -> None:
    site = open_site_with(rate_per_s=0.5, rate_burst=3)
    ann, bob = site.client("ann"), site.client("bob")
    statuses = [ann.get(f"{API}/quizzes").status_code for _ in range(3)]
    assert statuses == [200, 200, 200]
    refused = ann.get(f"{API}/quizzes")
    assert problem(refused)["status"] == 429
    assert refused.headers["retry-after"] == "2"
    assert bob.get(f"{API}/quizzes").status_code == 200
    assert site.anonymous().get("/healthz").status_code == 200


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/", 200),
        ("GET", "/instructor", 401),
        ("GET", "/healthz", 200),
        ("GET", "/readyz", 503),
        ("GET", "/openapi.json", 200),
        ("GET", "/static/style.css", 200),
        ("GET", "/favicon.ico", 200),
        ("GET", "/nothing", 404),
        ("GET", "/signin", 401),
        ("POST", "/signin", 401),
        ("GET", f"{API}/quizzes", 401),
        ("POST", f"{API}/labs:run", 401),
    ],
)
def test_every_route_has_a_rate_limit_without_a_session_too(
    open_site_with: Callable[..., Any], method: str, path: str, status: int
) -> None:
    site = open_site_with(address_rate_per_s=0.01, address_rate_burst=2)
    ann = site.client("ann")
    assert [site.anonymous().request(method, path).status_code for _ in range(2)] == [status, status]
    refused = site.anonymous().request(method, path, headers={"Authorization": "Bearer grt_1_2"})
    assert problem(refused)["status"] == 429
    assert 0 < int(refused.headers["retry-after"]) <= 100
    assert ann.get(f"{API}/quizzes").status_code == 200


def begun(site: Any) -> httpx.Client:
    """A browser whose anonymous session has begun."""
    browser: httpx.Client = site.anonymous({"Sec-Fetch-Site": "same-origin"})
    assert browser.post("/session").status_code in (200, 201, 204, 303)
    return browser


@pytest.mark.slow
def test_pages_of_a_signed_in_learner_count_for_the_learner(open_site_with: Callable[..., Any]) -> None:
    site = open_site_with(rate_per_s=0.01, rate_burst=3, address_rate_per_s=0.01, address_rate_burst=3)
    ann, bob = begun(site), begun(site)
    assert [ann.get("/static/style.css").status_code for _ in range(4)] == [200, 200, 200, 429]
    assert bob.get("/").status_code == 200
    assert site.anonymous().get("/").status_code == 200


def test_a_body_outside_the_api_counts_by_its_size(open_site_with: Callable[..., Any]) -> None:
    site = open_site_with(rate_per_s=0.01, rate_burst=50)
    ann = begun(site)
    form = b"x" * 40 * 1024
    assert [ann.post("/signin", content=form).status_code for _ in range(3)] == [401, 401, 429]
    bob = begun(site)
    assert [bob.post("/signin", content=iter([b"x"])).status_code for _ in range(2)] == [401, 429]
    cem = begun(site)
    assert cem.post("/signin", content=b"x" * 65 * 1024).status_code == 413


@pytest.mark.parametrize(
    ("client", "key"),
    [
        (("192.0.2.7", 1), "192.0.2.7"),
        (("2001:db8:1:2:3:4:5:6", 1), "2001:db8:1:2::/64"),
        (("2001:db8:1:2::9", 1), "2001:db8:1:2::/64"),
        (("::ffff:192.0.2.7", 1), "192.0.2.7"),
        (("fe80::1%eth0", 1), "fe80::/64"),
        (("no address", 0), ""),
        (None, ""),
    ],
)
def test_an_address_is_one_ipv4_address_or_one_ipv6_network(client: tuple[str, int] | None, key: str) -> None:
    assert read_address({"type": "http", "client": client}) == key


@pytest.mark.parametrize(("trusted", "statuses"), [((), [200, 429]), (("127.0.0.0/8",), [200, 200])])
def test_a_forwarded_address_is_believed_of_trusted_proxies_only(
    open_site_with: Callable[..., Any], trusted: tuple[str, ...], statuses: list[int]
) -> None:
    site = open_site_with(address_rate_per_s=0.01, address_rate_burst=1, trusted_proxies=trusted)
    sent = [{"X-Forwarded-For": f"203.0.113.1, 192.0.2.{n}"} for n in (1, 2)]
    assert [site.anonymous(headers).get("/healthz").status_code for headers in sent] == statuses


def test_a_cookie_with_backslashes_is_dropped_before_it_is_parsed(nobody: httpx.Client) -> None:
    cookies = b'a="' + b"\\" * 50_000 + b'"; b=1'
    scope = {"type": "http", "headers": [(b"host", b"x"), (b"cookie", cookies)]}
    drop_escaped_cookies(scope)
    assert scope["headers"] == [(b"host", b"x"), (b"cookie", b" b=1")]
    nobody.post("/session", headers={"Sec-Fetch-Site": "same-origin"})
    session = "; ".join(f"{name}={value}" for name, value in nobody.cookies.items())
    response = nobody.get(f"{API}/quizzes", headers={b"Cookie": cookies + b"; " + session.encode()})
    assert response.status_code == 200


def test_a_bucket_fills_again() -> None:
    clock = [0.0]
    limit = RateLimit(2.0, 2, lambda: clock[0])
    limit.spend("ann")
    limit.spend("ann")
    with pytest.raises(TooManyRequests):
        limit.spend("ann")
    clock[0] = 0.5
    limit.spend("ann")
    with pytest.raises(TooManyRequests):
        limit.spend("ann")


@pytest.mark.parametrize("processes", [1, 4])
def test_the_default_rate_is_above_thirty_a_second_for_each_of_fifty(processes: int) -> None:
    settings = Settings(database_url="postgresql://localhost/x", processes=processes)
    clock = [0.0]
    limit = RateLimit(settings.share(settings.rate_per_s), settings.share(settings.rate_burst), lambda: clock[0])
    for _ in range(60):
        for user in range(50):
            for _ in range(30):
                limit.spend(user)
        clock[0] += 1.0


def test_beginning_on_loopback_lets_a_learner_answer_at_once(nobody: httpx.Client) -> None:
    page = nobody.get("/")
    assert page.status_code == 200
    assert "set-cookie" not in page.headers
    same_origin = {"Sec-Fetch-Site": "same-origin"}
    cookie = nobody.post("/session", headers=same_origin).headers["set-cookie"]
    assert cookie.startswith("grader_session=grs_")
    assert "; HttpOnly; SameSite=Lax" in cookie
    made = nobody.post(f"{API}/submissions", json=ANSWER, headers=same_origin)
    assert made.status_code == 201
    assert made.json()["user"].startswith("learner-")
    assert "set-cookie" not in nobody.post("/session", headers=same_origin).headers
    assert [item["id"] for item in nobody.get(f"{API}/submissions").json()["items"]] == [made.json()["id"]]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Sec-Fetch-Site": "same-origin"}, 201),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "same-site"}, 403),
        ({"Sec-Fetch-Site": "cross-site", "Origin": "OWN"}, 403),
        ({"Origin": "OWN"}, 201),
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "x://HOST"}, 403),
        ({"Origin": "https://HOST"}, 403),
        ({"Origin": "http://127.0.0.1:1"}, 403),
        ({"Origin": "//HOST"}, 403),
        ({"Origin": "null"}, 403),
        ({}, 403),
    ],
)
def test_a_browser_may_write_from_our_own_pages_only(
    site: Any, nobody: httpx.Client, headers: dict[str, str], status: int
) -> None:
    nobody.post("/session", headers={"Sec-Fetch-Site": "same-origin"})
    host = site.origin.removeprefix("http://")
    told = {name: value.replace("OWN", site.origin).replace("HOST", host) for name, value in headers.items()}
    response = nobody.post(f"{API}/submissions", json=ANSWER, headers=told)
    assert response.status_code == status
    assert nobody.get(f"{API}/quizzes", headers=told).status_code == 200


def test_a_token_needs_no_origin_and_beats_the_cookie(site: Any, nobody: httpx.Client) -> None:
    nobody.post("/session", headers={"Sec-Fetch-Site": "same-origin"})
    token = issue_token(site.settings, "ann", "student", site.course)
    headers = {"Authorization": f"Bearer {token}", "Sec-Fetch-Site": "cross-site"}
    made = nobody.post(f"{API}/submissions", json=ANSWER, headers=headers)
    assert (made.status_code, made.json()["user"]) == (201, "ann")
    assert nobody.get(f"{API}/quizzes", headers={"Authorization": "Bearer wrong"}).status_code == 401


def test_the_instructor_signs_in_once(site: Any, nobody: httpx.Client) -> None:
    url = sign_in_url(site.settings)
    code = url.partition("code=")[2]
    path = "/signin?code=" + code
    assert nobody.get("/instructor").status_code == 401
    for _ in range(2):
        asked = nobody.get(path)
        assert (asked.status_code, asked.headers["cache-control"]) == (200, "no-store")
        assert "set-cookie" not in asked.headers
    form = {"Content-Type": "application/x-www-form-urlencoded", "Sec-Fetch-Site": "same-origin"}
    done = nobody.post("/signin", content=f"code={code}", headers=form)
    assert (done.status_code, done.headers["location"]) == (303, "/instructor")
    assert nobody.get("/instructor").status_code == 200
    assert nobody.post(f"{API}/content:reload", headers={"Sec-Fetch-Site": "same-origin"}).status_code == 200
    again = site.anonymous().post("/signin", content=f"code={code}", headers=form)
    assert (again.status_code, "set-cookie" in again.headers) == (401, False)
    out = nobody.post("/signout", headers={"Sec-Fetch-Site": "same-origin"})
    assert out.status_code == 303
    assert nobody.get(f"{API}/quizzes").status_code == 401


def test_a_form_from_elsewhere_does_not_sign_in(site: Any, nobody: httpx.Client) -> None:
    code = sign_in_url(site.settings).partition("code=")[2]
    refused = nobody.post("/signin", content=f"code={code}", headers={"Sec-Fetch-Site": "cross-site"})
    assert problem(refused)["status"] == 403


def test_markup_in_a_code_stays_text(nobody: httpx.Client) -> None:
    page = nobody.get("/signin", params={"code": '"><script>alert(1)</script>'})
    assert page.status_code == 401
    assert "<script>" not in page.text


def test_a_public_service_requires_sign_in_and_binds_cookies_to_its_host(
    open_site_with: Callable[..., Any],
) -> None:
    site = open_site_with(public_origin="https://grader.example")
    client = site.anonymous({"Host": "grader.example"})
    page = client.get("/")
    assert page.status_code == 401
    assert "set-cookie" not in page.headers
    code = sign_in_url(site.settings).partition("code=")[2]
    done = client.post("/signin", content=f"code={code}", headers={"Origin": "https://grader.example"})
    cookie = done.headers["set-cookie"]
    assert cookie.startswith("__Host-grader_session=grs_")
    assert cookie.endswith("; Path=/; HttpOnly; SameSite=Lax; Secure")
    session = {"Cookie": cookie.partition(";")[0]}
    foreign = client.post(f"{API}/content:reload", headers={**session, "Origin": "http://grader.example"})
    assert foreign.status_code == 403
    ours = client.post(f"{API}/content:reload", headers={**session, "Origin": "https://grader.example"})
    assert ours.status_code == 200


@pytest.mark.parametrize("origin", [None, "http://grader.example", "grader.example"])
def test_another_address_needs_an_https_origin(origin: str | None) -> None:
    with pytest.raises(ValidationError, match=r"public_origin|GRADER_PUBLIC_ORIGIN"):
        Settings(host="0.0.0.0", public_origin=origin)
    assert not Settings(host="0.0.0.0", public_origin="https://grader.example").is_local


def test_a_learner_who_answers_every_few_minutes_is_recalled() -> None:
    ann, now_s = Identity("1", "ann", Role.STUDENT, "default"), 0.0
    recalled = CredentialCache(clock=lambda: now_s)
    recalled.put("Bearer token", {}, ann)
    now_s = 240.0
    assert recalled.get("Bearer token", {}) == ann
    now_s = 300.0
    assert recalled.get("Bearer token", {}) is None


def test_when_a_token_was_last_used_is_known_without_a_wait_for_the_disk(
    site: Any, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    from grader.store.tables import Credential

    token = issue_token(settings, "ann", "student", None)
    write, writes = Database.write, list[bool]()

    def noted(database: Database, *, hasty: bool = False) -> Any:
        writes.append(hasty)
        return write(database, hasty=hasty)

    monkeypatch.setattr(Database, "write", noted)
    site.anonymous({"Authorization": f"Bearer {token}"}).get(f"{API}/quizzes")
    database: Database = site.app.state.services.database
    with database.read() as session:
        credential = session.get_one(Credential, token.split("_")[1])
        assert credential.last_used_at is not None
    assert writes == [True]
