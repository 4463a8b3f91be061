"""What launches lead to: courses and links, deep linking, frames, rosters, registration, and where scores go."""

import re
import secrets
from dataclasses import replace
from html import unescape
from typing import Any

import httpx
import pytest

from grader.commands.main import cli
from grader.courses.people.erasure import erase_learner
from grader.courses.people.identity import COOKIE
from grader.courses.sending.outbox import send_scores
from grader.grading.content import Archive
from grader.queue import jobs
from grader.service import deliveries
from grader.settings import Settings
from grader.store import platforms
from grader.store.outbox import Delivery
from grader.store.tables import Member
from platforms.joined import Joined, signed_in
from platforms.platform import (
    AGS,
    AGS_SCOPE,
    CLAIM,
    DL_CLAIM,
    INSTRUCTOR,
    KEYS,
    LEARNER,
    NRPS,
    Claims,
    get_json,
    selection_claims,
)
from platforms.working import work

API = "/api/v1"
OURS = {"Sec-Fetch-Site": "same-origin"}
SENDING = [f"{AGS_SCOPE}score", f"{AGS_SCOPE}result.readonly"]
ITEMS = f"{DL_CLAIM}content_items"


def fields_of(page: str) -> dict[str, str]:
    """The hidden fields of a page's forms."""
    return {name: unescape(value) for name, value in re.findall(r'type="hidden" name="(\w+)" value="([^"]*)"', page)}


def unlinked(pair: Joined) -> Joined:
    """The pair with a context that nobody has linked."""
    return replace(pair, context=f"context-{secrets.token_hex(4)}")


def ticket_of(answered: httpx.Response) -> str:
    return fields_of(answered.text)["ticket"]


# courses


def test_a_learner_comes_back_as_the_same_learner(pair: Joined) -> None:
    first, second = pair.browser(**OURS), pair.browser(**OURS)
    assert pair.launch(first).headers["location"] == "/"
    made = first.post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1}).json()
    assert made["user"] == "Ada Lovelace"
    pair.launch(second, name="Ada King")  # a name may change, the subject does not
    assert [item["id"] for item in get_json(second, f"{API}/submissions")["items"]] == [made["id"]]
    other = pair.browser(**OURS)
    pair.launch(other, sub="user-8")  # a learner of the same name is another one
    assert get_json(other, f"{API}/submissions")["items"] == []


def test_a_course_that_is_not_linked_says_so_and_its_instructor_links_it_with_a_new_one(pair: Joined) -> None:
    new, name = unlinked(pair), f"robots {secrets.token_hex(4)}"
    refused = new.launch(new.browser())
    assert (refused.status_code, "not linked" in refused.text) == (403, True)
    teacher = new.browser()
    asked = new.teach(teacher)
    assert asked.status_code == 200
    assert not signed_in(teacher)
    linked = teacher.post("/lti/course", data={"ticket": ticket_of(asked), "course": name}, headers=OURS)
    assert "Linked" in linked.text
    assert (
        teacher.post("/lti/course", data={"ticket": ticket_of(asked), "course": "x"}, headers=OURS).status_code == 401
    )
    assert new.teach(teacher).headers["location"] == "/instructor"
    teacher.headers.update(OURS)
    assert get_json(teacher, f"{API}/course")["course"] == name
    assert new.launch(new.browser()).status_code == 303


def test_an_existing_course_is_linked_by_its_own_instructors(pair: Joined) -> None:
    new, own = unlinked(pair), f"owned-{secrets.token_hex(4)}"
    owner = pair.site.client("olga", "instructor", own)
    page = new.teach(new.browser())
    told = new.browser().post("/lti/course", data={"ticket": ticket_of(page), "course": own}, headers=OURS)
    assert "exists" in told.text
    assert new.launch(new.browser()).status_code == 403
    [context] = get_json(owner, f"{API}/lti/contexts")["items"]
    assert (context["course"], context["wanted"], context["wanted_by"]) == (None, own, "Tina Teach")
    stranger = pair.site.client("eve", "instructor", f"other-{secrets.token_hex(4)}")
    assert get_json(stranger, f"{API}/lti/contexts")["items"] == []
    assert stranger.put(f"{API}/lti/contexts/{context['id']}/link").status_code == 404
    assert owner.put(f"{API}/lti/contexts/{context['id']}/link").status_code == 204
    assert new.launch(new.browser()).status_code == 303
    assert owner.delete(f"{API}/lti/contexts/{context['id']}/link").status_code == 204
    assert new.launch(new.browser()).status_code == 403


