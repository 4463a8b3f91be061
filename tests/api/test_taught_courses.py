"""A course is made by an instructor of `default`, and entered from there; never the other way round."""

import re
from collections.abc import Callable
from pathlib import Path
from secrets import token_hex

import httpx
import pytest

from grader.courses.people import members
from grader.courses.people.identity import COOKIE, DEFAULT_COURSE, Role
from grader.courses.people.sign_in import create_sign_in_code, start_session
from grader.courses.people.tokens import create_token
from grader.store import people
from grader.store.engine.database import Database
from support.sites import Site

API = "/api/v1"
PAGE = "/instructor/courses"
OURS = {"Sec-Fetch-Site": "same-origin"}


def database_of(site: Site) -> Database:
    database: Database = site.app.state.services.database
    return database


def open_browser(site: Site, name: str, role: Role = Role.INSTRUCTOR, course: str = DEFAULT_COURSE) -> httpx.Client:
    """A browser in which a named member is signed in. It keeps its cookies."""
    with database_of(site).write() as session:
        opened = start_session(session, members.get_named(session, name, role, course))
    client = site.anonymous(OURS)
    client.cookies.set(COOKIE, opened.secret, domain="127.0.0.1", path="/")
    return client


def sign_in_with(browser: httpx.Client, link: str, **form: str) -> httpx.Response:
    return browser.post("/signin", data={"code": link.partition("code=")[2] or link, **form})


def taught(browser: httpx.Client) -> dict[str, str]:
    """The courses that a browser can switch to: the address of each button."""
    shown = browser.get(PAGE)
    assert shown.status_code == 200, shown.text
    rows = re.findall(r"<tr>.*?</tr>", shown.text.partition("<tbody")[2], re.DOTALL)
    names = [re.search(r'class="name">([^<]*)<', row) for row in rows]
    buttons = [re.search(r'action="([^"]*)"', row) for row in rows]
    return {name[1]: button[1] if button else "" for name, button in zip(names, buttons, strict=True) if name}


def current(browser: httpx.Client) -> str:
    course: str = browser.get(f"{API}/course").json()["course"]
    return course


def made_by(browser: httpx.Client) -> str:
    """A new course, and its name."""
    name = f"robots {token_hex(4)}"
    response = browser.post(PAGE, data={"name": f" {name} "})
    assert (response.status_code, response.headers["location"]) == (303, PAGE), response.text
    return name


def enter(browser: httpx.Client, course: str) -> httpx.Response:
    return browser.post(taught(browser)[course])


def test_a_course_is_made_entered_and_left_again(either_site: Site) -> None:
    tina = open_browser(either_site, "tina")
    ann = either_site.client("ann", course=DEFAULT_COURSE)
    robots, welders = made_by(tina), made_by(tina)
    assert [*taught(tina)] == [DEFAULT_COURSE, *sorted((robots, welders))]
    answered = enter(tina, robots)
    assert (answered.status_code, answered.headers["location"]) == (303, "/instructor")
    assert current(tina) == robots
    assert [item["name"] for item in tina.get(f"{API}/members").json()["items"]] == ["tina"]
    assert tina.post(f"{API}/invitations", json={"names": ["bob"]}).status_code == 201
    assert tina.get(f"{API}/quizzes").json()["items"][0]["id"] == "small"
    assert ann.get(f"{API}/quizzes").status_code == 200
    listed = {item["course"]: item for item in tina.get(f"{API}/courses").json()["items"]}
    assert (listed[robots]["learners"], listed[robots]["is_current"], listed[welders]["is_current"]) == (1, True, False)
    enter(tina, welders)
    assert current(tina) == welders
    enter(tina, DEFAULT_COURSE)
    assert current(tina) == DEFAULT_COURSE
    entries = tina.get(f"{API}/audit").json()["items"]
    assert [robots, welders] == [entry["subject"] for entry in reversed(entries) if entry["action"] == "course made"][
        -2:
    ]
    enter(tina, robots)
    told = [(item["action"], item["name"]) for item in tina.get(f"{API}/audit").json()["items"]]
    assert told[::-1] == [("course made", "tina"), ("signed in", "tina"), ("invited", "tina"), ("signed in", "tina")]


def test_a_switch_ends_with_the_session_that_it_came_from(either_site: Site) -> None:
    name = f"tina {token_hex(4)}"
    tina = open_browser(either_site, name)
    before = str(tina.cookies[COOKIE])
    robots = made_by(tina)
    enter(tina, robots)
    inner = str(tina.cookies[COOKIE])

    def is_valid(secret: str) -> bool:
        return either_site.anonymous({"Cookie": f"{COOKIE}={secret}", **OURS}).get(f"{API}/course").status_code == 200

    assert is_valid(before)
    assert is_valid(inner)
    assert tina.post("/signout").status_code == 303
    assert not is_valid(before)
    assert not is_valid(inner)

    tina = open_browser(either_site, name)
    enter(tina, robots)
    inner = str(tina.cookies[COOKIE])
    enter(tina, DEFAULT_COURSE)
    assert not is_valid(inner)
    enter(tina, robots)
    other = open_browser(either_site, "otto")
    listed = other.get(f"{API}/members", params={"limit": 100}).json()["items"]
    home = next(one["id"] for one in listed if one["name"] == name)
    assert other.delete(f"{API}/members/{home}").status_code == 204
    assert tina.get(f"{API}/course").status_code == 401  # with the home every session that was opened from it


