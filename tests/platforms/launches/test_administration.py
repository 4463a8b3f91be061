"""Administering platforms: by command line, page and API; registered by hand or by themselves."""

import json
import re
import secrets
from collections.abc import Iterator
from datetime import timedelta
from html import unescape
from pathlib import Path
from typing import Any

import httpx
import pytest
from structlog.testing import capture_logs
from typer.testing import CliRunner

from grader.commands.main import cli
from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.platforms.tool import MISSING
from grader.service import app as grader_app
from grader.settings import Settings
from grader.store import platforms, tickets
from grader.store.engine.database import Database
from grader.store.platforms import PENDING_MAX
from grader.store.tables import now
from grader.store.upkeep import pruning
from platforms.joined import Joined, joined_in
from platforms.platform import CLAIM, Platform, get_json, running_platform
from support.databases import BACKENDS, database_url
from support.sites import open_site, write_content

API = "/api/v1"
OURS = {"Sec-Fetch-Site": "same-origin"}
BY_HAND = {
    "name": "Moodle", "issuer": "https://moodle.example", "login_url": "https://moodle.example/mod/lti/auth.php",
    "token_url": "https://moodle.example/mod/lti/token.php", "keys_url": "https://moodle.example/mod/lti/certs.php",
}  # fmt: skip


@pytest.fixture
def other() -> Iterator[Platform]:
    """A platform that is not registered."""
    with running_platform() as platform:
        yield platform


def by_hand(**changes: Any) -> dict[str, Any]:
    return {**BY_HAND, "client_id": secrets.token_hex(4), **changes}


def instructor_page(pair: Joined, course: str = "default") -> httpx.Client:
    """A browser in which an instructor is signed in."""
    browser = pair.browser(**OURS)
    with pair.database.write() as session:
        code = create_sign_in_code(session, "root", Role.INSTRUCTOR, course)
    assert browser.post("/signin", data={"code": code}).status_code == 303
    return browser


def registration_link(pair: Joined) -> str:
    admin = pair.site.client("root", "instructor", "default")
    url: str = admin.post(f"{API}/lti/registrations").json()["url"]
    return url.removeprefix(pair.site.origin)


def fields_of(page: httpx.Response) -> dict[str, str]:
    return {
        name: unescape(value) for name, value in re.findall(r'type="hidden" name="(\w+)" value="([^"]*)"', page.text)
    }


# dynamic registration


def test_a_platform_registers_itself_and_waits_for_approval(pair: Joined, other: Platform) -> None:
    configuration = f"{other.origin}/.well-known/openid-configuration"
    query = {"openid_configuration": configuration, "registration_token": other.registration_token}
    browser, link = pair.browser(**OURS), registration_link(pair)
    for _ in range(2):  # looking registers nothing
        page = browser.get(f"{link}&{httpx.QueryParams(query)}")
        assert page.status_code == 200
        assert f"frame-ancestors 'self' {other.origin}" in page.headers["content-security-policy"]
    assert other.registrations == []
    done = browser.post("/lti/register", data=fields_of(page))
    assert "waits for approval" in done.text
    [told] = other.registrations
    origin = pair.site.origin
    assert (told["initiate_login_uri"], told["jwks_uri"]) == (f"{origin}/lti/login", f"{origin}/lti/keys.json")
    assert told["redirect_uris"] == [f"{origin}/lti/launch"]
    tool = told["https://purl.imsglobal.org/spec/lti-tool-configuration"]
    assert {message["type"] for message in tool["messages"]} == {
        "LtiResourceLinkRequest", "LtiDeepLinkingRequest", "LtiSubmissionReviewRequest",
    }  # fmt: skip
    assert "email" not in tool["claims"]
    assert browser.post("/lti/register", data=fields_of(page)).status_code == 401  # once
    assert browser.get(f"{link}&{httpx.QueryParams(query)}").status_code == 401
    begin = browser.get("/lti/login", params=other.login(origin))
    assert (begin.status_code, "waits for approval" in begin.text) == (401, True)
    admin = pair.site.client("root", "instructor", "default")
    [made] = [item for item in get_json(admin, f"{API}/lti/platforms")["items"] if item["issuer"] == other.origin]
    assert (made["approved"], made["origins"]) == (False, [other.origin])
    assert made["deployments"] == [{"deployment_id": other.deployment_id, "approved": False}]
    assert admin.post(f"{API}/lti/platforms/{made['id']}:approve").json()["approved"]
    assert browser.get("/lti/login", params=other.login(origin)).status_code == 303
    assert admin.delete(f"{API}/lti/platforms/{made['id']}").status_code == 204
    assert browser.get("/lti/login", params=other.login(origin)).status_code == 401


