"""Who may give whom which role: one function changes roles, and whoever loses one loses all that was opened with it."""

import ast
from collections.abc import Iterator
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import select, update

import grader
from grader.courses.people import invitations, members, sign_in
from grader.courses.people.identity import CredentialKind, Identity, Role, Scope, issue, read_identity
from grader.courses.people.tokens import create_token
from grader.courses.sending import webhooks
from grader.errors import Unauthorized
from grader.gate.admission import PREFIX as API
from grader.platforms import roster
from grader.service.accounts import in_database, sign_in_url
from grader.store.engine.database import Database
from grader.store.platforms import Context
from grader.store.tables import Credential, Member, now
from support.sites import Site

OURS = {"Sec-Fetch-Site": "same-origin"}
ANSWER = {"quiz": "small", "question": "q1", "answer": 1}
ALL_SCOPES = [scope.value for scope in Scope]


@pytest.fixture
def tina(either_site: Site) -> httpx.Client:
    return either_site.client("tina", "instructor")


@pytest.fixture
def robot(either_site: Site) -> httpx.Client:
    """A program with an instructor's token for people alone."""
    return bearer(either_site, token_of(either_site, "robot", scopes=["people"]))


def database_of(site: Site) -> Database:
    database: Database = site.app.state.services.database
    return database


def token_of(site: Site, user: str, role: str = "instructor", **more: Any) -> str:
    return in_database(site.settings, lambda session: create_token(session, user, role, site.course, **more))


def bearer(site: Site, token: str) -> httpx.Client:
    return site.anonymous({"Authorization": f"Bearer {token}"})


def browser_of(site: Site, name: str, role: str) -> httpx.Client:
    """The browser in which a named member has signed in."""
    with database_of(site).write() as session:
        code = sign_in.create_sign_in_code(session, name, role, site.course)
        opened = sign_in.redeem_sign_in_code(session, code)
    return site.anonymous({"Cookie": f"grader_session={opened.secret}", **OURS})


def people(client: httpx.Client) -> dict[str, dict[str, Any]]:
    return {item["name"]: item for item in client.get(f"{API}/members").json()["items"]}


def invite(client: httpx.Client, **body: Any) -> httpx.Response:
    return client.post(f"{API}/invitations", json=body)


def redeem(site: Site, url: str) -> httpx.Response:
    return site.anonymous(OURS).post("/signin", data={"code": url.partition("code=")[2]})


# -- one function ------------------------------------------------------------------------------------------------------


