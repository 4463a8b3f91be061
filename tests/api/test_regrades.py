"""`/regrades` and its pages: who may start, see and cancel one, and what they say."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from grader.grading.processes import Graders
from grader.queue.worker import Worker
from grader.service.worker import build_worker
from support.sites import QUIZ, Site

pytestmark = pytest.mark.slow

API = "/api/v1"
SAME_ORIGIN = {"Sec-Fetch-Site": "same-origin"}


@pytest.fixture
def site(open_site_with: Callable[..., Site]) -> Site:
    """A server without a worker; `work` does the jobs."""
    return open_site_with()


def work(site: Site) -> None:
    services = site.app.state.services
    worker: Worker = build_worker(
        site.settings, services.database, services.content.archive, Graders(0, allow_t2=False)
    )
    while worker.do_one():
        pass


def hand_in(site: Site, user: str, answer: int | str, question: str = "q1") -> str:
    made = site.client(user).post(f"{API}/submissions", json={"quiz": "small", "question": question, "answer": answer})
    assert made.status_code == 201, made.text
    return str(made.json()["id"])


def change_key(teacher: httpx.Client, content: Path, answer: int) -> None:
    """Sets the right option of the first question."""
    questions = [{**QUIZ["questions"][0], "answer": answer}, *QUIZ["questions"][1:]]
    (content / "quizzes" / "small.json").write_text(json.dumps({**QUIZ, "questions": questions}))
    assert teacher.post(f"{API}/content:reload").status_code == 200


def test_a_wrong_key_is_corrected_over_http(site: Site, content: Path) -> None:
    teacher = site.client("tina", "instructor")
    made = hand_in(site, "ann", 2)
    hand_in(site, "bob", 1)
    change_key(teacher, content, 2)
    body = {"quiz": "small", "question": "q1", "scope": "all", "dry_run": True}
    started = teacher.post(f"{API}/regrades", json=body)
    assert started.status_code == 202
    assert started.json() | {"status": "queued", "progress": {"total": 2, "done": 0, "outcomes": {}}} == started.json()
    work(site)
    tried = teacher.get(started.headers["location"]).json()
    assert (tried["status"], tried["progress"]["outcomes"]) == ("done", {"changed": 2})
    changes = {item["user"]: (item["before"], item["after"], item["difference"]) for item in tried["items"]}
    assert changes == {"ann": (0, 1, 1), "bob": (1, 0, -1)}
    ann = site.client("ann")
    before = ann.get(f"{API}/submissions/{made}")
    assert before.json()["verdict"]["status"] == "incorrect"
    applied = teacher.post(f"{API}/regrades", json=body | {"dry_run": False})
    work(site)
    assert teacher.get(applied.headers["location"]).json()["items"] == tried["items"]
    after = ann.get(f"{API}/submissions/{made}")
    assert after.json()["verdict"]["status"] == "correct"
    assert after.headers["etag"] != before.headers["etag"]
    feed = site.client("lms", "service").get(f"{API}/results").json()["items"]
    assert sorted((row["user"], row["revision"], row["points"]) for row in feed) == [
        ("ann", 1, 0), ("ann", 2, 1), ("bob", 1, 1), ("bob", 2, 0),
    ]  # fmt: skip
    listed = teacher.get(f"{API}/regrades").json()["items"]
    assert [one["dry_run"] for one in listed] == [False, True]
    audit = [entry["action"] for entry in teacher.get(f"{API}/audit").json()["items"]]
    assert audit.count("regrade started") == 2


def test_differences_come_in_pages(site: Site, content: Path) -> None:
    teacher = site.client("tina", "instructor")
    for number in range(5):
        hand_in(site, f"user{number}", number % 2 + 1)
    change_key(teacher, content, 2)
    location = teacher.post(f"{API}/regrades", json={"quiz": "small", "scope": "latest"}).headers["location"]
    work(site)
    for query, expected in (("", 5), ("changed=true&", 5)):
        seen, url = [], f"{location}?{query}limit=2"
        while url:
            page = teacher.get(url)
            seen += [item["learner"] for item in page.json()["items"]]
            url = page.links["next"]["url"] if "next" in page.links else ""
        assert len(seen) == len(set(seen)) == expected
    assert teacher.get(f"{location}?cursor=x").status_code == 422


def test_a_regrade_is_the_instructors_of_its_course(site: Site, content: Path) -> None:
    teacher, other = site.client("tina", "instructor"), site.client("otto", "instructor", "elsewhere")
    made = hand_in(site, "ann", 1)
    body = {"quiz": "small", "scope": {"submission_ids": [made]}, "dry_run": True}
    location = teacher.post(f"{API}/regrades", json=body).headers["location"]
    assert site.anonymous().post(f"{API}/regrades", json=body).status_code == 401
    assert site.client("ann").post(f"{API}/regrades", json=body).status_code == 403
    assert site.client("lms", "service").get(location).status_code == 403
    assert other.get(location).status_code == other.post(f"{location}:cancel").status_code == 404
    assert other.post(f"{API}/regrades", json=body).status_code == 404
    assert other.get(f"{API}/regrades").json()["items"] == []
    assert teacher.get(f"{API}/regrades/none").status_code == 404
    cancelled = teacher.post(f"{location}:cancel")
    assert (cancelled.status_code, cancelled.json()["status"]) == (200, "cancelled")
    assert teacher.post(f"{location}:cancel").status_code == 200
    work(site)
    assert teacher.get(location).json()["progress"]["done"] == 0


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"quiz": "none"}, 404),
        ({"question": "none"}, 404),
        ({"scope": "some"}, 422),
        ({"scope": {"submission_ids": []}}, 422),
        ({"scope": {"submission_ids": ["f" * 32]}}, 404),
        ({"scope": {"submission_ids": ["f"] * 1001}}, 422),
        ({"dry": True}, 422),
    ],
)
def test_a_request_that_means_nothing_is_refused(site: Site, change: dict[str, object], status: int) -> None:
    body = {"quiz": "small", "scope": "all", "dry_run": False} | change
    assert site.client("tina", "instructor").post(f"{API}/regrades", json=body).status_code == status


def test_two_regrades_never_change_one_quiz_at_the_same_time(site: Site) -> None:
    teacher = site.client("tina", "instructor")
    hand_in(site, "ann", 1)
    body = {"quiz": "small", "scope": "all", "dry_run": False}
    first = teacher.post(f"{API}/regrades", json=body)
    assert teacher.post(f"{API}/regrades", json=body).status_code == 409
    assert teacher.post(f"{API}/regrades", json=body | {"dry_run": True}).status_code == 202
    work(site)
    assert teacher.post(f"{API}/regrades", json=body).status_code == 202
    assert teacher.post(f"{first.headers['location']}:cancel").status_code == 409


def signed_in(site: Site) -> httpx.Client:
    """An instructor's browser as far as HTTP goes."""
    from grader.service.accounts import sign_in_url

    code = sign_in_url(site.settings).rpartition("=")[2]
    browser = site.anonymous(SAME_ORIGIN)
    browser.follow_redirects = True
    assert browser.post("/signin", data={"code": code}).status_code == 200
    return browser


