"""Ways into a course, tokens with scopes, and the audit log, over HTTP and from the command line."""

import json
import re
import subprocess
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import delete, update
from sqlalchemy.exc import DBAPIError

from grader.courses.people.identity import Scope, check_name
from grader.courses.people.tokens import create_token
from grader.errors import Unprocessable
from grader.gate import openid
from grader.gate.scopes import find_scope
from grader.platforms.launching import launch
from grader.service.accounts import in_database, tell_addresses
from grader.settings import Settings
from grader.store.courses import AuditEntry
from grader.store.tables import Credential, now
from support.command_line import grader
from support.sites import Site

API = "/api/v1"
OURS = {"Sec-Fetch-Site": "same-origin"}
ANSWER = {"quiz": "small", "question": "q1", "answer": 1}


@pytest.fixture
def teacher(either_site: Site) -> httpx.Client:
    return either_site.client("tina", "instructor")


def items(client: httpx.Client, path: str) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = client.get(API + path).json()["items"]
    return items


def invite(teacher: httpx.Client, **body: Any) -> list[dict[str, Any]]:
    response = teacher.post(f"{API}/invitations", json=body)
    assert response.status_code == 201, response.text
    made: list[dict[str, Any]] = response.json()["items"]
    return made


def follow(site: Site, url: str) -> httpx.Client:
    """A browser that opens a link and presses its button."""
    browser = site.anonymous(OURS)
    assert url.startswith(f"{site.origin}/signin?code=")
    assert browser.get(url).status_code == 200
    browser.post("/signin", data={"code": url.partition("code=")[2]})
    return browser


def test_an_invited_learner_comes_in_once_and_hands_in(either_site: Site, teacher: httpx.Client) -> None:
    ada, bob = invite(teacher, names=["ada", "bob"])
    assert [one["name"] for one in items(teacher, "/invitations")] in (["bob", "ada"], ["ada", "bob"])
    for _ in range(3):
        shown = either_site.anonymous().get(ada["url"])
        assert "ada" in shown.text
        assert "set-cookie" not in shown.headers
    browser = follow(either_site, ada["url"])
    made = browser.post(f"{API}/submissions", json=ANSWER)
    assert (made.status_code, made.json()["user"], made.json()["learner"]) == (201, "ada", ada["member"])
    assert follow_fails(either_site, ada["url"])
    assert [one["name"] for one in items(teacher, "/invitations")] == ["bob"]
    assert made.json()["id"] in {one["id"] for one in items(either_site.client("ada"), "/submissions")}
    assert bob["member"] != ada["member"]


def follow_fails(site: Site, url: str) -> bool:
    browser = site.anonymous(OURS)
    used = browser.post("/signin", data={"code": url.partition("code=")[2]})
    return used.status_code == 401 and browser.get(url).status_code == 401


def test_a_second_instructor_comes_in_by_a_link(either_site: Site, teacher: httpx.Client) -> None:
    [made] = invite(teacher, names=["tom"], role="instructor")
    tom = follow(either_site, made["url"])
    assert tom.get("/instructor").status_code == 200
    assert {one["name"] for one in items(tom, "/members")} == {"tina", "tom"}


def test_an_invitation_ends_when_it_is_revoked_replaced_or_too_old(either_site: Site, teacher: httpx.Client) -> None:
    [first] = invite(teacher, names=["ada"])
    [second] = invite(teacher, member=first["member"])
    assert follow_fails(either_site, first["url"])
    assert teacher.delete(f"{API}/invitations/{second['id']}").status_code == 204
    assert teacher.delete(f"{API}/invitations/{second['id']}").status_code == 404
    assert follow_fails(either_site, second["url"])
    [third] = invite(teacher, names=["ada"])
    with either_site.app.state.services.database.write() as session:
        session.execute(update(Credential).where(Credential.id == third["id"]).values(expires_at=now()))
    assert follow_fails(either_site, third["url"])
    assert items(teacher, "/invitations") == []


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"names": []}, 422),
        ({"names": [""]}, 422),
        ({"names": ["a\nb"]}, 422),
        ({"names": ["ada", "ada"]}, 422),
        ({"names": ["ada"], "role": "king"}, 422),
        ({"names": ["ada"], "role": "service"}, 422),
        ({"names": ["ada"], "member": "x"}, 422),
        ({"member": "0" * 32}, 404),
    ],
)
def test_what_cannot_be_invited(teacher: httpx.Client, body: dict[str, Any], status: int) -> None:
    assert teacher.post(f"{API}/invitations", json=body).status_code == status
    assert items(teacher, "/invitations") == []