def assignments(tree: ast.AST) -> Iterator[str]:
    """The functions that assign to an attribute `role`, or to any by a name that is computed (`setattr`)."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for node in ast.walk(function):
                targets = node.targets if isinstance(node, ast.Assign) else ()
                if any(isinstance(target, ast.Attribute) and target.attr == "role" for target in targets):
                    yield function.name


@pytest.mark.slow
def test_one_function_changes_roles() -> None:
    sources = Path(grader.__file__).parent.rglob("*.py")
    changing = [name for source in sources for name in assignments(ast.parse(source.read_text(encoding="utf-8")))]
    assert changing == [members.give_role.__name__]


def test_whoever_loses_a_role_loses_everything_at_once(either_site: Site, tina: httpx.Client) -> None:
    browser, token = browser_of(either_site, "prof", "instructor"), bearer(either_site, token_of(either_site, "prof"))
    assert token.post(f"{API}/submissions", json=ANSWER).status_code == 201  # from now on the identity is recalled
    prof = people(tina)["prof"]
    link = invite(tina, member=prof["id"]).json()["items"][0]["url"]
    assert tina.patch(f"{API}/members/{prof['id']}", json={"role": "student"}).status_code == 200
    assert browser.get("/instructor").status_code == 401
    made = {"user": "spy", "role": "instructor", "new": "spy", "days": ""}
    assert browser.post("/instructor/people/tokens", data=made).status_code == 401
    assert token.post(f"{API}/submissions", json=ANSWER).status_code == 401
    assert token.get(f"{API}/members").status_code == 401
    assert redeem(either_site, link).status_code == 401
    assert "spy" not in people(tina)
    assert [item["name"] for item in tina.get(f"{API}/tokens").json()["items"]] == ["tina"]


@pytest.mark.parametrize("changed", ["role", "removed_at"])
def test_a_credential_is_of_no_use_without_its_role(site: Site, changed: str) -> None:
    """Also one that an earlier version left behind: tokens used to keep the role that they were made with."""
    token = bearer(site, token_of(site, "prof"))
    values: dict[str, Any] = {"role": "student"} if changed == "role" else {"removed_at": now()}
    with database_of(site).write() as session:
        session.execute(update(Member).where(Member.course == site.course).values(values))
    assert token.get(f"{API}/members").status_code == 401
    assert site.client("tina", "instructor").get(f"{API}/tokens").json()["items"][1:] == []


def test_the_operator_signs_in_also_after_a_demotion(site: Site) -> None:
    in_default = replace(site, course=None)
    tina = in_default.client("tina", "instructor")
    in_default.client("instructor", "instructor")
    one = people(tina)["instructor"]
    tina.patch(f"{API}/members/{one['id']}", json={"role": "student"})
    assert redeem(site, sign_in_url(site.settings)).headers["location"] == "/instructor"
    assert people(tina)["instructor"]["role"] == "instructor"


# -- restricted tokens -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scopes", [["people"], ALL_SCOPES], ids=["people", "all"])
def test_a_restricted_token_changes_no_role(either_site: Site, tina: httpx.Client, scopes: list[str]) -> None:
    restricted = bearer(either_site, token_of(either_site, "robot", scopes=scopes))
    either_site.client("ada")
    before = people(tina)
    for name, role in (("ada", "instructor"), ("ada", "student"), ("tina", "student"), ("robot", "instructor")):
        refused = restricted.patch(f"{API}/members/{before[name]['id']}", json={"role": role})
        assert refused.status_code == 403, (name, role)
    roster = "name,role\nada,instructor\ntina,student\nnew,instructor\n"
    headers = {"Content-Type": "text/csv"}
    done = restricted.post(f"{API}/roster:import", content=roster, headers=headers)
    assert (done.json()["left_out"], done.json()["changed"], done.json()["created"]) == (3, 0, 0)
    assert people(tina) == before


def test_a_restricted_token_touches_nobody_but_students(
    either_site: Site, tina: httpx.Client, robot: httpx.Client
) -> None:
    either_site.client("lms", "service")
    known = people(tina)
    pending = invite(tina, names=["tom"], role="instructor").json()["items"][0]["id"]
    tokens = {item["name"]: item["id"] for item in tina.get(f"{API}/tokens").json()["items"]}
    scopes = {"scopes": ["people"]}
    for method, path, body in [
        ("POST", "/invitations", {"names": ["x"], "role": "instructor"}),
        ("POST", "/invitations", {"names": ["ada", "tina"]}),
        ("POST", "/invitations", {"names": ["lms"]}),
        ("POST", "/invitations", {"member": known["tina"]["id"]}),
        ("DELETE", f"/invitations/{pending}", None),
        ("POST", "/tokens", {"user": "x", "role": "instructor", **scopes}),
        ("POST", "/tokens", {"user": "x", "role": "service", **scopes}),
        ("POST", "/tokens", {"user": "tina", "role": "student", **scopes}),
        ("DELETE", f"/tokens/{tokens['tina']}", None),
        ("DELETE", f"/tokens/{tokens['lms']}", None),
        ("DELETE", f"/members/{known['tina']['id']}", None),
        ("DELETE", f"/members/{known['lms']['id']}", None),
    ]:
        assert robot.request(method, API + path, json=body).status_code == 403, (method, path, body)
    assert people(tina).keys() == known.keys() | {"tom"}
    assert {item["name"] for item in tina.get(f"{API}/tokens").json()["items"]} == tokens.keys()
    [ada] = invite(robot, names=["ada"]).json()["items"]
    assert robot.delete(f"{API}/invitations/{ada['id']}").status_code == 204
    assert robot.delete(f"{API}/members/{ada['member']}").status_code == 204
    assert invite(robot, names=["ada"]).status_code == 403  # an instructor, or a token like this one, removed her
    assert robot.delete(f"{API}/tokens/{tokens['robot']}").status_code == 204  # ends itself
    assert robot.get(f"{API}/members").status_code == 401


def test_a_restricted_token_gives_no_more_time_than_it_has(either_site: Site) -> None:
    lifetime = timedelta(days=2)
    short = bearer(either_site, token_of(either_site, "robot", scopes=["people", "read"], lifetime=lifetime))
    body = {"user": "ada", "role": "student", "scopes": ["read"]}
    for days in (None, 3):
        refused = short.post(f"{API}/tokens", json={**body, "days": days})
        assert (refused.status_code, "until" in refused.json()["detail"]) == (403, True)
    assert short.post(f"{API}/tokens", json={**body, "days": 1}).status_code == 201


def test_a_link_of_a_restricted_token_never_opens_more_than_a_student(
    either_site: Site, tina: httpx.Client, robot: httpx.Client
) -> None:
    """The program keeps the link, and waits until its owner is an instructor."""
    [ada] = invite(robot, names=["ada"]).json()["items"]
    made = robot.post(f"{API}/tokens", json={"user": "ada", "role": "student", "scopes": ["people"]})
    token = bearer(either_site, made.json()["token"])
    assert token.get(f"{API}/members").status_code == 403  # a student's
    assert tina.patch(f"{API}/members/{ada['member']}", json={"role": "instructor"}).status_code == 200
    assert redeem(either_site, ada["url"]).status_code == 401
    assert token.get(f"{API}/members").status_code == 401


def test_extensions_of_a_restricted_token_are_for_students_who_are_there(
    either_site: Site, tina: httpx.Client, robot: httpx.Client
) -> None:
    marker = bearer(either_site, token_of(either_site, "marker", scopes=["review"]))
    path = f"{API}/quizzes/small/extensions"
    either_site.client("ada")
    known = people(tina)
    for body in ({"user": "tina"}, {"learner": known["tina"]["id"]}):
        assert marker.put(path, json={**body, "attempts": 1}).status_code == 403
    assert marker.put(path, json={"user": "ada", "attempts": 1}).status_code == 200
    assert robot.delete(f"{API}/members/{known['ada']['id']}").status_code == 204
    assert marker.put(path, json={"user": "ada", "attempts": 2}).status_code == 404
    assert "ada" not in people(tina)


# -- invitations, tokens, sessions -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("role", "asked"), [("instructor", "student"), ("student", "instructor")])
def test_an_invitation_and_a_token_change_no_role(either_site: Site, tina: httpx.Client, role: str, asked: str) -> None:
    browser = browser_of(either_site, "prof", role)
    for refused in (
        invite(tina, names=["new", "prof"], role=asked),
        tina.post(f"{API}/tokens", json={"user": "prof", "role": asked}),
    ):
        assert refused.status_code == 409
        assert f"prof ({role})" in refused.json()["detail"]
        assert "PATCH /api/v1/members" in refused.json()["detail"]
    assert people(tina)["prof"]["role"] == role
    assert people(tina).keys() == {"tina", "prof"}
    assert browser.get(f"{API}/quizzes").status_code == 200
    assert tina.get(f"{API}/invitations").json()["items"] == []
    assert invite(tina, names=["prof"], role=role).status_code == 201


def test_the_page_refuses_the_same_and_says_why(site: Site) -> None:
    desk = browser_of(site, "tina", "instructor")
    site.client("ada")
    typed = {"names": "ada", "role": "instructor"}
    refused = desk.post("/instructor/people/invitations", data=typed)
    assert (refused.status_code, "ada (student)" in refused.text) == (422, True)
    refused = desk.post("/instructor/people/tokens", data={"user": "ada", "role": "instructor", "days": ""})
    assert (refused.status_code, "ada (student)" in refused.text) == (422, True)


def test_a_service_gets_no_link(either_site: Site, tina: httpx.Client) -> None:
    """A session has no scopes: it would do more than the service's token."""
    either_site.client("lms", "service")
    assert invite(tina, member=people(tina)["lms"]["id"]).status_code == 422