def test_a_deployment_is_noted_and_waits_for_approval(pair: Joined) -> None:
    deployment = f"deployment-{secrets.token_hex(4)}"
    elsewhere = replace(pair, platform=replace(pair.platform, deployment_id=deployment))
    assert "waits for approval" in elsewhere.launch(elsewhere.browser()).text
    admin = pair.site.client("root", "instructor", "default")
    [platform] = get_json(admin, f"{API}/lti/platforms")["items"]
    assert {"deployment_id": deployment, "approved": False} in platform["deployments"]
    assert admin.post(f"{API}/lti/platforms/{platform['id']}:approve").status_code == 200
    assert "not linked" in elsewhere.launch(elsewhere.browser()).text


def test_a_removed_member_stays_out(pair: Joined) -> None:
    pair.launch(pair.browser(), sub="mallory", name="Mallory")
    teacher = pair.site.client("tina", "instructor", pair.course)
    [member] = [item for item in get_json(teacher, f"{API}/members")["items"] if item["name"] == "Mallory"]
    assert member["way_in"] == "lti"
    teacher.delete(f"{API}/members/{member['id']}")
    browser = pair.browser()
    assert pair.launch(browser, sub="mallory").status_code == 403
    assert not signed_in(browser)


def test_who_teaches_no_more_loses_the_right_at_the_next_launch(pair: Joined) -> None:
    old, new = pair.browser(**OURS), pair.browser(**OURS)
    pair.teach(old)
    assert old.get(f"{API}/members").status_code == 200
    pair.teach(new, **{f"{CLAIM}roles": [LEARNER]})
    assert new.get(f"{API}/members").status_code == 403
    assert old.get(f"{API}/members").status_code == 401


def test_a_new_tab_opens_with_the_role_of_that_moment(pair: Joined) -> None:
    """The button in the frame is good for an hour: who lost the role meanwhile does not get it back by pressing it."""
    framed, other = pair.browser(**OURS), pair.browser(**OURS)
    begun = framed.get("/lti/login", params=pair.platform.login(pair.site.origin, lti_storage_target="_parent"))
    data = dict(re.findall(r'data-(\w+)="([^"]*)"', begun.text))
    asked = pair.platform.read_authentication_request(unescape(data["address"]), pair.site.origin)
    framed.cookies.clear()
    teacher = {"sub": "teacher-tab", "name": "Tina Tab"}
    token = pair.platform.sign(pair.claims(asked, **teacher, **{f"{CLAIM}roles": [INSTRUCTOR]}))
    opened = pair.post(framed, asked, token, key=data["key"])
    pair.launch(other, **teacher, **{f"{CLAIM}roles": [LEARNER]})
    assert framed.post("/lti/open", data={"ticket": ticket_of(opened)}, headers=OURS).status_code == 303
    assert framed.get(f"{API}/quizzes").status_code == 200
    assert framed.get(f"{API}/members").status_code == 403


# links


@pytest.mark.parametrize(
    ("changes", "location"),
    [
        ({f"{CLAIM}custom": {"quiz": "small"}}, "/?quiz=small"),
        ({f"{CLAIM}custom": {"quiz": "small", "question": "q2"}}, "/?quiz=small#small--q2"),
        ({f"{CLAIM}custom": {"quiz": "$Unresolved.variable"}}, None),
        ({f"{CLAIM}custom": {"quiz": "small", "question": "none"}}, None),
        ({f"{CLAIM}custom": {"quiz": ["small"]}}, "/"),
        ({f"{CLAIM}custom": {"other": "x"}}, "/"),
    ],
)
def test_a_link_leads_to_its_quiz_or_question(pair: Joined, changes: dict[str, Any], location: str | None) -> None:
    entered = pair.launch(pair.browser(), **changes)
    assert entered.headers.get("location") == location
    assert entered.status_code == (404 if location is None else 303)