def test_no_way_leads_from_a_course_to_the_home_of_its_instructor(either_site: Site) -> None:
    """A colleague in the new course makes a link for its first instructor, and signs in with it."""
    tina = open_browser(either_site, "tina")
    robots = made_by(tina)
    enter(tina, robots)
    invitation = tina.post(f"{API}/invitations", json={"names": ["eve"], "role": "instructor"}).json()["items"][0]
    eve = either_site.anonymous(OURS)
    assert sign_in_with(eve, invitation["url"]).status_code == 303
    member = next(item["id"] for item in eve.get(f"{API}/members").json()["items"] if item["name"] == "tina")
    forged = eve.post(f"{API}/invitations", json={"member": member}).json()["items"][0]
    thief = either_site.anonymous(OURS)
    assert sign_in_with(thief, forged["url"]).status_code == 303
    assert current(thief) == robots
    assert taught(thief) == {robots: ""}
    home = next(
        item["id"]
        for item in open_browser(either_site, "otto").get(f"{API}/members", params={"limit": 100}).json()["items"]
        if item["name"] == "tina"
    )
    assert thief.post(f"{PAGE}/{home}/enter").status_code == 404
    assert eve.post(f"{PAGE}/{member}/enter").status_code == 404
    assert taught(eve) == {robots: ""}


def test_who_may_make_a_course_and_which(either_site: Site) -> None:
    tina, mia = open_browser(either_site, "tina"), open_browser(either_site, "mia", course="mechanics")
    robots = made_by(tina)
    for name, status, why in (
        (robots, 409, "There is a course"),
        (DEFAULT_COURSE, 409, "There is a course"),
        ("mechanics", 409, "its instructors can invite you"),
        ("  ", 422, "A course has a name of 1 to 200"),
        ("a\u200bb", 422, "printable"),
        ("x" * 201, 422, "1 to 200"),
    ):
        page = tina.post(PAGE, data={"name": name})
        assert page.status_code == status, name
        assert why in page.text
        assert tina.post(f"{API}/courses", json={"name": name}).status_code == status
    for browser, status in ((mia, 403), (open_browser(either_site, "sam", Role.STUDENT), 403)):
        assert browser.post(PAGE, data={"name": "welders"}).status_code == status
        assert browser.post(f"{API}/courses", json={"name": "welders"}).status_code == status
    told = mia.post(f"{API}/courses", json={"name": "welders"}).json()["detail"]
    assert told == "Courses belong to the installation: an instructor of the course `default` makes new ones."
    assert "An instructor of the course <strong>default</strong> makes courses" in mia.get(PAGE).text
    with database_of(either_site).write() as session:
        token = create_token(session, "tina", "instructor", scopes=["people"])
    scoped = either_site.anonymous({"Authorization": f"Bearer {token}"})
    assert scoped.get(f"{API}/courses").status_code == 403
    assert scoped.post(f"{API}/courses", json={"name": "welders"}).status_code == 403


def test_the_api_makes_a_course_and_a_link_to_it(either_site: Site) -> None:
    tina = either_site.client("tina", "instructor", DEFAULT_COURSE)
    name = f"robots {token_hex(4)}"
    made = tina.post(f"{API}/courses", json={"name": name})
    assert made.status_code == 201
    assert made.json()["course"] == name
    assert name in [item["course"] for item in tina.get(f"{API}/courses").json()["items"]]
    browser = either_site.anonymous(OURS)
    assert sign_in_with(browser, made.json()["url"]).status_code == 303
    assert current(browser) == name


def test_an_invitation_adds_a_course_to_those_of_whoever_has_both(either_site: Site) -> None:
    mia, tina = open_browser(either_site, "mia", course=f"mechanics {token_hex(4)}"), open_browser(either_site, "tina")
    mechanics = current(mia)

    def link_for(name: str, role: str = "instructor") -> str:
        made = mia.post(f"{API}/invitations", json={"names": [name], "role": role}).json()
        return str(made["items"][0]["url"])

    link = link_for("Tina M.")
    shown = tina.get(link).text
    assert "add it to my courses" in shown
    assert sign_in_with(tina, link, add="yes").headers["location"] == "/instructor"
    assert current(tina) == mechanics
    enter(tina, DEFAULT_COURSE)
    assert mechanics in taught(tina)
    assert sign_in_with(tina, link, add="yes").status_code == 401  # works once
    student = link_for("sam", "student")
    assert "add it to my courses" not in tina.get(student).text
    assert sign_in_with(tina, student, add="yes").status_code == 403
    assert sign_in_with(tina, link_for("tom")).status_code == 303  # without adding, as ever
    assert taught(tina) == {mechanics: ""}


def test_who_is_no_instructor_any_more_enters_no_more(either_site: Site) -> None:
    tina = open_browser(either_site, "tina")
    robots = made_by(tina)
    address = taught(tina)[robots]
    with database_of(either_site).write() as session:
        member = people.find_with_account(session, robots, "name:tina")
        assert member is not None
        members.give_role(session, None, member, Role.STUDENT)
    assert robots not in taught(tina)
    assert tina.post(address).status_code == 404


@pytest.mark.slow
def test_a_course_with_a_folder_that_nobody_has_is_offered(
    open_site_with: Callable[..., Site], tmp_path: Path, content: Path
) -> None:
    site = open_site_with(courses={"mechanics": content})
    tina = open_browser(site, "tina")
    shown = tina.get(PAGE).text
    assert '<option value="mechanics">' in shown
    assert tina.post(PAGE, data={"name": "mechanics"}).status_code == 303
    again = tina.get(PAGE).text
    assert '<option value="mechanics">' not in again
    assert "of its own" in again


def test_the_first_sign_in_link_reaches_the_home(site: Site) -> None:
    """A link of the home itself opens it, and from there every course."""
    tina = open_browser(site, "tina")
    robots = made_by(tina)
    with database_of(site).write() as session:
        code = create_sign_in_code(session, "tina", Role.INSTRUCTOR)
    assert sign_in_with(tina, code).status_code == 303
    assert robots in taught(tina)
