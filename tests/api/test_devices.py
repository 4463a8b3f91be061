"""A program on a learner's own machine gets a token by the device flow, RFC 8628, and nobody else does."""

from datetime import timedelta
from typing import Any

import httpx
import pytest
from sqlalchemy import func, select, update

from grader.courses.people import devices, sign_in
from grader.courses.people.identity import Role, visible_part
from grader.courses.people.members import get_named
from grader.store.engine.database import Database
from grader.store.tables import Credential, Member, now
from grader.store.tickets import Ticket
from support.sites import Site

API = "/api/v1"
OURS = {"Sec-Fetch-Site": "same-origin"}
ANSWER = {"quiz": "small", "question": "q1", "answer": 1}
NAME = "Jupyter on ada's laptop"


def database_of(site: Site) -> Database:
    database: Database = site.app.state.services.database
    return database


def open_browser(site: Site, name: str, role: Role = Role.STUDENT) -> httpx.Client:
    """A browser in which a named member is signed in."""
    with database_of(site).write() as session:
        opened = sign_in.start_session(session, get_named(session, name, role, site.course))
    return site.anonymous({"Cookie": f"grader_session={opened.secret}", **OURS})


def begin(device: httpx.Client, name: str = NAME) -> dict[str, Any]:
    response = device.post(f"{API}/devices", json={"client_name": name})
    assert response.status_code == 200
    assert response.headers["cache-control"] == "no-store"
    codes: dict[str, Any] = response.json()
    return codes


def test_a_device_needs_no_name(site: Site) -> None:
    for begun in (site.anonymous().post(f"{API}/devices"), site.anonymous().post(f"{API}/devices", json={})):
        assert (begun.status_code, bool(begun.json()["user_code"])) == (200, True)


def ask(device: httpx.Client, codes: dict[str, Any]) -> tuple[int, dict[str, Any]]:
    response = device.post(f"{API}/devices:token", json={"device_code": codes["device_code"]})
    return response.status_code, response.json()


def refusal(device: httpx.Client, codes: dict[str, Any]) -> str:
    status, body = ask(device, codes)
    assert status == 400
    return str(body["error"])


def decide(browser: httpx.Client, code: str, decision: str = "allow") -> httpx.Response:
    return browser.post("/devices", data={"code": code, "decision": decision})


def token_of(device: httpx.Client, browser: httpx.Client) -> dict[str, Any]:
    codes = begin(device)
    assert decide(browser, codes["user_code"]).status_code == 303
    status, token = ask(device, codes)
    assert status == 200
    return token


def test_a_device_gets_a_token_once_its_owner_has_allowed_it(either_site: Site) -> None:
    device, ada = either_site.anonymous(), open_browser(either_site, "ada")
    codes = begin(device)
    assert codes["verification_uri"] == f"{either_site.origin}/devices"
    assert codes["verification_uri_complete"] == f"{either_site.origin}/devices?code={codes['user_code']}"
    assert refusal(device, codes) == "authorization_pending"
    shown = ada.get("/devices", params={"code": codes["user_code"].lower().replace("-", " ")}).text
    assert "Jupyter on ada&#39;s laptop" in shown
    assert codes["user_code"] in shown
    assert codes["device_code"] not in shown
    allowed = decide(ada, codes["user_code"]).headers["location"]
    assert allowed == "/devices?said=allowed"
    assert "None yet: the device stands here once it has fetched its access." in ada.get(allowed).text
    assert "No program has access" in ada.get("/devices").text
    status, token = ask(device, codes)
    assert (status, token["token_type"], token["scope"], token["user"]) == (200, "Bearer", "answer read", "ada")
    assert refusal(device, codes) == "expired_token"

    program = either_site.anonymous({"Authorization": f"Bearer {token['access_token']}"})
    made = program.post(f"{API}/submissions", json=ANSWER)
    assert (made.status_code, made.json()["user"]) == (201, "ada")
    assert program.get(f"{API}/submissions/{made.json()['id']}").status_code == 200
    assert program.get(f"{API}/quizzes").status_code == 200
    me = program.get(f"{API}/me").json()
    assert (me["user"], me["role"], me["course"]) == ("ada", "student", either_site.course)
    assert me["scopes"] == ["answer", "read"]
    assert ada.get(f"{API}/submissions/{made.json()['id']}").status_code == 200  # the work is the learner's own