def test_a_link_leads_to_what_its_newest_launch_names(pair: Joined) -> None:
    def follow(**custom: str) -> str | None:
        location: str | None = pair.launch(pair.browser(), **{f"{CLAIM}custom": custom}).headers.get("location")
        return location

    assert follow(quiz="small", question="q2") == "/?quiz=small#small--q2"
    assert follow(quiz="smal") is None  # a typing error, mended by the next line
    assert follow(quiz="small") == "/?quiz=small"
    assert follow() == "/"


# deep linking


def select(pair: Joined, browser: httpx.Client, **settings: Any) -> httpx.Response:
    asked = pair.begin(browser)
    claims = selection_claims(pair.platform, asked, **settings) | {f"{CLAIM}context": {"id": pair.context}}
    return pair.post(browser, asked, pair.platform.sign(claims))


def chosen(pair: Joined, browser: httpx.Client, page: httpx.Response, items: list[str]) -> httpx.Response:
    fields: list[tuple[str, Any]] = [("ticket", ticket_of(page)), *(("item", item) for item in items)]
    headers = {"Content-Type": "application/x-www-form-urlencoded", **OURS}
    return browser.post("/lti/choose", content=str(httpx.QueryParams(fields)), headers=headers)


def test_an_instructor_chooses_quizzes_and_questions(pair: Joined) -> None:
    browser = pair.browser()
    page = select(pair, browser)
    assert "A small quiz" in page.text
    assert "SECRET" not in page.text
    sent = chosen(pair, browser, page, ["small", "small/q2"])
    return_url = f"{pair.platform.origin}/return?course=1"
    assert f'action="{return_url}"' in sent.text
    assert f"form-action 'self' {pair.platform.origin}" in sent.headers["content-security-policy"]
    said = pair.platform.read_selection(fields_of(sent.text)["JWT"], pair.platform.tool_keys)
    assert said[f"{DL_CLAIM}data"] == "a b&c"
    launch_url = f"{pair.site.origin}/lti/launch"
    assert said[ITEMS] == [
        {"type": "ltiResourceLink", "title": "A small quiz", "url": f"{launch_url}?quiz=small",
         "custom": {"quiz": "small"},
         "lineItem": {"scoreMaximum": 4.0, "label": "A small quiz", "resourceId": "small"}},
        {"type": "ltiResourceLink", "title": "A small quiz: q2", "url": f"{launch_url}?quiz=small&question=q2",
         "custom": {"quiz": "small", "question": "q2"},
         "lineItem": {"scoreMaximum": 1.0, "label": "A small quiz: q2", "resourceId": "small/q2"}},
    ]  # fmt: skip
    assert chosen(pair, browser, page, ["small"]).status_code == 401  # once


def test_a_link_has_the_dates_that_the_course_has_set(pair: Joined) -> None:
    dates = {"opens": "2020-01-01T00:00Z", "due": "2190-01-01T00:00Z"}
    late = {"until": "2191-01-01T00:00Z", "per_day": 0.5}
    teacher = pair.site.client("tina", "instructor", pair.course)
    rules = teacher.put("/api/v1/quizzes/small/policy", json={**dates, "late": late}, headers={"If-Match": "*"})
    assert rules.status_code == 200, rules.text
    browser = pair.browser()
    sent = chosen(pair, browser, select(pair, browser), ["small"])
    [item] = pair.platform.read_selection(fields_of(sent.text)["JWT"], pair.platform.tool_keys)[ITEMS]
    opens = "2020-01-01T00:00:00+00:00"
    assert item["submission"] == {"startDateTime": opens, "endDateTime": "2190-01-01T00:00:00+00:00"}
    assert item["available"] == {"startDateTime": opens, "endDateTime": "2191-01-01T00:00:00+00:00"}


@pytest.mark.slow
def test_a_platform_gets_what_it_takes(pair: Joined) -> None:
    browser = pair.browser()
    page = select(pair, browser, accept_multiple=False, accept_lineitem=False)
    assert 'type="radio"' in page.text
    sent = chosen(pair, browser, page, ["small/q1"])
    [item] = pair.platform.read_selection(fields_of(sent.text)["JWT"], pair.platform.tool_keys)[ITEMS]
    assert "lineItem" not in item
    page = select(pair, browser, accept_multiple=False)
    assert chosen(pair, browser, page, ["small/q1", "small/q2"]).status_code == 422
    page = select(pair, browser)
    assert chosen(pair, browser, page, ["none"]).status_code == 404
    assert chosen(pair, browser, select(pair, browser), []).status_code == 200  # nothing is a choice too