def test_a_way_back_is_no_longer_than_a_sign_in_for_an_instructor(either_site: Site) -> None:
    for role, lifetime in (("instructor", sign_in.SIGN_IN_CODE), ("student", sign_in.RETURN_CODE)):
        assert browser_of(either_site, role, role).post("/signout/link").status_code == 200
        links = select(Credential).where(
            Credential.course == either_site.course, Credential.kind == CredentialKind.SIGN_IN
        )
        with database_of(either_site).read() as session:
            [link] = session.scalars(links.where(Credential.user == role, Credential.revoked_at.is_(None)))
        assert link.expires_at is not None
        assert link.expires_at - link.created_at <= lifetime + timedelta(seconds=1)


# -- rights that end while they are used -------------------------------------------------------------------------------


@pytest.fixture
def ended(site: Site) -> Identity:
    """An instructor who was admitted just before their token was revoked."""
    with database_of(site).write() as session:
        member = members.get_named(session, "prof", Role.INSTRUCTOR, site.course)
        session.flush()
        issue(session, CredentialKind.TOKEN, member)
        session.flush()
        credential = session.scalars(select(Credential).where(Credential.member == member.id)).one()
        who = read_identity(credential)
        credential.revoked_at = now()
    return who


def test_a_request_under_way_changes_nothing_once_its_credential_has_ended(site: Site, ended: Identity) -> None:
    with pytest.raises(Unauthorized), database_of(site).write() as session:
        create_token(session, "spy", "instructor", site.course, by=ended)
    with pytest.raises(Unauthorized), database_of(site).write() as session:  # its platform took seconds to answer
        context = Context(id=1, platform=1, deployment_id="d", context_id="c", title="", course=site.course)
        roster.enter(session, ended, context, [])
    with pytest.raises(Unauthorized), database_of(site).write() as session:
        invitations.rotate_link(session, ended)
    with pytest.raises(Unauthorized), database_of(site).write() as session:
        webhooks.create(database_of(site), session, ended, "https://example.org/results", ())
    assert "spy" not in people(site.client("tina", "instructor"))


