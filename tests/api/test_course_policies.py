"""Dates and rules that a course sets in place of those of the content: every reader sees them, and no other course."""

import io
import json
import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from secrets import token_hex
from typing import Any

import httpx
import pytest

from grader.courses.people import members
from grader.courses.people.identity import COOKIE, Role
from grader.courses.people.sign_in import start_session
from grader.settings import Settings
from support.databases import BACKENDS, database_url
from support.sites import ROOT, Site, open_site, write_content

API = "/api/v1"
CONTENT: dict[str, Any] = {
    "opens": "2003-02-03T04:05Z",
    "due": "2171-05-06T07:08Z",
    "late": {"until": "2172-06-07T08:09Z", "per_day": 0.97, "floor": 0.41},
    "attempts": 97,
    "counts": "average",
    "feedback": "immediate",
    "solutions": "never",
}
COURSE: dict[str, Any] = {
    "opens": "2004-03-04T05:06Z",
    "due": "2181-05-06T07:08Z",
    "late": {"until": "2182-06-07T08:09Z", "per_day": 0.83, "floor": 0.31},
    "attempts": 83,
    "counts": "latest",
    "feedback": "after_publish",
    "solutions": "with_feedback",
}
OF_THE_CONTENT = re.compile(r"\b2003\b|\b2171\b|\b2172\b|\b97\b|0\.41|\baverage\b|their average", re.IGNORECASE)
RULED: dict[str, Any] = {
    "id": "7.1-ruled",
    "title": "Ruled",
    "policy": CONTENT,
    "anonymous": False,
    "questions": [
        {"kind": "mcq", "id": "which", "q": "Which?", "options": ["a", "b", "c"], "answer": 1, "explain": "It is b."},
        {"kind": "open", "id": "why", "q": "Why?", "points": 4},
    ],
}
ANYWHERE = ("/static/", "/openapi.json", "/metrics", "/readyz", "/healthz", "/favicon.ico")


@pytest.fixture(scope="module", params=BACKENDS)
def shared(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("ruled")
    content = write_content(folder / "content")
    lesson = json.loads((ROOT / "quizzes" / "1.3-exercises.json").read_text())
    script = next(question for question in lesson["questions"] if question["id"] == "rk4-step")
    script.pop("starter", None)
    quiz = {**RULED, "questions": [*RULED["questions"], script]}
    (content / "quizzes" / "7.1-ruled.json").write_text(json.dumps(quiz))
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(content=content, database_url=url, data=folder / "data", workers=0)) as site,
    ):
        yield site


@pytest.fixture
def site(shared: Site) -> Site:
    """A course of its own."""
    return replace(shared, course=f"course-{token_hex(4)}")


@pytest.fixture
def teacher(site: Site) -> httpx.Client:
    return open_browser(site, "tina", Role.INSTRUCTOR)


def open_browser(site: Site, name: str, role: Role = Role.STUDENT) -> httpx.Client:
    """A client with a token for the API, and a session for pages."""
    client = site.client(name, role.value)
    client.headers.update({"Origin": site.origin, "Sec-Fetch-Site": "same-origin"})
    with site.app.state.services.database.write() as session:
        opened = start_session(session, members.get_named(session, name, role, site.course))
    client.cookies.set(COOKIE, opened.secret, domain="127.0.0.1", path="/")
    return client


def put(teacher: httpx.Client, changes: dict[str, Any], tag: str = "*", quiz: str = "7.1-ruled") -> httpx.Response:
    return teacher.put(f"{API}/quizzes/{quiz}/policy", json=changes, headers={"If-Match": tag})


def set_policy(teacher: httpx.Client, changes: dict[str, Any]) -> dict[str, Any]:
    response = put(teacher, changes)
    assert response.status_code == 200, response.text
    shown: dict[str, Any] = response.json()
    return shown


def answer(client: httpx.Client, question: str, given: Any) -> dict[str, Any]:
    response = client.post(f"{API}/submissions", json={"quiz": "7.1-ruled", "question": question, "answer": given})
    assert response.status_code == 201, response.text
    made: dict[str, Any] = response.json()
    return made


def result(client: httpx.Client, question: str = "which") -> Any:
    questions = client.get(f"{API}/quizzes/7.1-ruled").json()["questions"]
    return next(one for one in questions if one["id"] == question)["result"]