@pytest.mark.parametrize(
    "settings",
    [
        {"deep_link_return_url": "javascript:alert(1)"},
        {"deep_link_return_url": "http://platform.example/return"},
        {"deep_link_return_url": None},
        {"accept_types": ["file"]},
        {"accept_types": None},
    ],
)
def test_a_choice_that_could_not_be_given_back_is_refused(pair: Joined, settings: dict[str, Any]) -> None:
    assert select(pair, pair.browser(), **settings).status_code == 401


def test_only_instructors_choose(pair: Joined) -> None:
    browser = pair.browser()
    asked = pair.begin(browser)
    claims = selection_claims(pair.platform, asked) | {
        f"{CLAIM}context": {"id": pair.context}, f"{CLAIM}roles": [LEARNER], "sub": "learner",
    }  # fmt: skip
    assert pair.post(browser, asked, pair.platform.sign(claims)).status_code == 403


# frames


def test_pages_of_a_launch_may_be_framed_by_its_platform_alone(pair: Joined) -> None:
    browser, other = pair.browser(), pair.browser()
    pair.launch(browser)
    policy = browser.get("/").headers["content-security-policy"]
    assert f"frame-ancestors 'self' {pair.platform.origin}" in policy.split("; ")
    pages = (other.get("/"), pair.site.client("tina", "instructor", pair.course).get("/"))
    assert all("frame-ancestors 'self'" in page.headers["content-security-policy"].split("; ") for page in pages)


def test_a_session_of_a_launch_is_guarded_as_any_other(pair: Joined) -> None:
    browser = pair.browser()
    pair.launch(browser)
    body = {"quiz": "small", "question": "q1", "answer": 1}
    for headers in ({"Sec-Fetch-Site": "cross-site"}, {"Origin": pair.platform.origin}, {}):
        assert browser.post(f"{API}/submissions", json=body, headers=headers).status_code == 403
    assert browser.post("/lti/open", data={"ticket": "x"}, headers={"Sec-Fetch-Site": "cross-site"}).status_code == 403
    assert browser.post(f"{API}/submissions", json=body, headers=OURS).status_code == 201


def test_the_platforms_storage_binds_a_browser_without_cookies(pair: Joined) -> None:
    browser = pair.browser()
    fields = pair.platform.login(pair.site.origin, lti_storage_target="_parent")
    begun = browser.get("/lti/login", params=fields)
    assert begun.status_code == 200
    data = dict(re.findall(r'data-(\w+)="([^"]*)"', begun.text))
    asked = pair.platform.read_authentication_request(unescape(data["address"]), pair.site.origin)
    assert (data["storage"], data["origin"]) == ("_parent", pair.platform.origin)
    browser.cookies.clear()
    token = pair.platform.sign(pair.claims(asked, **{f"{CLAIM}custom": {"quiz": "small"}}))
    brought = pair.post(browser, asked, token)
    assert 'data-lti="bring"' in brought.text
    assert fields_of(brought.text)["id_token"] == token
    assert pair.post(browser, asked, token, key="wrong").status_code == 401
    opened = pair.post(browser, asked, token, key=data["key"])
    assert not signed_in(browser)
    entered = browser.post("/lti/open", data={"ticket": ticket_of(opened)}, headers=OURS)
    assert (entered.status_code, entered.headers["location"]) == (303, "/?quiz=small")
    assert signed_in(browser)
    assert browser.post("/lti/open", data={"ticket": ticket_of(opened)}, headers=OURS).status_code == 401


# names and roles


