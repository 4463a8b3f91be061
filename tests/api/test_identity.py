"""Who is who: learners are told apart by an id, sessions begin with a POST, end, and are removed."""

import re
from collections.abc import Callable
from datetime import timedelta
from typing import Any

import httpx
import pytest
from sqlalchemy import func, select, update

from grader.courses.people import sign_in
from grader.courses.people.members import make_unnamed
from grader.service.accounts import sign_in_url
from grader.store.engine.database import Database
from grader.store.tables import Credential, Member, now
from support.sites import Site
from support.tokens import issue_token

API = "/api/v1"
OURS = {"Sec-Fetch-Site": "same-origin"}
ANSWER = {"quiz": "small", "question": "q1", "answer": 1}
SESSIONS = select(func.count()).select_from(Credential).where(Credential.kind == "grs")


def database_of(site: Site) -> Database:
    database: Database = site.app.state.services.database
    return database


def count(site: Site, query: Any) -> int:
    with database_of(site).read() as session:
        return int(session.scalar(query))


def signed_in_as(site: Site, name: str) -> httpx.Client:
    """The browser of a learner who chose this name."""
    with database_of(site).write() as session:
        opened = sign_in.start_session(session, make_unnamed(session, site.course or "default", name))
    return site.anonymous({"Cookie": f"grader_session={opened.secret}", **OURS})


def items(client: httpx.Client, **query: str) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = client.get(f"{API}/submissions", params=query).json()["items"]
    return items


def test_two_learners_of_one_name_do_not_see_each_other(either_site: Site) -> None:
    by_token = either_site.client("ada")
    chose_it = [signed_in_as(either_site, "ada") for _ in range(2)]
    made = [
        client.post(f"{API}/submissions", json=ANSWER, headers={"Idempotency-Key": "one"}).json()
        for client in (by_token, *chose_it)
    ]
    assert len({one["id"] for one in made}) == len({one["learner"] for one in made}) == 3
    assert {one["user"] for one in made} == {"ada"}
    assert [one["attempt"] for one in made] == [1, 1, 1]
    for client, own in zip((by_token, *chose_it), made, strict=True):
        assert [one["id"] for one in items(client, user="ada")] == [own["id"]]
        for other in made:
            status = client.get(f"{API}/submissions/{other['id']}").status_code
            assert status == (200 if other is own else 404)
    teacher = either_site.client("tina", "instructor")
    assert {one["id"] for one in items(teacher, user="ada")} == {one["id"] for one in made}
    assert [one["id"] for one in items(teacher, learner=made[1]["learner"])] == [made[1]["id"]]


def test_two_tokens_of_one_name_are_one_learner(either_site: Site) -> None:
    first, second = either_site.client("ada"), either_site.client("ada")
    made = first.post(f"{API}/submissions", json=ANSWER).json()
    assert [one["id"] for one in items(second)] == [made["id"]]
    assert items(either_site.client("ada", course="another")) == []


def test_a_learner_has_128_random_bits(site: Site) -> None:
    ids = [signed_in_as(site, "ada").post(f"{API}/submissions", json=ANSWER).json()["learner"] for _ in range(3)]
    assert len(set(ids)) == 3
    assert all(re.fullmatch(r"[0-9a-f]{32}", id_) for id_ in ids)


@pytest.mark.slow
def test_get_requests_leave_no_rows(site: Site, nobody: httpx.Client) -> None:
    code = sign_in_url(site.settings).partition("code=")[2]
    before = count(site, SESSIONS), count(site, select(func.count()).select_from(Member))
    for path in ("/", "/?quiz=small", f"/signin?code={code}", "/signin?code=x", "/signout", "/instructor", "/session"):
        for _ in range(20):
            assert "set-cookie" not in nobody.get(path).headers
    assert (count(site, SESSIONS), count(site, select(func.count()).select_from(Member))) == before


def test_a_session_begins_with_a_post_from_our_own_page(nobody: httpx.Client) -> None:
    assert nobody.post("/session", headers={"Sec-Fetch-Site": "cross-site"}).status_code == 403
    as_json = nobody.post("/session", headers={**OURS, "Accept": "application/json"})
    assert as_json.json()["user"].startswith("learner-")
    by_form = nobody.post("/session", headers=OURS)
    assert (by_form.status_code, by_form.headers["location"]) == (303, "/")
    assert as_json.json()["id"] in nobody.get("/").text