def test_the_pages_try_out_apply_and_cancel_without_a_script(site: Site, content: Path) -> None:
    made = hand_in(site, "ann", 2)
    for name, choice in (("zoe", 2), ("Cem", 1), ("dee", 2), ("Bob", 1)):
        hand_in(site, name, choice)
    browser, teacher = signed_in(site), site.client("tina", "instructor")
    change_key(teacher, content, 2)
    assert "q1: Which?" in browser.get("/instructor/regrades").text
    hasty = {"what": "small/q1", "scope": "all", "apply": "yes"}
    shown = browser.post("/instructor/regrades", data=hasty)  # the difference is seen first all the same
    assert 'http-equiv="refresh"' in shown.text
    assert "Cancel" in shown.text
    work(site)
    tried = browser.get(str(shown.url)).text
    assert 'http-equiv="refresh"' not in tried
    assert re.search(r"ann.*incorrect 0 → correct 1.*changed.*\+1", tried, re.DOTALL)
    assert "Points would change for 5 learners: 3 up, 2 down" in tried
    assert re.search("ann.*Bob.*Cem.*dee.*zoe", tried, re.DOTALL)
    assert teacher.get(f"{API}/submissions/{made}").json()["revision"] == 1
    applied = browser.post(f"{shown.url}/apply")
    cancelled = browser.post(f"{applied.url}/cancel")
    assert "Cancelled" in cancelled.text
    browser.post(f"{shown.url}/apply")
    work(site)
    assert teacher.get(f"{API}/submissions/{made}").json()["verdict"]["status"] == "correct"
    refused = browser.post("/instructor/regrades", data={"what": "small", "scope": "these", "ids": ""})
    assert (refused.status_code, "Choose which submissions" in refused.text) == (409, True)