def test_a_roster_is_pulled_page_by_page(pair: Joined) -> None:
    pair.platform.roster = [
        {"user_id": "user-7", "name": "Ada Lovelace", "roles": [LEARNER], "status": "Active"},
        {"user_id": "user-8", "given_name": "Grace", "family_name": "Hopper", "roles": [LEARNER]},
        {"user_id": "teacher-9", "name": "Tom", "roles": [INSTRUCTOR]},
        {"user_id": "gone", "name": "Gone", "roles": [LEARNER], "status": "Inactive"},
        {"user_id": "", "name": "Nobody", "roles": [LEARNER]},
    ]
    teacher = pair.site.client("tina", "instructor", pair.course)
    [context] = get_json(teacher, f"{API}/lti/contexts")["items"]
    assert teacher.post(f"{API}/lti/contexts/{context['id']}:roster").status_code == 409  # no address yet
    service = {"context_memberships_url": f"{pair.platform.origin}/roster/0", "service_versions": ["2.0"]}
    pair.launch(pair.browser(), **{NRPS: service})
    pulled = teacher.post(f"{API}/lti/contexts/{context['id']}:roster")
    assert pulled.json() == {"members": 3, "removed": 0}
    roles = {item["name"]: item["role"] for item in get_json(teacher, f"{API}/members")["items"]}
    assert roles == {"Ada Lovelace": "student", "Grace Hopper": "student", "Tom": "instructor", "tina": "instructor"}
    again = teacher.post(f"{API}/lti/contexts/{context['id']}:roster")
    assert again.json() == {"members": 3, "removed": 0}
    assert len(get_json(teacher, f"{API}/members")["items"]) == 4
    other = pair.site.client("eve", "instructor", f"other-{secrets.token_hex(4)}")
    assert other.post(f"{API}/lti/contexts/{context['id']}:roster").status_code == 404


def test_a_name_follows_the_platform_unless_an_instructor_has_set_it(pair: Joined) -> None:
    ada, teacher = pair.browser(**OURS), pair.site.client("tina", "instructor", pair.course)
    pair.platform.roster = [{"user_id": "user-7", "name": "Ada King", "roles": [LEARNER]}]
    pair.launch(ada, **{NRPS: {"context_memberships_url": f"{pair.platform.origin}/roster/0"}})
    assert ada.post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1}).status_code == 201
    [context] = get_json(teacher, f"{API}/lti/contexts")["items"]

    def shown() -> tuple[str, str | None]:
        [one] = [item for item in get_json(teacher, f"{API}/members")["items"] if item["way_in"] == "lti"]
        return one["name"], one["named_by"]

    def pull() -> None:
        assert teacher.post(f"{API}/lti/contexts/{context['id']}:roster").json() == {"members": 1, "removed": 0}

    assert shown() == ("Ada Lovelace", None)
    pair.launch(pair.browser(), name="Ada L.")
    assert shown() == ("Ada L.", None)
    assert "Ada L." in ada.get("/").text  # in a session that was open before, too
    assert "Ada L." in teacher.get(f"{API}/gradebook.csv").text
    pull()
    assert shown() == ("Ada King", None)
    pair.launch(pair.browser(), name=None)  # some platforms tell no names
    assert shown() == ("Ada King", None)

    address = f"{API}/members/{member_id(teacher)}"
    assert teacher.patch(address, json={"name": "Countess"}).json()["named_by"] == "tina"
    pair.launch(pair.browser(), name="Ada L.")
    pull()
    csv = f"name,namespace,external_id\nSomebody,grader,{member_id(teacher)}\n"
    imported = teacher.post(f"{API}/roster:import", content=csv, headers={"Content-Type": "text/csv"})
    assert imported.status_code == 200, imported.text
    assert shown() == ("Countess", "tina")
    entries = [item for item in get_json(teacher, f"{API}/audit")["items"] if item["action"] == "member renamed"]
    assert [entry["subject"] for entry in entries] == ["Countess"]

    assert teacher.patch(address, json={"name": None}).json()["named_by"] is None
    assert shown() == ("Countess", None)
    assert teacher.post(f"{API}/roster:import", content=csv, headers={"Content-Type": "text/csv"}).is_success
    assert shown() == ("Somebody", None)
    pair.launch(pair.browser(), name="Ada L.")
    assert shown() == ("Ada L.", None)
    for wrong in ({}, {"name": " "}, {"name": "x" * 201}, {"role": "service"}):
        assert teacher.patch(address, json=wrong).status_code == 422, wrong
    student = pair.site.client("sam", course=pair.course)
    assert student.patch(address, json={"name": "Mine"}).status_code == 403