@dataclass
class Walk:
    """The addresses of every route that is read, with what fills them."""

    site: Site
    fills: dict[str, str]

    def list_addresses(self) -> Iterator[str]:
        for route in self.site.app.routes:
            path, methods = getattr(route, "path", ""), getattr(route, "methods", None) or ()
            if "GET" not in methods or path.startswith(ANYWHERE) or path.endswith("/events"):
                continue
            names = re.findall(r"{(\w+)(?::\w+)?}", path)
            if all(name in self.fills for name in names):
                yield re.sub(r"{(\w+)(?::\w+)?}", lambda match: self.fills[match[1]], path)

    def read(self, client: httpx.Client) -> dict[str, str]:
        """The text of every address that the client may read."""
        told = {}
        for address in self.list_addresses():
            asked = [address] if "quiz" in address else [address, f"{address}?quiz=7.1-ruled"]
            for one in asked:
                response = client.get(one)
                if response.status_code == 200:
                    told[one] = unpack(response)
        return told


def unpack(response: httpx.Response) -> str:
    """The text of a response, and of the files in it."""
    if response.headers["content-type"] != "application/zip":
        return response.text
    with zipfile.ZipFile(io.BytesIO(response.content)) as packed:
        return "\n".join(packed.read(name).decode() for name in packed.namelist())


@pytest.mark.parametrize("shared", ["sqlite"], indirect=True)  # others ask both databases
def test_no_reader_tells_what_the_content_says_where_the_course_has_set_it(site: Site, teacher: httpx.Client) -> None:
    ann = open_browser(site, "ann")
    made = [answer(ann, "which", 0), answer(ann, "why", "Because."), answer(ann, "which", 1)]
    learner = teacher.get(f"{API}/members").json()["items"][0]["id"]
    fills = {
        "quiz_id": "7.1-ruled", "question_id": "rk4-step", "lesson": "7.1", "learner": learner, "question": "why",
        "submission_id": made[1]["id"], "quiz": "7.1-ruled",
    }  # fmt: skip
    walk = Walk(site, fills)
    before = {role: walk.read(client) for role, client in (("student", ann), ("instructor", teacher))}
    telling = {address for role in before for address, text in before[role].items() if OF_THE_CONTENT.search(text)}
    assert {"/", f"{API}/quizzes", f"{API}/quizzes/7.1-ruled", "/instructor/extensions?quiz=7.1-ruled"} <= telling
    assert f"/instructor/learners/{learner}/lessons/7.1" in telling
    set_policy(teacher, COURSE)
    after = {role: walk.read(client) for role, client in (("student", ann), ("instructor", teacher))}
    sources = {f"{API}/quizzes/7.1-ruled/policy", "/instructor/dates", "/instructor/dates?quiz=7.1-ruled"}
    for role, texts in after.items():
        assert texts.keys() == before[role].keys()
        leaks = {at: hit[0] for at, text in texts.items() if at not in sources and (hit := OF_THE_CONTENT.search(text))}
        assert not leaks, f"{role} is told what the content says"
        told = {address for address, text in texts.items() if "2181" in text or "latest" in text}
        assert telling & texts.keys() <= told | sources


def test_a_policy_is_shown_with_where_each_value_comes_from(site: Site, teacher: httpx.Client) -> None:
    before = teacher.get(f"{API}/quizzes/7.1-ruled/policy")
    assert before.json()["changes"] == {}
    assert before.json()["policy"] == before.json()["content"]
    changed = put(teacher, {"due": "2026-12-24T19:00+01:00", "attempts": None}, before.headers["ETag"])
    assert changed.status_code == 200, changed.text
    shown = changed.json()
    assert shown["changes"] == {"attempts": None, "due": "2026-12-24T18:00:00Z"}
    assert shown["policy"] == {**before.json()["content"], **shown["changes"]}
    assert shown["content"] == before.json()["content"]
    assert (shown["changed_by"], shown["conflicts"]) == ("tina", [])
    again = teacher.get(f"{API}/quizzes/7.1-ruled/policy")
    assert (again.json(), again.headers["ETag"]) == (shown, changed.headers["ETag"])
    assert put(teacher, {}, before.headers["ETag"]).status_code == 412
    assert put(teacher, {}, again.headers["ETag"]).json()["policy"] == before.json()["content"]
    assert teacher.get(f"{API}/quizzes/7.1-ruled/policy").headers["ETag"] == before.headers["ETag"]
    unnamed = teacher.put(f"{API}/quizzes/7.1-ruled/policy", json={})
    assert unnamed.status_code == 428
    entries = [
        item for item in teacher.get(f"{API}/audit").json()["items"] if item["action"] == "dates and rules changed"
    ]
    assert [(entry["subject"], entry["name"], entry["detail"]["after"]) for entry in entries] == [
        ("7.1-ruled", "tina", {}), ("7.1-ruled", "tina", shown["changes"])
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (
            {"due": "tomorrow"},
            "due: must be a date and time with its offset, such as 2026-10-19T18:00+02:00, not 'tomorrow'",
        ),
        ({"due": "2026-01-01T00:00"}, "due: "),
        ({"opens": "2171-05-06T07:08Z"}, "due: must be later than opens"),
        ({"due": None}, "late: needs a due date, and an until that is later"),
        ({"due": None, "late": None, "feedback": "after_due"}, "feedback: after_due needs a due date: add due"),
        ({"late": {"per_day": 0.5, "untill": "2199-01-01T00:00Z"}}, "late.untill: unknown key: write 'until'"),
        ({"attempts": 0}, "attempts: must be greater than or equal to 1"),
        ({"attempts": "3"}, "attempts: must be a valid integer"),
        ({"counts": "worst"}, "counts: must be 'best', 'latest' or 'average'"),
        ({"dew": "2199-01-01T00:00Z"}, "dew: unknown key: write 'due'"),
        ({"due": 1}, "due: "),
        ({"due": []}, "due"),
        ({"dew": {"x": [[1]]}}, "dew"),
        ({"late": {"until": {"x": 1}}}, "late"),
        ({"late": {"until": "2199-01-01T00:00Z", "per_day": 7}}, "late.per_day: "),
    ],
)
def test_a_wrong_policy_is_refused_as_in_a_quiz_file(teacher: httpx.Client, changes: dict[str, Any], why: str) -> None:
    refused = put(teacher, changes)
    assert refused.status_code == 422
    assert why in refused.json()["detail"]
    assert teacher.get(f"{API}/quizzes/7.1-ruled/policy").json()["changes"] == {}