def test_a_token_of_a_device_may_do_nothing_but_read_and_answer(site: Site) -> None:
    token = token_of(site.anonymous(), open_browser(site, "tina", Role.INSTRUCTOR))
    program = site.anonymous({"Authorization": f"Bearer {token['access_token']}"})
    for route in ("members", "tokens", "reviews", "gradebook.csv", "audit", "regrades"):
        assert program.get(f"{API}/{route}").status_code == 403
    assert program.post(f"{API}/tokens", json={"user": "x", "role": "student"}).status_code == 403
    assert program.get(f"{API}/content").status_code == 404  # no route: another token would not help


def test_hasty_questions_are_told_to_slow_down_and_to_wait_longer_each_time(site: Site) -> None:
    device = site.anonymous()
    codes = begin(device)
    assert [refusal(device, codes) for _ in range(3)] == ["authorization_pending", "slow_down", "slow_down"]
    with database_of(site).read() as session:
        bodies = session.scalars(select(Ticket.body).where(Ticket.purpose == devices.DEVICE)).all()
    assert any(f'"interval_s": {3 * devices.INTERVAL_S}' in body for body in bodies)
    decide(open_browser(site, "ada"), codes["user_code"])
    assert ask(device, codes)[0] == 200  # whoever was hasty gets the token all the same


def test_a_refused_device_gets_nothing(either_site: Site) -> None:
    device, ada = either_site.anonymous(), open_browser(either_site, "ada")
    codes = begin(device)
    assert decide(ada, codes["user_code"], "refuse").headers["location"] == "/devices?said=refused"
    assert refusal(device, codes) == "access_denied"
    assert refusal(device, codes) == "expired_token"


def test_a_code_is_used_once(either_site: Site) -> None:
    device, ada, bob = (either_site.anonymous(), *(open_browser(either_site, name) for name in ("ada", "bob")))
    codes = begin(device)
    decide(ada, codes["user_code"])
    assert decide(bob, codes["user_code"]).status_code == 404
    assert ask(device, codes)[1]["user"] == "ada"


def test_codes_end_after_ten_minutes(site: Site) -> None:
    device, ada = site.anonymous(), open_browser(site, "ada")
    codes = begin(device)
    with database_of(site).write() as session:
        session.execute(update(Ticket).values(expires_at=now() - timedelta(seconds=1)))
    assert devices.UNKNOWN in ada.get("/devices", params={"code": codes["user_code"]}).text
    assert decide(ada, codes["user_code"]).status_code == 404
    assert refusal(device, codes) == "expired_token"


def test_one_code_is_not_taken_for_the_other(site: Site) -> None:
    device, ada = site.anonymous(), open_browser(site, "ada")
    codes = begin(device)
    assert refusal(device, {"device_code": devices.read_code(codes["user_code"])}) == "expired_token"
    assert decide(ada, codes["device_code"]).status_code == 404