def test_a_revoked_service_makes_no_member(either_site: Site, tina: httpx.Client) -> None:
    """Its identity is recalled for some minutes; the answer is refused when it is stored, and so is its learner."""
    lms = either_site.client("lms", "service")
    body = {**ANSWER, "learner": {"namespace": "school", "id": "s1", "name": "Ada"}}
    assert lms.post(f"{API}/lms/submissions", json=body).status_code == 201
    [token] = [item["id"] for item in tina.get(f"{API}/tokens").json()["items"] if item["name"] == "lms"]
    assert tina.delete(f"{API}/tokens/{token}").status_code == 204
    for learner in ({"id": "s2", "name": "Bob"}, {"id": "s1", "name": "Renamed"}):
        body["learner"] = {"namespace": "school", **learner}
        assert lms.post(f"{API}/lms/submissions", json=body).status_code == 401
    assert people(tina).keys() == {"tina", "lms", "Ada"}


def test_a_service_does_not_rename_an_instructor(either_site: Site, tina: httpx.Client) -> None:
    roster = "name,role,external_id\nGrace,instructor,t1\n"
    headers = {"Content-Type": "text/csv"}
    tina.post(f"{API}/roster:import", params={"namespace": "school"}, content=roster, headers=headers)
    learner = {"namespace": "school", "id": "t1", "name": "Mallory"}
    lms = either_site.client("lms", "service")
    assert lms.post(f"{API}/lms/submissions", json={**ANSWER, "learner": learner}).status_code == 201
    assert people(tina)["Grace"]["role"] == "instructor"