@pytest.mark.parametrize(
    ("configured", "told"),
    [
        ({"issuer": "https://evil.example"}, "another host"),
        ({"issuer": None}, "another host"),
        ({"jwks_uri": "http://evil.example/keys"}, "jwks_uri"),
        ({"token_endpoint": "file:///etc/passwd"}, "token_endpoint"),
        ({"authorization_endpoint": "https://user@evil.example/"}, "authorization_endpoint"),
        ({"registration_endpoint": None}, "registration_endpoint"),
        ({"registration_endpoint": "https://169.254.169.254/latest"}, "cannot be reached"),
    ],
)
def test_a_configuration_that_cannot_be_right_is_refused(
    pair: Joined, other: Platform, configured: dict[str, Any], told: str
) -> None:
    other.configured = configured
    token = registration_link(pair).partition("token=")[2]
    form = {"token": token, "openid_configuration": f"{other.origin}/.well-known/openid-configuration"}
    refused = pair.browser(**OURS).post("/lti/register", data=form)
    assert refused.status_code == 422
    assert told in refused.text
    other.configured = {"client_name": "right again"}
    again = pair.browser(**OURS).post("/lti/register", data={**form, "registration_token": other.registration_token})
    assert again.status_code == (401 if configured.get("registration_endpoint") else 200), "a failure before used it up"


def test_a_platform_that_refuses_is_not_registered(pair: Joined, other: Platform) -> None:
    token = registration_link(pair).partition("token=")[2]
    form = {
        "token": token, "openid_configuration": f"{other.origin}/.well-known/openid-configuration",
        "registration_token": "wrong",
    }  # fmt: skip
    refused = pair.browser(**OURS).post("/lti/register", data=form)
    assert (refused.status_code, "401" in refused.text) == (422, True)


def registers(pair: Joined, other: Platform) -> httpx.Response:
    """The answer to the form of a registration with a new link."""
    form = {
        "token": registration_link(pair).partition("token=")[2],
        "openid_configuration": f"{other.origin}/.well-known/openid-configuration",
        "registration_token": other.registration_token,
    }
    return pair.browser(**OURS).post("/lti/register", data=form)


def test_the_platforms_reason_is_told_and_logged(pair: Joined, other: Platform) -> None:
    why = "Tool domain <b>not</b> allowed."
    other.refusal = {"error": "invalid_client_metadata", "error_description": why}
    with capture_logs() as logs:
        page = registers(pair, other)
    told = f"The platform refuses the registration: it answers 400, invalid_client_metadata: {why}"
    assert (page.status_code, told in unescape(page.text), "<b>not" in page.text) == (422, True, False)
    assert [(log["event"], log["why"]) for log in logs if "why" in log] == [("a registration was refused", told)]
    other.refusal = {"error": ["x"], "error_description": "y\n" * 5000}
    page = registers(pair, other)
    assert (page.status_code, "it answers 400, y" in page.text, len(page.text) < 5000) == (422, True, True)


def test_ids_may_be_numbers(pair: Joined, other: Platform) -> None:
    other.registered = {
        "client_id": 10000000000001,
        "https://purl.imsglobal.org/spec/lti-tool-configuration": {"deployment_id": 7},
    }
    assert registers(pair, other).status_code == 200
    admin = pair.site.client("root", "instructor", "default")
    [made] = [item for item in get_json(admin, f"{API}/lti/platforms")["items"] if item["issuer"] == other.origin]
    assert made["client_id"] == "10000000000001"
    assert made["deployments"] == [{"deployment_id": "7", "approved": False}]
    for wrong in (None, True, ["x"], 1.5):
        other.registered = {"client_id": wrong}
        page = registers(pair, other)
        assert (page.status_code, "no client_id" in page.text) == (422, True)