def test_guessing_codes_is_refused_after_a_few(site: Site) -> None:
    ada = open_browser(site, "ada")
    statuses = [decide(ada, f"BBBB-BB{a}{b}").status_code for a in devices.LETTERS for b in devices.LETTERS]
    assert 429 in statuses[: 2 * site.settings.rate_burst // 20]
    assert set(statuses) == {404, 429}


def test_a_member_who_was_removed_meanwhile_gives_no_token(site: Site) -> None:
    device, ada = site.anonymous(), open_browser(site, "ada")
    codes = begin(device)
    decide(ada, codes["user_code"])
    with database_of(site).write() as session:
        member = session.scalars(select(Member).where(Member.name == "ada", Member.course == site.course)).one()
        member.removed_at = now()
    assert refusal(device, codes) == "access_denied"


def test_a_member_who_became_an_instructor_meanwhile_gives_no_token(site: Site) -> None:
    device, ada = site.anonymous(), open_browser(site, "ada")
    codes = begin(device)
    decide(ada, codes["user_code"])
    tina = site.client("tina", "instructor")
    member = next(item["id"] for item in tina.get(f"{API}/members").json()["items"] if item["name"] == "ada")
    assert tina.patch(f"{API}/members/{member}", json={"role": "instructor"}).status_code == 200
    assert refusal(device, codes) == "access_denied"


def test_another_site_cannot_make_a_browser_allow_a_device(site: Site) -> None:
    device, ada = site.anonymous(), open_browser(site, "ada")
    codes = begin(device)
    forged = ada.post(
        "/devices",
        data={"code": codes["user_code"], "decision": "allow"},
        headers={"Sec-Fetch-Site": "cross-site", "Origin": "https://evil.example"},
    )
    assert forged.status_code == 403
    assert refusal(device, codes) == "authorization_pending"


def test_a_learner_lists_and_revokes_devices_of_their_own_alone(either_site: Site) -> None:
    ada, bob = (open_browser(either_site, name) for name in ("ada", "bob"))
    token = token_of(either_site.anonymous(), ada)
    token_id = token["access_token"].split("_")[1]
    assert "Jupyter on" in ada.get("/devices").text
    assert "Jupyter on" not in bob.get("/devices").text
    program = either_site.anonymous({"Authorization": f"Bearer {token['access_token']}"})
    assert bob.post(f"/devices/{token_id}/revoke").status_code == 404
    assert program.get(f"{API}/quizzes").status_code == 200
    assert ada.post(f"/devices/{token_id}/revoke").headers["location"] == "/devices?said=revoked"
    assert program.get(f"{API}/quizzes").status_code == 401
    assert "Jupyter on" not in ada.get("/devices").text


def test_a_token_of_a_device_ends_after_thirty_days_and_instructors_see_it(site: Site) -> None:
    tina = open_browser(site, "tina", Role.INSTRUCTOR)
    token = token_of(site.anonymous(), open_browser(site, "ada"))
    assert token["expires_in"] == 30 * 24 * 3600
    (row,) = [item for item in tina.get(f"{API}/tokens").json()["items"] if item["label"] == NAME]
    assert (row["name"], row["scopes"]) == ("ada", ["answer", "read"])
    with database_of(site).write() as session:
        session.execute(update(Credential).values(expires_at=now()).where(Credential.id == row["id"]))
    program = site.anonymous({"Authorization": f"Bearer {token['access_token']}"})
    assert program.get(f"{API}/quizzes").status_code == 401


def test_the_twenty_first_device_asks_to_revoke_one_first(site: Site) -> None:
    device, ada = site.anonymous(), open_browser(site, "ada")
    for _ in range(devices.DEVICES_MAX):
        token_of(device, ada)
    codes = begin(device)
    refused = decide(ada, codes["user_code"])
    assert refused.status_code == 409
    assert "revoke one" in refused.text
    assert refusal(device, codes) == "authorization_pending"


@pytest.mark.parametrize("name", ["", "\u202egnp.exe\n", "<b>x</b>", "x" * 200])
def test_what_a_device_calls_itself_is_text_on_one_line(site: Site, name: str) -> None:
    shown = open_browser(site, "ada").get("/devices", params={"code": begin(site.anonymous(), name)["user_code"]}).text
    assert "\u202e" not in shown
    assert "<b>x" not in shown
    assert ("A program" if not name else visible_part(name).replace("<", "&lt;").replace(">", "&gt;")) in shown


def test_whoever_is_not_signed_in_is_told_to_sign_in_and_keeps_the_code(site: Site) -> None:
    codes = begin(site.anonymous())
    browser = site.anonymous(OURS)
    shown = browser.get("/devices", params={"code": codes["user_code"]})
    assert (shown.status_code, codes["user_code"] in shown.text) == (401, True)
    begun = browser.post("/session", data={"code": codes["user_code"]})
    assert begun.headers["location"] == f"/devices?code={codes['user_code']}"
    assert decide(site.anonymous(OURS), codes["user_code"]).status_code == 401


def test_anyone_may_begin_also_with_a_token_that_has_ended(site: Site) -> None:
    assert begin(site.anonymous({"Authorization": "Bearer grt_0123456789abcdef_00"}))["interval"] == devices.INTERVAL_S


def test_what_is_stored_of_a_request_has_none_of_its_codes(site: Site) -> None:
    codes = begin(site.anonymous())
    with database_of(site).read() as session:
        rows = [(one.hash, one.body) for one in session.scalars(select(Ticket))]
        assert session.scalar(select(func.count()).select_from(Ticket)) == len(rows)
    text = repr(rows)
    assert codes["device_code"] not in text
    assert devices.read_code(codes["user_code"]) not in text