def test_remarks_are_left_out_and_nesting_is_refused(teacher: httpx.Client) -> None:
    assert set_policy(teacher, {"x-why": "exams", "attempts": 3})["changes"] == {"attempts": 3}
    text = '{"late": ' + "[" * 900 + "]" * 900 + "}"
    headers = {"If-Match": "*", "Content-Type": "application/json"}
    assert teacher.put(f"{API}/quizzes/7.1-ruled/policy", content=text, headers=headers).status_code == 422


def test_only_an_instructor_reads_and_sets_it(site: Site, teacher: httpx.Client) -> None:
    for client, status in ((site.client("ann"), 403), (site.client("lms", "service"), 403), (site.anonymous(), 401)):
        assert client.get(f"{API}/quizzes/7.1-ruled/policy").status_code == status
        assert put(client, {}).status_code == status
    assert put(teacher, {}, quiz="none").status_code == 404
    assert teacher.get(f"{API}/quizzes/none/policy").status_code == 404


def test_two_courses_with_one_quiz_do_not_influence_each_other(shared: Site, site: Site, teacher: httpx.Client) -> None:
    other = replace(shared, course=f"course-{token_hex(4)}")
    theirs = other.client("tom", "instructor")
    set_policy(teacher, {"opens": "2150-01-01T00:00Z", "attempts": 2})
    ann, bob = site.client("ann"), other.client("bob")
    assert ann.get(f"{API}/quizzes/7.1-ruled").json()["questions"] == []
    refused = ann.post(f"{API}/submissions", json={"quiz": "7.1-ruled", "question": "which", "answer": 1})
    assert (refused.status_code, refused.json()["detail"]) == (409, "This quiz opens on 1 Jan 2150, 00:00 UTC.")
    answer(bob, "which", 1)
    assert bob.get(f"{API}/quizzes/7.1-ruled").json()["questions"][0]["attempts_left"] == 96
    assert theirs.get(f"{API}/quizzes/7.1-ruled/policy").json()["changes"] == {}


def test_what_counts_follows_the_course_at_once(site: Site, teacher: httpx.Client) -> None:
    ann = site.client("ann")
    for given in (1, 0):
        answer(ann, "which", given)
    assert result(ann)["points"] == 0.5
    set_policy(teacher, {"counts": "best"})
    assert (result(ann)["points"], result(ann)["attempt"]) == (1.0, 1)
    answer(ann, "which", 2)
    assert result(ann)["points"] == 1.0
    yesterday = datetime.now(UTC) - timedelta(hours=30)
    late = {"until": "2199-01-01T00:00Z", "per_day": 0.5}
    set_policy(teacher, {"counts": "best", "due": yesterday.isoformat(), "late": late})
    assert (result(ann)["points"], result(ann)["is_late"]) == (0.25, True)
    csv = teacher.get(f"{API}/gradebook.csv?quiz=7.1-ruled").text
    assert "0.25" in csv
    feed = site.client("lms", "service").get(f"{API}/results").json()["items"]
    assert [one["points"] for one in feed if one["question"] == "which"][-1] == 0.25
    set_policy(teacher, {})
    assert result(ann)["points"] == pytest.approx(1 / 3)


def test_attempts_are_those_of_the_course(site: Site, teacher: httpx.Client) -> None:
    ann = site.client("ann")
    set_policy(teacher, {"attempts": 1})
    assert answer(ann, "which", 0)["attempt"] == 1
    refused = ann.post(f"{API}/submissions", json={"quiz": "7.1-ruled", "question": "which", "answer": 1})
    assert refused.json()["detail"] == "The only attempt at this question is used up."