def member_id(teacher: httpx.Client) -> str:
    """The member who was launched."""
    ids = [item["id"] for item in get_json(teacher, f"{API}/members")["items"] if item["way_in"] == "lti"]
    return str(ids[0])


def test_who_is_on_two_rosters_is_two_members_and_the_instructor_is_told(pair: Joined) -> None:
    """An address that two systems tell is no proof of a person: merging would hand over the work of one of them."""
    pair.platform.roster = [
        {"user_id": "user-7", "name": "Ada Lovelace", "roles": [LEARNER], "email": "Ada@School.example"},
        {"user_id": "user-8", "name": "Grace Hopper", "roles": [LEARNER], "email": "no address"},
    ]
    teacher = pair.site.client("tina", "instructor", pair.course)
    csv = "name,email,external_id\nAda L.,ada@school.example,s1815\nBob,bob@school.example,s1816\n"
    headers = {"Content-Type": "text/csv"}
    imported = teacher.post(f"{API}/roster:import?namespace=school", content=csv, headers=headers)
    assert imported.status_code == 200, imported.text
    pair.launch(pair.browser(), **{NRPS: {"context_memberships_url": f"{pair.platform.origin}/roster/0"}})
    [context] = get_json(teacher, f"{API}/lti/contexts")["items"]
    for _ in range(2):
        assert teacher.post(f"{API}/lti/contexts/{context['id']}:roster").status_code == 200
    members = {item["name"]: item for item in get_json(teacher, f"{API}/members")["items"]}
    assert set(members) == {"tina", "Ada L.", "Bob", "Ada Lovelace", "Grace Hopper"}  # each once
    here, there = members["Ada L."], members["Ada Lovelace"]
    assert (here["same_email"], there["same_email"]) == ([there["id"]], [here["id"]])
    assert (here["way_in"], here["learner"], here["platforms"]) == ("lms", {"namespace": "school", "id": "s1815"}, [])
    assert there["platforms"] == [{"platform": "A platform", "course": "Robotics"}]
    assert [members[name]["same_email"] for name in ("tina", "Bob", "Grace Hopper")] == [[], [], []]
    assert members["Grace Hopper"]["email"] is None


def test_a_roster_that_leads_elsewhere_is_refused(pair: Joined) -> None:
    teacher = pair.site.client("tina", "instructor", pair.course)
    [context] = get_json(teacher, f"{API}/lti/contexts")["items"]
    pair.launch(pair.browser(), **{NRPS: {"context_memberships_url": f"{pair.platform.origin}/nothing"}})
    refused = teacher.post(f"{API}/lti/contexts/{context['id']}:roster")
    assert (refused.status_code, "404" in refused.json()["detail"]) == (422, True)


# scores


def test_where_a_score_goes(pair: Joined) -> None:
    scopes = [f"{AGS_SCOPE}score", f"{AGS_SCOPE}lineitem", "https://example.org/other"]
    service = {"scope": scopes, "lineitem": f"{pair.platform.origin}/items/1?type_id=2", "lineitems": "javascript:x"}
    pair.launch(pair.browser(), **{f"{CLAIM}custom": {"quiz": "small", "question": "q2"}, AGS: service})
    with pair.database.read() as session:
        [row] = session.query(Delivery).filter_by(course=pair.course)
        target = platforms.score_target(session, row)
        assert target is not None
        assert (row.quiz, row.question, row.state, row.sent_at) == ("small", "q2", "sent", None)
        assert target.line_item_url == f"{pair.platform.origin}/items/1?type_id=2"
        assert (target.line_items_url, set(target.scopes)) == ("", set(scopes[:2]))
        assert (target.lti_user_id, target.deployment_id) == ("user-7", "deployment-1")
        assert (target.resource_link_id, target.resource_id) == ("link-1", "small/q2")
        assert target.platform.client_id == pair.platform.client_id
        for elsewhere in ({"question": ""}, {"question": "q1"}, {"course": "another course"}, {"learner": "0" * 32}):
            assert platforms.score_target(session, changed(row, elsewhere)) is None
    for less in ({}, {AGS: {**service, "scope": []}}, {AGS: {**service, "scope": [f"{AGS_SCOPE}lineitem"]}}):
        pair.launch(pair.browser(), **{f"{CLAIM}custom": {"quiz": "small", "question": "q2"}, **less})
        with pair.database.read() as session:  # others' scores may be on their way
            assert platforms.score_target(session, row) == target
    pair.launch(pair.browser(), **{f"{CLAIM}custom": {"quiz": "small", "question": "q1"}})  # the link leads elsewhere
    with pair.database.read() as session:
        assert session.query(Delivery).filter_by(course=pair.course).count() == 1
        assert platforms.score_target(session, row) is None