def test_an_answer_that_is_too_large_is_called_so(pair: Joined, other: Platform) -> None:
    other.registered = {"much": "x" * 1_000_001}
    page = registers(pair, other)
    assert (page.status_code, "answer to the registration is too large" in unescape(page.text)) == (422, True)
    other.configured = other.registered
    page = registers(pair, other)
    assert (page.status_code, "platform's configuration is too large" in unescape(page.text)) == (422, True)


def test_registration_needs_a_link(pair: Joined, other: Platform) -> None:
    query = {"token": "guessed", "openid_configuration": f"{other.origin}/.well-known/openid-configuration"}
    assert pair.browser().get("/lti/register", params=query).status_code == 401
    assert pair.browser(**OURS).post("/lti/register", data=query).status_code == 401
    for missing in ("", "&openid_configuration=nowhere"):
        opened = pair.browser().get(registration_link(pair) + missing)
        assert (opened.status_code, "openid_configuration" in opened.text) == (422, True)


# API


def test_one_deployment_is_approved_alone(pair: Joined) -> None:
    admin = pair.site.client("root", "instructor", "default")
    made = admin.post(f"{API}/lti/platforms", json=by_hand(deployment_id="a")).json()
    path = f"{API}/lti/platforms/{made['id']}:approve"
    with pair.database.write() as session:
        platforms.note_deployment(session, made["id"], "b")
    bodies: list[Any] = [
        {"deployment": "zz"},
        {"deployment_id": ""},
        {"deployment_id": 7},
        {"deployment_id": "x" * 256},
        [],
    ]
    for wrong in bodies:
        assert admin.post(path, json=wrong).status_code == 422, wrong
    shown = admin.post(path, json={"deployment_id": "b"}).json()
    assert shown["approved"]
    assert {one["deployment_id"]: one["approved"] for one in shown["deployments"]} == {"a": False, "b": True}
    assert all(one["approved"] for one in admin.post(path, json={}).json()["deployments"])


def test_platforms_belong_to_the_installation(pair: Joined) -> None:
    elsewhere = pair.site.client("tina", "instructor", pair.course)
    for method, path in (("GET", "platforms"), ("POST", "registrations"), ("POST", "platforms/1:approve"),
                         ("DELETE", "platforms/1")):  # fmt: skip
        assert elsewhere.request(method, f"{API}/lti/{path}").status_code == 403
    assert elsewhere.post(f"{API}/lti/platforms", json=by_hand()).status_code == 403
    assert pair.site.client("ann", "student", "default").get(f"{API}/lti/platforms").status_code == 403
    admin = pair.site.client("root", "instructor", "default")
    token = admin.post(f"{API}/tokens", json={"user": "x", "role": "instructor", "scopes": ["people"]}).json()["token"]
    restricted = pair.site.anonymous({"Authorization": f"Bearer {token}"})
    assert restricted.get(f"{API}/lti/contexts").status_code == 403  # a link makes instructors


@pytest.mark.parametrize(
    "changes",
    [
        {"login_url": "http://moodle.example/auth"},
        {"keys_url": "javascript:alert(1)"},
        {"token_url": "https://user:word@moodle.example/token"},
        {"token_url": ""},
        {"issuer": ""},
        {"issuer": "moodle.example"},
        {"issuer": "x" * 300},
        {"origins": ["https://moodle.example/path"]},
        {"origins": ["*"]},
        {"origins": ["https://moodle.example; script-src *"]},
    ],
)
def test_a_platform_with_faults_is_refused(pair: Joined, changes: dict[str, Any]) -> None:
    admin = pair.site.client("root", "instructor", "default")
    refused = admin.post(f"{API}/lti/platforms", json=by_hand(**changes))
    assert refused.status_code == 422, refused.text