def test_nothing_of_another_course_is_seen_or_ended(either_site: Site, teacher: httpx.Client) -> None:
    [ada] = invite(teacher, names=["ada"])
    token = teacher.post(f"{API}/tokens", json={"user": "bob", "role": "student"}).json()["token"]
    rival = either_site.client("rita", "instructor", course=f"{either_site.course}-other")
    assert {one["name"] for one in items(rival, "/members")} == {"rita"}
    for path in ("invitations/" + ada["id"], "tokens/" + token.split("_")[1], "members/" + ada["member"]):
        assert rival.delete(f"{API}/{path}").status_code == 404
    assert rival.post(f"{API}/invitations", json={"member": ada["member"]}).status_code == 404
    assert follow(either_site, ada["url"]).get(f"{API}/quizzes").status_code == 200


def test_a_course_link_lets_many_in_until_it_is_rotated_or_closed(either_site: Site, teacher: httpx.Client) -> None:
    assert teacher.get(f"{API}/course").json() == {"course": either_site.course, "join_url": None}
    url = teacher.put(f"{API}/course/link").json()["join_url"]
    assert teacher.get(f"{API}/course").json()["join_url"] == url

    def join(url: str, name: str) -> tuple[int, httpx.Client]:
        browser = either_site.anonymous(OURS)
        joined = browser.post("/join", data={"code": url.partition("code=")[2], "name": name})
        return joined.status_code, browser

    assert "Your name" in either_site.anonymous().get(url).text
    learners = [join(url, "Ada Lovelace")[1] for _ in range(3)]
    made = [learner.post(f"{API}/submissions", json=ANSWER).json() for learner in learners]
    assert len({one["learner"] for one in made}) == 3
    assert {one["user"] for one in made} == {"Ada Lovelace"}
    assert join(url, "  ")[0] == 422
    assert join(f"{url}x", "bob")[0] == 403
    fresh = teacher.put(f"{API}/course/link").json()["join_url"]
    assert (join(url, "bob")[0], join(fresh, "bob")[0]) == (403, 303)
    assert teacher.delete(f"{API}/course/link").status_code == 204
    assert join(fresh, "bob")[0] == 403
    assert either_site.anonymous().get(fresh).status_code == 403
    assert learners[0].get(f"{API}/quizzes").status_code == 200


def test_a_name_that_a_learner_chose_opens_nobody_elses_work(either_site: Site, teacher: httpx.Client) -> None:
    [ada] = invite(teacher, names=["ada"])
    made = follow(either_site, ada["url"]).post(f"{API}/submissions", json=ANSWER).json()
    url = teacher.put(f"{API}/course/link").json()["join_url"]
    other = either_site.anonymous(OURS)
    other.post("/join", data={"code": url.partition("code=")[2], "name": "ada"})
    assert items(other, "/submissions") == []
    assert other.get(f"{API}/submissions/{made['id']}").status_code == 404


def test_a_removed_member_is_out_at_once_and_the_answers_stay(either_site: Site, teacher: httpx.Client) -> None:
    [ada] = invite(teacher, names=["ada"])
    browser, token = follow(either_site, ada["url"]), either_site.client("ada")
    browser.post(f"{API}/submissions", json=ANSWER)
    [link] = invite(teacher, member=ada["member"])
    assert teacher.delete(f"{API}/members/{ada['member']}").status_code == 204
    assert (browser.get(f"{API}/quizzes").status_code, token.get(f"{API}/quizzes").status_code) == (401, 401)
    assert follow_fails(either_site, link["url"])
    assert {one["name"] for one in items(teacher, "/members")} == {"tina"}
    assert [one["user"] for one in items(teacher, "/submissions")] == ["ada"]
    [me] = items(teacher, "/members")
    assert teacher.delete(f"{API}/members/{me['id']}").status_code == 409