def changed(row: Delivery, values: dict[str, str]) -> Delivery:
    """A row that differs from another in these values."""
    names = ("id", "destination", "course", "learner", "quiz", "question")
    return Delivery(**{name: getattr(row, name) for name in names} | values)


def open_link(pair: Joined, user: str, link: str, column: str, question: str = "q1") -> httpx.Client:
    """A learner opens a link whose column the launch names."""
    browser = pair.browser(**OURS)
    service = {"scope": SENDING, "lineitem": f"{pair.platform.origin}/columns/{column}"}
    place = {f"{CLAIM}custom": {"quiz": "small", "question": question}, f"{CLAIM}resource_link": {"id": link}}
    assert pair.launch(browser, sub=user, name=user, **place, **{AGS: service}).status_code == 303
    return browser


def give_answer(browser: httpx.Client, question: str, answer: Any) -> None:
    body = {"quiz": "small", "question": question, "answer": answer}
    assert browser.post(f"{API}/submissions", json=body).status_code == 201


def deliver(pair: Joined) -> list[tuple[str, str, Any]]:
    """Sends what waits; returns column, user and points of each new score."""
    before = len(pair.platform.taken)
    work(pair.database, build_deliveries(pair)[jobs.DELIVER].senders, until_s=1.5)
    return sorted(pair.platform.taken[before:])


def build_deliveries(pair: Joined) -> Any:
    settings = Settings(private_hosts=("127.0.0.1",))
    return deliveries.build_deliveries(settings, pair.database, Archive(pair.database))


def test_a_score_goes_to_the_columns_that_the_learners_own_launches_named(pair: Joined) -> None:
    ann, bob = open_link(pair, "ann", "link x", "x"), open_link(pair, "bob", "link y", "y")
    give_answer(ann, "q1", 1)
    assert deliver(pair) == [("x", "ann", 1.0)]
    give_answer(bob, "q1", 0)
    assert deliver(pair) == [("y", "bob", 0.0)]
    open_link(pair, "ann", "link x", "x")
    assert deliver(pair) == []


def test_a_column_that_a_launch_names_first_gets_the_score_that_is_known(pair: Joined) -> None:
    cid = open_link(pair, "cid", "link 1", "z1", "q2")
    give_answer(cid, "q2", "7 ms")
    assert deliver(pair) == [("z1", "cid", 0.0)]
    open_link(pair, "cid", "link 2", "z2", "q2")
    assert deliver(pair) == [("z2", "cid", 0.0)]
    give_answer(cid, "q2", "5 ms")
    assert deliver(pair) == [("z1", "cid", 1.0), ("z2", "cid", 1.0)]