@pytest.mark.parametrize(("scope", "is_named"), [("latest", False), ("these", True)])
def test_a_cancelled_regrade_says_what_it_left_and_leads_to_the_form(
    site: Site, content: Path, scope: str, is_named: bool
) -> None:
    ids = [hand_in(site, f"user{number:02}", 2 - number % 2) for number in range(30)]
    ids += [hand_in(site, "user00", 1)] if is_named else []  # a learner of whom one submission may be done
    browser, teacher = signed_in(site), site.client("tina", "instructor")
    change_key(teacher, content, 2)
    form = {"what": "small/q1", "scope": scope, "ids": " ".join(ids) if is_named else ""}
    tried = browser.post("/instructor/regrades", data=form)
    work(site)
    applied = browser.post(f"{tried.url}/apply")
    services = site.app.state.services
    worker = build_worker(site.settings, services.database, services.content.archive, Graders(0, allow_t2=False))
    assert worker.do_one()
    text = browser.post(f"{applied.url}/cancel").text
    regrade = teacher.get(f"{API}/regrades/{str(applied.url).rpartition('/')[2]}").json()
    differences = [item["difference"] for item in regrade["items"] if item["difference"]]
    up, down = (sum(sign * each > 0 for each in differences) for sign in (1, -1))
    left = regrade["progress"]["total"] - regrade["progress"]["done"]
    assert 0 < len(differences) < 30 and left
    assert f"Points changed for {up + down} learners: {up} up, {down} down." in text
    assert f"The verdicts that changed stay; those of the other {left} submissions are as they were." in text
    filled = browser.get(re.findall(r'href="([^"]*like=[^"]*)">Regrade the same scope again', text)[0]).text
    assert re.findall(r'<option value="([^"]+)" selected>', filled) == ["small/q1", scope]
    assert re.findall("[0-9a-f]{32}", filled.partition("<textarea")[2].partition("</textarea>")[0]) == (
        ids if is_named else []
    )
    other = browser.post(str(browser.post("/instructor/regrades", data=form).url) + "/cancel").text
    assert "Nothing was graded again." in other and "Points would change" not in other
    assert browser.get("/instructor/regrades?like=none").status_code == 404


def test_the_pages_are_for_instructors(site: Site) -> None:
    assert site.anonymous().get("/instructor/regrades").status_code == 401
    nobody = site.anonymous(SAME_ORIGIN)
    assert nobody.post("/instructor/regrades", data={"what": "small", "scope": "all"}).status_code == 401
    nobody.post("/session")
    assert nobody.get("/instructor/regrades").status_code == 403
    assert nobody.post("/instructor/regrades", data={"what": "small", "scope": "all"}).status_code == 403
    assert nobody.get(f"/instructor/regrades/{'f' * 32}").status_code == 403