def test_a_name_that_an_instructor_gave_is_given_to_nobody_else(either_site: Site, teacher: httpx.Client) -> None:
    def rename(member: str, name: str | None) -> httpx.Response:
        return teacher.patch(f"{API}/members/{member}", json={"name": name})

    ada, eve, bob = (made["member"] for made in invite(teacher, names=["Ada Lovelace", "Eve", "Bob"]))
    refused = rename(eve, " Ada Lovelace ")
    assert refused.status_code == 409
    assert f"'Ada Lovelace' was given to Ada Lovelace ({ada}) before" in refused.json()["detail"]
    assert {one["name"]: one["named_by"] for one in items(teacher, "/members")}["Eve"] is None
    assert rename(ada, "Ada Lovelace").status_code == 200
    assert rename(ada, "Ada King").status_code == 200
    refused = rename(eve, "Ada Lovelace")  # an invitation of this name is still Ada King's
    assert (refused.status_code, f"to Ada King ({ada})" in refused.json()["detail"]) == (409, True)
    assert rename(ada, "Ada Lovelace").status_code == 200
    assert teacher.delete(f"{API}/members/{bob}").status_code == 204
    assert rename(eve, "Bob").status_code == 200


def test_a_name_that_an_instructor_set_is_not_said_to_come_from_elsewhere(
    either_site: Site, teacher: httpx.Client
) -> None:
    def refuse(name: str) -> str:
        response = teacher.post(f"{API}/invitations", json={"names": [name]})
        assert response.status_code == 409
        detail: str = response.json()["detail"]
        return detail.partition(":")[0]

    [ivo] = invite(teacher, names=["Ivo"])
    teacher.patch(f"{API}/members/{ivo['member']}", json={"name": "Ivo Mueller"})
    assert refuse("Ivo Mueller") == "1 member has the name 'Ivo Mueller' already, set by an instructor"
    roster = "name,external_id\nIvo Mueller,7\nHana,8\n"
    teacher.post(f"{API}/roster:import", content=roster, headers={"Content-Type": "text/csv"})
    elsewhere = "from a roster, a platform or another sign-in"
    assert (
        refuse("Ivo Mueller") == f"2 members have the name 'Ivo Mueller' already, set by an instructor or {elsewhere}"
    )
    assert refuse("Hana") == f"1 member has the name 'Hana' already, {elsewhere}"


def test_a_student_is_made_an_instructor_by_a_new_link(either_site: Site, teacher: httpx.Client) -> None:
    [ada] = invite(teacher, names=["ada"])
    browser = follow(either_site, ada["url"])
    assert browser.get("/instructor/people").status_code == 403
    changed = teacher.patch(f"{API}/members/{ada['member']}", json={"role": "instructor"})
    assert changed.json()["role"] == "instructor"
    assert browser.get(f"{API}/quizzes").status_code == 401
    [link] = invite(teacher, member=ada["member"])
    assert follow(either_site, link["url"]).get("/instructor/people").status_code == 200


def test_members_come_in_pages(either_site: Site, teacher: httpx.Client) -> None:
    invite(teacher, names=[f"learner {number}" for number in range(7)])
    seen: list[str] = []
    path: str | None = f"{API}/members?limit=3"
    while path is not None:
        page = teacher.get(path)
        seen += [item["name"] for item in page.json()["items"]]
        following = page.links.get("next")
        path = None if following is None else following["url"]
    assert sorted(seen) == [*(f"learner {number}" for number in range(7)), "tina"]