def test_an_issuer_may_have_several_client_ids(pair: Joined) -> None:
    admin = pair.site.client("root", "instructor", "default")
    issuer = f"https://{secrets.token_hex(4)}.example"
    bodies = [by_hand(issuer=issuer) for _ in range(2)]
    made = [admin.post(f"{API}/lti/platforms", json=body).json() for body in bodies]
    assert admin.post(f"{API}/lti/platforms", json=bodies[0]).status_code == 409
    for one in made:
        admin.post(f"{API}/lti/platforms/{one['id']}:approve")
    fields = {"iss": issuer, "login_hint": "x", "target_link_uri": f"{pair.site.origin}/lti/launch"}
    browser = pair.browser()
    assert "client_id" in browser.get("/lti/login", params=fields).text
    begun = browser.get("/lti/login", params={**fields, "client_id": bodies[1]["client_id"]})
    assert f"client_id={bodies[1]['client_id']}" in begun.headers["location"]


def test_deployments_that_wait_are_bounded(pair: Joined) -> None:
    with pair.database.write() as session:
        [row] = platforms.find_registered(session, pair.platform.origin, pair.platform.client_id)
        for number in range(PENDING_MAX):
            platforms.note_deployment(session, row.id, f"new-{number}")
    assert pair.launch(pair.browser(), **{f"{CLAIM}deployment_id": "one more"}).status_code == 403
    with pair.database.read() as session:
        noted = platforms.list_deployments(session, row.id)
    assert sum(deployment.approved_at is None for deployment in noted) == PENDING_MAX
    assert "one more" not in {deployment.deployment_id for deployment in noted}


# page


def test_the_page_registers_approves_and_removes(pair: Joined) -> None:
    admin = instructor_page(pair)
    form = by_hand(name=f"Moodle {secrets.token_hex(3)}", origins="https://a.example https://b.example")
    assert admin.post("/instructor/lti/platforms", data=form).status_code == 303
    page = admin.get("/instructor/lti").text
    assert form["name"] in page
    client = pair.site.client("root", "instructor", "default")
    [made] = [item for item in get_json(client, f"{API}/lti/platforms")["items"] if item["name"] == form["name"]]
    assert made["origins"] == ["https://a.example", "https://b.example"]
    assert admin.post(f"/instructor/lti/platforms/{made['id']}/approve").status_code == 303
    again = admin.post("/instructor/lti/platforms", data=form)
    assert (again.status_code, "registered with this client id" in again.text) == (422, True)
    for typed in (form["client_id"], "https://a.example https://b.example"):
        assert f'value="{typed}"' in again.text, "what was typed is there to be corrected"
    refused = admin.post("/instructor/lti/platforms", data=form | {"login_url": "moodle.example"})
    assert "The authentication request URL (login_url) is an https address" in refused.text
    assert "/lti/register?token=" in admin.post("/instructor/lti/registration").text
    assert admin.post(f"/instructor/lti/platforms/{made['id']}/remove").status_code == 303
    assert form["name"] not in admin.get("/instructor/lti").text


def test_the_page_of_another_course_shows_its_own_links_alone(pair: Joined) -> None:
    teacher = instructor_page(pair, pair.course)
    page = teacher.get("/instructor/lti").text
    assert "Robotics" in page
    assert "Register a platform" not in page
    [context] = get_json(pair.site.client("tina", "instructor", pair.course), f"{API}/lti/contexts")["items"]
    assert "Names and Roles" in teacher.post(f"/instructor/lti/contexts/{context['id']}/roster").text
    stranger = instructor_page(pair, f"other-{secrets.token_hex(3)}")
    assert stranger.post(f"/instructor/lti/contexts/{context['id']}/unlink").status_code == 404
    assert stranger.post("/instructor/lti/platforms/1/remove").status_code == 403
    assert teacher.post(f"/instructor/lti/contexts/{context['id']}/unlink").status_code == 303
    assert "Robotics" not in teacher.get("/instructor/lti").text
    assert pair.browser().get("/instructor/lti").status_code == 401


# command line