def test_a_score_that_does_not_arrive_is_listed_with_its_platform(
    pair: Joined, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    give_answer(open_link(pair, "fay", "link 1", "z1"), "q1", 1)
    monkeypatch.setenv("GRADER_DATABASE_URL", pair.site.settings.database)
    cli(["deliveries", "--course", pair.course, "--state", "waiting"], standalone_mode=False)
    [line] = capsys.readouterr().out.splitlines()
    assert line.split("\t")[7] == f"{pair.platform.origin} {pair.platform.origin}/columns/z1"
    assert deliver(pair) == [("z1", "fay", 1.0)]


def test_links_that_share_a_column_send_a_score_once(pair: Joined) -> None:
    for link in ("link 1", "link 2"):
        dan = open_link(pair, "dan", link, "z")
    give_answer(dan, "q1", 1)
    assert deliver(pair) == [("z", "dan", 1.0)]


def test_a_learner_of_an_earlier_version_keeps_the_newest_link_until_the_next_launch(pair: Joined) -> None:
    """Their row belongs to no link; what it sent is known as ours in the column of the link."""
    eve = open_link(pair, "eve", "link 1", "z1")
    with pair.database.write() as session:
        [row] = session.query(Delivery).filter_by(course=pair.course)
        session.delete(row)
        session.flush()
        send_scores(pair.database, session, pair.course, "small", "q1")
    give_answer(eve, "q1", 0)
    assert deliver(pair) == [("z1", "eve", 0.0)]
    open_link(pair, "eve", "link 1", "z1")
    assert deliver(pair) == []
    give_answer(eve, "q1", 1)
    assert deliver(pair) == [("z1", "eve", 1.0)]


def test_a_submission_review_opens_the_learners_verdict(pair: Joined) -> None:
    ada, teacher = pair.browser(**OURS), pair.browser(**OURS)
    item = f"{pair.platform.origin}/lineitem"
    gradebook = {"lineitem": item, "scope": [f"{AGS_SCOPE}score"]}
    pair.launch(ada, **{f"{CLAIM}custom": {"quiz": "small", "question": "q1"}, AGS: gradebook})
    assert ada.post(f"{API}/submissions", json={"quiz": "small", "question": "q1", "answer": 1}).status_code == 201
    review: dict[str, Any] = {
        f"{CLAIM}message_type": "LtiSubmissionReviewRequest",
        f"{CLAIM}for_user": {"user_id": "user-7", "name": "Ada Lovelace"},
        AGS: gradebook,
    }
    opened = pair.teach(teacher, **review)
    assert opened.status_code == 303, opened.text
    address = opened.headers["location"]
    assert re.fullmatch(r"/instructor/learners/[0-9a-f]{32}#small--q1", address)
    shown = teacher.get(address.partition("#")[0]).text
    assert 'id="small--q1"' in shown
    assert "Correct1 / 1" in re.sub(r"<[^>]*>", "", shown).replace("\u202f", " ")
    # without the link, the column says which question it is
    assert pair.teach(teacher, **review, **{f"{CLAIM}resource_link": None}).headers["location"] == address
    elsewhere = {**review, AGS: {"lineitem": f"{item}/2"}, f"{CLAIM}resource_link": None}
    assert pair.teach(teacher, **elsewhere).headers["location"] == address.partition("#")[0]
    assert pair.launch(pair.browser(), **review).headers["location"] == "/?quiz=small#small--q1"
    other = pair.launch(pair.browser(), **review, sub="user-8", name="Eve")
    assert (other.status_code, "Only an instructor" in other.text) == (403, True)
    stranger = pair.teach(pair.browser(), **review | {f"{CLAIM}for_user": {"user_id": "user-99"}})
    assert (stranger.status_code, "no work to show" in stranger.text) == (404, True)


def test_an_erased_learner_is_known_to_no_platform(pair: Joined) -> None:
    pair.launch(pair.browser(), name="Forget Me")
    with pair.database.write() as session:
        [member] = session.query(Member).filter_by(course=pair.course, name="Forget Me")
        erase_learner(pair.database, session, member_id=member.id, course=pair.course)
        session.flush()
        assert session.query(platforms.LtiUser).filter_by(member=member.id).count() == 0


# rotation


def test_a_platform_may_rotate_its_keys(pair: Joined) -> None:
    pair.launch(pair.browser())
    fetched = pair.platform.key_fetches
    pair.platform.published = KEYS[::-1]
    browser = pair.browser()
    asked = pair.begin(browser)
    claims: Claims = pair.claims(asked)
    keys = pair.site.app.state.services.tool.platform_keys
    keys._sets.clear()  # as after the hour for which keys are kept
    assert pair.post(browser, asked, pair.platform.sign(claims, KEYS[1])).status_code == 303
    assert pair.platform.key_fetches == fetched + 1
    pair.platform.published = KEYS[:1]
    keys._sets.clear()
    asked = pair.begin(browser)
    assert pair.post(browser, asked, pair.platform.sign(pair.claims(asked), KEYS[1])).status_code == 401
    assert browser.cookies.get(COOKIE)