PLACES = [
    ("GET", "/quizzes", Scope.READ),
    ("GET", "/submissions", Scope.READ),
    ("POST", "/submissions", Scope.ANSWER),
    ("POST", "/answers:validate", Scope.ANSWER),
    ("GET", "/reviews", Scope.REVIEW),
    ("POST", "/content:reload", Scope.CONTENT),
    ("GET", "/members", Scope.PEOPLE),
    ("GET", "/audit", Scope.PEOPLE),
]


@pytest.mark.parametrize("scope", list(Scope))
def test_a_token_may_do_what_its_scopes_name_and_nothing_else(site: Site, scope: Scope) -> None:
    def create(session: Any) -> str:
        return create_token(session, "tina", "instructor", site.course, scopes=[scope])

    client = site.anonymous({"Authorization": f"Bearer {in_database(site.settings, create)}"})
    for method, path, needed in PLACES:
        body = ANSWER if path in ("/submissions", "/answers:validate") and method == "POST" else None
        response = client.request(method, API + path, json=body)
        assert (response.status_code == 403) == (needed is not scope), (method, path)
        assert (f"`{needed}`" in response.text) == (needed is not scope)
    for method, path, status in (
        ("GET", "/nothing", 404), ("GET", "/results/", 404), ("PUT", "/lti/nothing", 404), ("GET", "", 404),
        ("PATCH", "/results", 405), ("DELETE", "/courses", 405), ("TRACE", "/tokens", 405),
    ):  # fmt: skip
        assert client.request(method, f"{API}{path}").status_code == status, (method, path)
    assert client.head(f"{API}/quizzes").status_code == (200 if scope is Scope.READ else 403)


UNRESTRICTED = (f"{API}/lti/", f"{API}/courses", f"{API}/devices")
"""Linking a platform's course makes instructors, as making a course does, and as changing a role may: all of them take
a token without restriction. A device that asks for a token has none."""


def test_every_route_has_a_scope(nobody: httpx.Client) -> None:
    paths = nobody.get("/openapi.json").json()["paths"]
    for path, operations in paths.items():
        if path.startswith(f"{API}/"):
            for method in operations:
                scope = find_scope(method.upper(), path.removeprefix(API))
                is_beyond = path.startswith(UNRESTRICTED) or (method, path) == ("patch", f"{API}/members/{{member_id}}")
                assert (scope is None) == is_beyond, (method, path)


def test_a_token_gives_another_no_more_than_it_has(either_site: Site, teacher: httpx.Client) -> None:
    made = teacher.post(f"{API}/tokens", json={"user": "robot", "role": "instructor", "scopes": ["people", "read"]})
    robot = either_site.anonymous({"Authorization": f"Bearer {made.json()['token']}"})
    body = {"user": "x", "role": "student"}
    assert robot.post(f"{API}/tokens", json=body).status_code == 403
    assert robot.post(f"{API}/tokens", json={**body, "scopes": ["review"]}).status_code == 403
    assert robot.post(f"{API}/tokens", json={**body, "scopes": ["read"]}).status_code == 201


def test_a_restricted_token_makes_no_unrestricted_session(either_site: Site, teacher: httpx.Client) -> None:
    made = teacher.post(f"{API}/tokens", json={"user": "robot", "role": "instructor", "scopes": ["people", "read"]})
    robot = either_site.anonymous({"Authorization": f"Bearer {made.json()['token']}"})
    assert robot.post(f"{API}/invitations", json={"names": ["x"], "role": "instructor"}).status_code == 403
    [tina] = [one for one in items(teacher, "/members") if one["name"] == "tina"]
    assert robot.post(f"{API}/invitations", json={"member": tina["id"]}).status_code == 403
    assert robot.post(f"{API}/invitations", json={"names": ["x"]}).status_code == 201