@pytest.mark.slow
def test_the_command_line_goes_the_whole_way(tmp_path: Path) -> None:
    def grader(*words: str) -> str:
        done = CliRunner().invoke(cli, ["lti", *words, "--data", str(tmp_path)], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        return done.output.strip()

    assert "/lti/login" in grader("addresses")
    given = by_hand(frame_origin="https://a.example", deployment="7")
    options = [word for name, value in given.items() for word in (f"--{name.replace('_', '-')}", value)]
    assert grader("add", *options) == "1"
    assert "waits for approval" in grader("list")
    grader("approve", "1")
    [platform] = json.loads(grader("list", "--json"))["platforms"]
    assert platform["approved"]
    assert platform["origins"] == ["https://a.example"]
    assert platform["deployments"] == [{"deployment_id": "7", "approved": True}]
    assert grader("rotate-keys") != grader("rotate-keys")
    assert "/lti/register?token=" in grader("register-link")
    grader("remove", "1")
    assert grader("list") == ""


@pytest.mark.slow
def test_a_course_is_linked_and_its_roster_pulled_by_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GRADER_PRIVATE_HOSTS", '["127.0.0.1"]')
    with joined_in(tmp_path) as joined:
        platform = joined.platform
        platform.roster = [{"user_id": "u1", "name": "Ada", "roles": []}]
        service = {"context_memberships_url": f"{platform.origin}/roster/0"}
        nrps = "https://purl.imsglobal.org/spec/lti-nrps/claim/namesroleservice"
        assert joined.launch(joined.browser(), **{nrps: service}).status_code == 403
        data = ["--data", str(joined.site.settings.data)]
        for words in (["link", "1", "--course", "robots"], ["roster", "1"]):
            done = CliRunner().invoke(cli, ["lti", *words, *data], catch_exceptions=False)
            assert done.exit_code == 0, done.output
        assert done.output.startswith("1 members")
        assert joined.launch(joined.browser()).status_code == 303
        CliRunner().invoke(cli, ["lti", "unlink", "1", *data], catch_exceptions=False)
        assert joined.launch(joined.browser()).status_code == 403


# without the packages


@pytest.mark.slow
def test_without_its_packages_the_service_runs_and_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grader_app, "is_installed", lambda: False)
    settings = Settings(content=write_content(tmp_path / "content"), data=tmp_path, workers=0)
    with open_site(settings) as site:
        for path in ("/lti/keys.json", "/lti/login", "/lti/canvas.json"):
            refused = site.anonymous().get(path)
            assert (refused.status_code, refused.json()["detail"]) == (404, MISSING)
        assert site.anonymous().get("/healthz").status_code == 200
        admin = site.client("root", "instructor", "default")
        assert admin.post(f"{API}/lti/registrations").json()["detail"] == MISSING


# tickets


@pytest.mark.parametrize("backend", BACKENDS)
def test_tickets_are_used_once_expire_and_are_bounded(
    backend: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tickets, "TICKETS_MAX", 20)
    with database_url(backend, tmp_path) as url:
        database = Database(url)
        database.migrate()
        with database.write() as session:
            secret = tickets.issue(session, "a", {"n": 1}, timedelta(minutes=1))
            assert tickets.peek(session, "b", secret) is None
            assert tickets.take(session, "b", secret) is None
            assert tickets.peek(session, "a", secret) == {"n": 1}
            assert tickets.take(session, "a", secret) == {"n": 1}
            assert tickets.take(session, "a", secret) is None
            old = tickets.issue(session, "a", {}, timedelta(seconds=-1))
            assert tickets.peek(session, "a", old) is None
            kept = tickets.issue(session, "other", {}, timedelta(minutes=1))
            for _ in range(100):
                newest = tickets.issue(session, "a", {}, timedelta(minutes=1))
            assert session.query(tickets.Ticket).count() <= 22
            assert tickets.peek(session, "a", newest) == {}
            assert tickets.peek(session, "other", kept) == {}
            tickets.issue(session, "other", {}, timedelta(seconds=-1))
        assert pruning.expired_tickets(database, now()) == 1
        database.close()