def test_beyond_loopback_nobody_begins_a_session(open_site_with: Callable[..., Site]) -> None:
    site = open_site_with(public_origin="https://grader.example")
    client = site.anonymous({"Host": "grader.example", **OURS})
    assert client.post("/session").status_code == 403
    assert count(site, SESSIONS) == 0


def test_a_cookie_lives_as_long_as_its_session(site: Site, nobody: httpx.Client) -> None:
    def max_age(response: httpx.Response) -> int:
        match = re.search(r"Max-Age=(\d+)", response.headers["set-cookie"])
        assert match
        return int(match[1])

    assert max_age(nobody.post("/session", headers=OURS)) == sign_in.LEARNER_SESSION.total_seconds()
    code = sign_in_url(site.settings).partition("code=")[2]
    signed_in = nobody.post("/signin", data={"code": code}, headers=OURS)
    assert max_age(signed_in) == sign_in.INSTRUCTOR_SESSION.total_seconds()
    secret = signed_in.headers["set-cookie"].split("_")[2]
    with database_of(site).read() as session:
        credential = session.get_one(Credential, secret)
        assert credential.expires_at is not None
        assert abs(credential.expires_at - now() - sign_in.INSTRUCTOR_SESSION) < timedelta(minutes=1)


def test_ended_sessions_and_learners_who_never_answered_are_removed(either_site: Site) -> None:
    answered, silent = signed_in_as(either_site, "answered"), signed_in_as(either_site, "silent")
    assert answered.post(f"{API}/submissions", json=ANSWER).status_code == 201
    here = Credential.course == either_site.course
    with database_of(either_site).write() as session:
        session.execute(update(Credential).where(here).values(expires_at=now()))
    assert silent.get(f"{API}/quizzes").status_code == 401
    teacher = either_site.client("tina", "instructor")
    signed_in_as(either_site, "new")
    assert count(either_site, SESSIONS.where(here)) == 1
    names = select(Member.name).where(Member.course == either_site.course)
    with database_of(either_site).read() as session:
        assert set(session.scalars(names)) == {"answered", "new", "tina"}
    assert [one["user"] for one in items(teacher)] == ["answered"]


def test_signing_out_warns_and_a_return_link_brings_the_work_back(nobody: httpx.Client, site: Site) -> None:
    nobody.post("/session", headers=OURS)
    made = nobody.post(f"{API}/submissions", json=ANSWER, headers=OURS).json()
    assert "lost" in nobody.get("/signout").text
    links = []
    for _ in range(2):
        match = re.search(
            rf"readonly>{site.origin}(/signin\?code=\w+)<", nobody.post("/signout/link", headers=OURS).text
        )
        assert match
        links.append(match[1])
    assert nobody.post("/signout", headers=OURS).status_code == 303
    assert nobody.get(f"{API}/quizzes").status_code == 401

    elsewhere = site.anonymous()
    assert elsewhere.get(links[0]).status_code == 401  # the second link replaced it
    assert made["user"] in elsewhere.get(links[1]).text
    code = links[1].partition("code=")[2]
    assert elsewhere.post("/signin", data={"code": code}, headers=OURS).headers["location"] == "/"
    assert [one["id"] for one in items(elsewhere)] == [made["id"]]
    assert elsewhere.post("/signin", data={"code": code}, headers=OURS).status_code == 401


def test_a_named_learner_is_not_told_that_the_work_is_lost(site: Site, nobody: httpx.Client) -> None:
    code = sign_in_url(site.settings).partition("code=")[2]
    nobody.post("/signin", data={"code": code}, headers=OURS)
    assert "lost" not in nobody.get("/signout").text


def test_signing_in_as_another_says_whose_session_ends(site: Site, nobody: httpx.Client) -> None:
    learner = nobody.post("/session", headers={**OURS, "Accept": "application/json"}).json()
    cookie = dict(nobody.cookies)
    code = sign_in_url(site.settings).partition("code=")[2]
    assert learner["user"] in nobody.get("/signin", params={"code": code}).text
    nobody.post("/signin", data={"code": code}, headers=OURS)
    assert site.anonymous({"Cookie": f"grader_session={cookie['grader_session']}"}).get(f"{API}/quizzes").is_error


def test_a_token_of_an_anonymous_name_is_another_learner(site: Site, nobody: httpx.Client) -> None:
    """The name is shown to others; a token that bears it must not open the work."""
    learner = nobody.post("/session", headers={**OURS, "Accept": "application/json"}).json()
    nobody.post(f"{API}/submissions", json=ANSWER, headers=OURS)
    token = issue_token(site.settings, learner["user"], "student", None)
    assert items(site.anonymous({"Authorization": f"Bearer {token}"})) == []