def test_tokens_are_listed_without_secrets_and_revoked_one_by_one(either_site: Site, teacher: httpx.Client) -> None:
    body = {"user": "robot", "role": "service", "scopes": ["results", "read"], "days": 2}
    text = teacher.post(f"{API}/tokens", json=body).json()["token"]
    robot = either_site.anonymous({"Authorization": f"Bearer {text}"})
    assert robot.get(f"{API}/quizzes").status_code == 200
    listed = {one["name"]: one for one in items(teacher, "/tokens")}
    assert listed.keys() == {"tina", "robot"}
    assert listed["robot"]["scopes"] == ["read", "results"]
    assert listed["robot"]["created_by"] == "tina"
    assert listed["robot"]["last_used_at"] is not None
    assert text.split("_")[2] not in json.dumps(listed)
    assert teacher.delete(f"{API}/tokens/{listed['robot']['id']}").status_code == 204
    assert robot.get(f"{API}/quizzes").status_code == 401
    assert teacher.delete(f"{API}/tokens/{listed['robot']['id']}").status_code == 404
    mistakes: list[dict[str, Any]] = [{"days": 0}, {"scopes": []}, {"scopes": ["all"]}, {"role": "king"}, {"user": ""}]
    for wrong in mistakes:
        assert teacher.post(f"{API}/tokens", json={**body, **wrong}).status_code == 422


@pytest.mark.parametrize("path", ["/members", "/invitations", "/tokens", "/course", "/audit"])
def test_people_are_for_instructors(site: Site, ann: httpx.Client, nobody: httpx.Client, path: str) -> None:
    assert ann.get(API + path).status_code == 403
    assert nobody.get(API + path).status_code == 401
    assert nobody.get("/instructor/people").status_code == 401


def test_the_audit_log_tells_who_did_what(either_site: Site, teacher: httpx.Client) -> None:
    [ada] = invite(teacher, names=["ada"])
    learner = follow(either_site, ada["url"])
    token = teacher.post(f"{API}/tokens", json={"user": "robot", "role": "service"}).json()["token"]
    teacher.delete(f"{API}/tokens/{token.split('_')[1]}")
    teacher.put(f"{API}/course/link")
    teacher.delete(f"{API}/course/link")
    teacher.post(f"{API}/content:reload")
    made = learner.post(f"{API}/submissions", json={**ANSWER, "question": "q4", "answer": "because"})
    path = f"{API}/submissions/{made.json()['id']}/review"
    assert teacher.put(path, json={"points": 0.5}, headers={"If-Match": "*"}).status_code == 200
    teacher.delete(f"{API}/members/{ada['member']}")
    told = [(one["name"], one["action"]) for one in items(teacher, "/audit")]
    assert told == [
        ("tina", "member removed"),
        ("tina", "reviewed"),
        ("tina", "content reloaded"),
        ("tina", "course link closed"),
        ("tina", "course link rotated"),
        ("tina", "token revoked"),
        ("tina", "token created"),
        ("ada", "signed in"),
        ("tina", "invited"),
        ("command line", "token created"),
    ]
    [reviewed] = [one for one in items(teacher, "/audit") if one["action"] == "reviewed"]
    assert (reviewed["subject"], reviewed["detail"]) == (made.json()["id"], {"before": 0.0, "after": 0.5})
    page = teacher.get(f"{API}/audit", params={"limit": 4}).json()
    rest = teacher.get(f"{API}/audit", params={"cursor": page["next_cursor"]}).json()
    assert [(one["name"], one["action"]) for one in page["items"] + rest["items"]] == told


@pytest.mark.parametrize("change", [update(AuditEntry).values(name="x"), delete(AuditEntry)])
def test_the_audit_log_cannot_be_changed(either_site: Site, teacher: httpx.Client, change: Any) -> None:
    invite(teacher, names=["ada"])
    with pytest.raises(DBAPIError, match="append-only"), either_site.app.state.services.database.write() as session:
        session.execute(change)