def test_withheld_feedback_reaches_no_answer_and_no_kit(site: Site, teacher: httpx.Client) -> None:
    ann = site.client("ann")
    kit = f"{API}/quizzes/7.1-ruled/questions/rk4-step/kit"
    judged = unpack(ann.get(kit))
    set_policy(teacher, {"feedback": "after_publish"})
    made = answer(ann, "which", 1)
    assert (made["verdict"]["status"], made["verdict"]["points"]) == ("needs_review", 0.0)
    withheld = unpack(ann.get(kit))
    assert len(withheld) < len(judged)
    assert ann.get(f"{API}/submissions/{made['id']}").json()["verdict"]["status"] == "needs_review"
    set_policy(teacher, {})
    assert ann.get(f"{API}/submissions/{made['id']}").json()["verdict"]["status"] == "correct"


def test_content_that_no_longer_fits_is_told_and_shows_nothing_more(site: Site, teacher: httpx.Client) -> None:
    set_policy(teacher, {"due": None, "late": None})
    path = site.settings.content / "quizzes" / "7.1-ruled.json"
    text = path.read_text()
    quiz = json.loads(text)
    quiz["policy"]["feedback"] = "after_due"
    path.write_text(json.dumps(quiz))
    try:
        assert teacher.post(f"{API}/content:reload").status_code == 200
        shown = teacher.get(f"{API}/quizzes/7.1-ruled/policy").json()
        (conflict,) = shown["conflicts"]
        assert conflict.startswith("feedback: after_due needs a due date")
        assert "no longer fits what is set here" in teacher.get("/instructor/dates?quiz=7.1-ruled").text
        made = answer(site.client("ann"), "which", 1)
        assert made["verdict"]["status"] == "needs_review"
        assert "after the due date, which is not set yet" in made["verdict"]["diagnosis"]
    finally:
        path.write_text(text)
        assert teacher.post(f"{API}/content:reload").status_code == 200


def save(teacher: httpx.Client, **fields: str) -> httpx.Response:
    """Sends the form of the page with some fields changed, as a browser without scripts does."""
    page = teacher.get("/instructor/dates?quiz=7.1-ruled").text
    form = page[page.index("<form", page.index('id="back"') + 1) :]
    sent = dict(re.findall(r'<input type="[\w-]+" name="(\w+)"[^>]*? value="([^"]*)"', form))
    for name, options in re.findall(r'<select name="(\w+)"(.*?)</select>', form, re.DOTALL):
        sent[name] = next(iter(re.findall(r'<option value="(\w+)" selected', options)))
    return teacher.post("/instructor/dates", data=sent | fields)


def test_the_page_sets_only_what_was_changed_and_goes_back(site: Site, teacher: httpx.Client) -> None:
    def changes() -> Any:
        return teacher.get(f"{API}/quizzes/7.1-ruled/policy").json()["changes"]

    assert save(teacher).status_code == 200
    assert changes() == {}
    saved = save(teacher, due="2190-12-24T18:00", late_until="2191-01-01T00:00", attempts="")
    assert (saved.status_code, "Saved." in saved.text) == (200, True)
    late = {"per_day": 0.97, "floor": 0.41, "until": "2191-01-01T00:00:00Z"}
    assert changes() == {"due": "2190-12-24T18:00:00Z", "attempts": None, "late": late}
    assert "The content says: Mon 6 May 2171, 07:08 UTC." in re.sub("</?time[^>]*>", "", saved.text)
    assert "any number" in saved.text
    save(teacher, attempts="97")  # as in the content
    assert changes() == {"due": "2190-12-24T18:00:00Z", "late": late}
    save(teacher, back="late")
    assert changes() == {"due": "2190-12-24T18:00:00Z", "late": late}  # until would come before the due date
    save(teacher, late_until="", late_per_day="", late_floor="")
    assert changes() == {"due": "2190-12-24T18:00:00Z", "late": None}
    save(teacher, back="due")
    save(teacher, back="late")
    assert changes() == {}


def test_the_page_keeps_what_was_typed_and_says_what_is_wrong(site: Site, teacher: httpx.Client) -> None:
    refused = save(teacher, due="2001-01-01T00:00", attempts="many", late_per_day="2")
    assert refused.status_code == 422
    assert "Due: must be later than opens" in refused.text
    assert "Attempts at each question: must be a valid integer" in refused.text
    assert "Late answers (late.per_day): must be less than or equal to 1" in refused.text
    assert 'value="2001-01-01T00:00"' in refused.text
    stale = save(teacher, version="0" * 24, attempts="5")
    assert (stale.status_code, "changed since you saw them" in stale.text) == (412, True)
    assert teacher.get(f"{API}/quizzes/7.1-ruled/policy").json()["changes"] == {}