def test_links_and_tokens_from_the_command_line(tmp_path: Path) -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return grader(*words, "--data", str(tmp_path))

    invited = run("invite", "--course", "robots", "--role", "instructor", "Tina", "Tom B")
    assert invited.returncode == 0, invited.stderr
    links = invited.stdout.splitlines()
    assert len(links) == 2
    assert all(re.fullmatch(r"http://127\.0\.0\.1:8000/signin\?code=gri_\w+", link) for link in links)
    assert "Tom B, until" in invited.stderr
    assert "No server has started on this database yet" in invited.stderr

    made = run("token", "create", "--user", "lms", "--role", "service", "--course", "robots", "--scope", "results",
               "--scope", "lms", "--expires", "30d")  # fmt: skip
    assert re.fullmatch(r"grt_\w+\n", made.stdout)
    [token] = json.loads(run("token", "list", "--course", "robots", "--json").stdout)
    assert (token["name"], token["scopes"]) == ("lms", ["lms", "results"])
    assert made.stdout.split("_")[2].strip() not in run("token", "list", "--course", "robots").stdout
    assert run("token", "revoke", "--id", token["id"], "--course", "robots").stdout == "1 revoked\n"
    assert run("token", "list", "--course", "robots").stdout == ""

    for wrong in (
        ("invite", "--role", "service", "x"),
        ("token", "create", "--user", "x", "--role", "student", "--expires", "soon"),
        ("token", "create", "--user", "x", "--role", "student", "--scope", "all"),
        ("token", "revoke"),
        ("token", "revoke", "--id", "0" * 16),
    ):
        assert run(*wrong).returncode == 2

    tell_addresses(Settings(data=tmp_path, port=9260), {})
    invited = run("invite", "Ada")
    assert invited.stdout.startswith("http://127.0.0.1:9260/signin?code=gri_")
    assert "No server" not in invited.stderr


def test_a_public_server_prints_no_sign_in_link(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its output is a log, which more people read than may sign in as the instructor."""
    tell_addresses(Settings(data=tmp_path, public_origin="https://grader.example"), {})
    public = capsys.readouterr().out
    assert "code=" not in public
    assert 'https://grader.example/instructor  (to sign in: grader invite --role instructor "YOUR NAME")' in public
    tell_addresses(Settings(data=tmp_path), {})
    assert "/signin?code=gri_" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "d", "0d", "-1d", "1.5d", "30", "30m", "9" * 30 + "d", "²d"])
def test_what_is_no_lifetime(text: str) -> None:
    from grader.commands.tokens import parse_lifetime

    with pytest.raises(Unprocessable):
        parse_lifetime(text)
    assert parse_lifetime("2w") == timedelta(weeks=2)


@pytest.mark.parametrize(
    "name", ["Ann\u3164", "\u2800", "A\u034fnn", "Ann\u200b", "\u202ennA", "Ann\u00ad", "An\ufeffn"]
)
def test_a_name_has_nothing_invisible(name: str) -> None:
    """With it two names would look the same."""
    with pytest.raises(Unprocessable):
        check_name("learner", name)
    assert check_name("learner", "Zoë Ğ अनीता 山田") == "Zoë Ğ अनीता 山田"


@pytest.mark.parametrize("name_in", [launch.read_name, openid.read_name])
def test_a_name_that_another_system_sends_is_cleaned(name_in: Callable[[dict[str, str]], str]) -> None:
    """Refusing it would lock its bearer out."""
    name = name_in({"name": "A\u034fnn\u3164 \u202eLee\u200b"})
    assert check_name("learner", name) == name == "Ann Lee"


def test_the_command_line_says_who_is_new(tmp_path: Path) -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return grader(*words, "--data", str(tmp_path))

    words = ("token", "create", "--user", "ada", "--role", "student", "--course", "robots")
    first, second = run(*words), run(*words)
    assert re.fullmatch(r"grt_\w+\n", first.stdout)
    assert first.stderr.splitlines()[-1] == "ada is a new student of the course robots."
    assert (re.fullmatch(r"grt_\w+\n", second.stdout) is not None, second.stderr) == (True, "")
    refused = run("token", "create", "--user", "ada", "--role", "instructor", "--course", "robots")
    assert (refused.returncode, refused.stdout, "ada (student)" in refused.stderr) == (2, "", True)
