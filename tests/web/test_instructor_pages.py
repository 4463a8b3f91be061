"""An instructor's pages without a browser: statistics, a learner's view, extensions, the service, content, blinding."""

import csv
import html
import io
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import select

from grader.certify import Certificate, keys
from grader.certify.remarks import Luck
from grader.courses.people import members
from grader.courses.people.identity import COOKIE, Role
from grader.courses.people.invitations import invite_member
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.courses.rules.statistics import Estimate, QuestionStatistics
from grader.exercises import load_kinds
from grader.library import load
from grader.questions.kinds.number import NumberQuestion
from grader.settings import Settings
from grader.store.tables import VerdictRow
from grader.web.author.draft import describe_points
from grader.web.instructor import certificates, extensions
from grader.web.instructor.statistics_plots import plot_estimates
from grader.web.text.certificates import word_key
from support.content import PASSED, load_content
from support.sites import ROOT, Site, open_site, write_content

API = "/api/v1"
DRAFT = "/instructor/draft"
LENGTH: dict[str, Any] = {
    "kind": "numeric", "id": "length", "q": "How long is six?", "answer": 6, "tol": 0,
    "verify": {"by": "expression", "expr": "2 * 3"},
}  # fmt: skip
FALLING = """<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body><joint type="slide" axis="0 0 1"/>
<geom size="0.1"/></body></worldbody></mujoco>"""
HOSTILE = "<img src=x onerror=alert(1)>"
GRADED: dict[str, Any] = {
    "id": "2-graded",
    "title": "Graded",
    "policy": {"feedback": "after_publish", "due": "2100-01-01T00:00Z", "attempts": 3},
    "second_marking": {"share": 1},
    "questions": [
        {"kind": "mcq", "id": "which", "q": "Which?", "options": ["a", "b"], "answer": 1, "explain": "SECRET"},
        {"kind": "open", "id": "why", "q": "Why?", "points": 4},
    ],
}


@contextmanager
def open_graded(folder: Path) -> Iterator[Site]:
    """A server with a graded quiz, a script and the small quiz."""
    content = write_content(folder / "content")
    (content / "quizzes" / "2-graded.json").write_text(json.dumps(GRADED))
    lesson = json.loads((ROOT / "quizzes" / "1.3-exercises.json").read_text())
    script = next(question for question in lesson["questions"] if question["id"] == "rk4-step")
    script.pop("starter", None)
    (content / "quizzes" / "3-scripts.json").write_text(
        json.dumps({**lesson, "id": "3-scripts", "questions": [script]})
    )
    with open_site(Settings(content=content, data=folder / "data", workers=0)) as site:
        yield site


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_graded(tmp_path_factory.mktemp("pages")) as site:
        yield site


@pytest.fixture
def alone(tmp_path: Path) -> Iterator[Site]:
    """A course that no other shares its folder with."""
    with open_graded(tmp_path) as site:
        yield site


@pytest.fixture
def site(shared: Site, request: pytest.FixtureRequest) -> Site:
    """A course of its own."""
    return replace(shared, course=f"course-{abs(hash(request.node.name)) % 10**9}")


@pytest.fixture
def tina(site: Site) -> httpx.Client:
    return browser(site, "tina", "instructor")


def browser(site: Site, user: str, role: str = "student", course: str | None = None) -> httpx.Client:
    """A client with a token for the API and a session for pages, whose forms come from the site's own pages."""
    client = site.client(user, role, course)
    client.headers.update({"Origin": site.origin, "Sec-Fetch-Site": "same-origin"})
    with site.app.state.services.database.write() as session:
        code = create_sign_in_code(session, user, role, course or site.course)
        client.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    return client


def answer(client: httpx.Client, quiz: str, question: str, given: object) -> dict[str, Any]:
    response = client.post(f"{API}/submissions", json={"quiz": quiz, "question": question, "answer": given})
    assert response.status_code == 201, response.text
    made: dict[str, Any] = response.json()
    return made


def test_the_oldest_answer_is_opened_again_by_who_has_it_open(site: Site, tina: httpx.Client) -> None:
    sent = [answer(site.client(name), "small", "q4", f"{name} says.")["id"] for name in ("ann", "bob", "cem")]
    tom = browser(site, "tom", "instructor")

    def open_next(reviewer: httpx.Client) -> str:
        response = reviewer.post("/instructor/review/next?which=reviews")
        assert response.status_code == 303
        return response.headers["location"].partition("?")[0].rpartition("/")[2]

    assert [open_next(who) for who in (tina, tina, tom, tina, tom)] == [sent[0], sent[0], sent[1], sent[0], sent[1]]
    tina.post(f"/instructor/review/{sent[0]}", data={"do": "release"})
    assert open_next(tom) == sent[1]
    tom.post(f"/instructor/review/{sent[1]}", data={"do": "release"})
    assert open_next(tom) == sent[0]


def test_a_learner_reads_a_comment_in_the_lines_in_which_it_was_written(site: Site, tina: httpx.Client) -> None:
    ann = browser(site, "ann")
    given = answer(ann, "small", "q4", "Because.")["id"]
    form = page(tina, f"/instructor/review/{given}?which=reviews")
    version = re.search(r'name="version" value="(\d+)"', form)
    assert version is not None
    decided = {"do": "decide", "version": version[1], "points": "0.5", "comment": "First <b>this</b>.\r\nThen that."}
    assert tina.post(f"/instructor/review/{given}", data=decided).status_code == 303
    seen = page(ann, "/?quiz=small")
    assert '<span class="as-typed">First &lt;b&gt;this&lt;/b&gt;.\nThen that.</span>' in seen
    styles = httpx.get(site.origin + re.findall(r'href="([^"]*/style[^"]*\.css)"', seen)[0]).text
    assert re.search(r"\.as-typed \{ white-space: pre-line;", styles)


def page(client: httpx.Client, path: str) -> str:
    response = client.get(path)
    assert response.status_code == 200, response.text
    return response.text


def words(text: str) -> str:
    """The text of a page, without its markup."""
    return " ".join(re.sub(r"<[^>]*>", " ", text).replace("\u202f", " ").split())


def unspaced(text: str) -> str:
    """A text with plain spaces before its units."""
    return text.replace("\u202f", " ")


def decide(client: httpx.Client, submission: str, path: str, points: float) -> None:
    body, headers = {"points": points}, {"If-Match": "*"}
    assert client.put(f"{API}/submissions/{submission}/{path}", json=body, headers=headers).is_success


@pytest.mark.slow
def test_statistics_tell_mistakes_options_wrong_numbers_and_intervals(site: Site, tina: httpx.Client) -> None:
    given = {"ann": (1, "5 ms"), "bob": (2, "7 ms"), "cem": (1, "7.01 ms"), "dee": (1, "50 ms"), "eve": (0, "50 ms")}
    for name, (choice, number) in given.items():
        answer(site.client(name), "small", "q1", choice)
        answer(site.client(name), "small", "q2", number)
    answer(site.client("ann"), "small", "q4", "Because.")
    text = words(page(tina, "/instructor/statistics?quiz=small"))
    assert "no question is clearly the hardest, as intervals overlap" in text
    assert "20 % (4 to 62 %, n = 5)" in text
    text = re.sub(r" learners?: see who", "", text)  # what the link on a count says
    assert re.search(r"Option chosen first Learners a 1 b right 3 c 1", text)
    assert re.search(
        r"off by a power of ten .* 2 Wrong number that several gave first Learners 7.005 ms 2 50 ms 2", text
    )
    assert "No decided answer yet to: What then?; Why?" in text  # what waits for a person has no points yet
    assert browser(site, "ann").get("/instructor/statistics").status_code == 403


def test_pages_of_a_quiz_open_at_the_one_that_was_answered_last(site: Site, tina: httpx.Client) -> None:
    ann = site.client("ann")
    for quiz, question, given in (("2-graded", "which", 1), ("small", "q1", 1), ("2-graded", "why", "Because.")):
        answer(ann, quiz, question, given)
        for path in ("statistics", "dates", "extensions"):
            assert f'<option value="{quiz}" selected>' in page(tina, f"/instructor/{path}"), path


def test_today_leads_to_those_who_have_not_begun_what_is_due(site: Site, tina: httpx.Client) -> None:
    answer(site.client("ann"), "2-graded", "which", 1)
    site.client("zoe")
    today = page(tina, "/instructor")
    assert '<a href="/instructor/dates?quiz=2-graded">' in today
    [link] = re.findall(r'href="(/instructor/gradebook[^"]*)">1 of 2<', today)
    assert link == "/instructor/gradebook?quiz=2-graded#absent"
    [absent] = re.findall(r'<section [^>]*id="absent">.*?</section>', page(tina, link), re.DOTALL)
    assert words(absent) == "1 has not begun this quiz zoe"


def test_the_plots_say_which_question_tells_nothing() -> None:
    def one(name: str, value: float, low: float, high: float) -> QuestionStatistics:
        share = Estimate(0.5, 0.3, 0.7, 30)
        return QuestionStatistics(name, share, share, Estimate(value, low, high, 30), {}, (), {})

    titles = {"good": "Good", "bad": f"Bad {HOSTILE}" * 9}
    shares, tells = plot_estimates([one("good", 0.5, 0.2, 0.7), one("bad", -0.4, -0.6, -0.1)], titles)
    assert tells.title.startswith("Strong learners do worse at “Bad")
    assert tells.table[1] == ("Good", "0.5", "0.2 to 0.7", "30")
    for width in (308.0, 520.0):
        drawn = tells.draw(width).svg("wide-plot", shares.title)
        assert "<img" not in drawn
        assert drawn.count("<circle") == 2
    (_, tells) = plot_estimates([one("good", 0.5, 0.2, 0.7), one("bad", 0.1, -0.2, 0.4)], {"good": "g", "bad": "b"})
    assert tells.title == "Too few answers to say whether “b” separates strong from weak learners"
    (_, tells) = plot_estimates([one("good", 0.5, 0.2, 0.7), one("bad", 0.0, -0.1, 0.1)], {"good": "g", "bad": "b"})
    assert tells.title == "“b” does not separate strong from weak learners"
    assert shares.title == "Share of the points: no question is clearly the hardest, as intervals overlap"


def test_a_question_is_the_hardest_where_its_interval_lies_below_all_others() -> None:
    def one(name: str, value: float, low: float, high: float) -> QuestionStatistics:
        share = Estimate(value, low, high, 30)
        return QuestionStatistics(name, share, share, None, {}, (), {})

    (shares,) = plot_estimates([one("a", 0.9, 0.8, 0.95), one("b", 0.3, 0.2, 0.5)], {"a": "A", "b": "B"})
    assert shares.title == "The hardest is “B”: 30\u202f% of its points"
    (shares,) = plot_estimates([one("a", 0.6, 0.4, 0.8), one("b", 0.3, 0.2, 0.5)], {"a": "A", "b": "B"})
    assert "no question is clearly the hardest" in shares.title


def test_an_instructor_sees_what_the_policy_shows_the_learner_and_sends_nothing(site: Site, tina: httpx.Client) -> None:
    ann = site.client(HOSTILE)
    made = answer(ann, "2-graded", "which", 0)
    path = f"/instructor/learners/{made['learner']}"
    assert "/lessons/2" in page(tina, path)
    response = tina.get(f"{path}/lessons/2")
    text = words(response.text)
    assert "sees it now. Nothing can be sent from here." in text
    assert "you see how it was graded once the results are published" in text
    assert "Not correct" not in text
    assert "SECRET" not in text
    assert HOSTILE not in response.text
    assert "form-action 'none'" in response.headers["content-security-policy"]
    assert re.findall(r"<form[^>]*(?:method|action)", response.text) == []
    assert "page.js" not in response.text
    entry = tina.get(f"{API}/audit").json()["items"][0]
    assert (entry["action"], entry["subject"], entry["name"]) == ("course seen as a learner", made["learner"], "tina")
    tina.put(f"{API}/quizzes/2-graded/publication")
    assert "Not correct" in words(page(tina, f"{path}/lessons/2"))
    assert tina.get(f"{path}/quizzes/2-graded/which").headers["location"].endswith("/lessons/2#2-graded--which")


def test_only_instructors_of_the_course_see_it_as_a_learner(site: Site, tina: httpx.Client) -> None:
    ann = browser(site, "ann")
    learner = answer(ann, "small", "q1", 1)["learner"]
    assert ann.get(f"/instructor/learners/{learner}/quizzes/small/q1").status_code == 403
    path = f"/instructor/learners/{learner}/lessons/2"
    assert ann.get(path).status_code == 403
    assert site.anonymous().get(path).status_code == 401
    assert browser(site, "eve", "instructor", "another").get(path).status_code == 404
    assert tina.get(f"/instructor/learners/{'0' * 32}/lessons/2").status_code == 404


@pytest.mark.slow
def test_pages_keep_answers_under_review_and_first_marks_from_reviewers(site: Site, tina: httpx.Client) -> None:
    tom, ann = browser(site, "tom", "instructor"), site.client("ann")
    made = answer(ann, "2-graded", "why", "UNDER REVIEW")
    story, book = f"/instructor/learners/{made['learner']}", "/instructor/gradebook?quiz=2-graded"
    seen_as, reel = f"{story}/lessons/2", f"{story}/reel/2-graded/why"
    for client in (tina, tom):
        assert client.get(reel).status_code == 404
        assert "1 answer is under review without a name" in words(page(client, story))
        assert "UNDER REVIEW" not in page(client, story) + page(client, seen_as)
        assert "under review without a name" in page(client, seen_as)
    decide(tina, made["id"], "review", 3.25)
    assert '<small aria-hidden="true">3.25</small>' in page(tina, book)
    whole = "/instructor/gradebook"
    assert "3.25" in page(tina, whole)
    assert "3.25" not in page(tom, book) + page(tom, story) + page(tom, seen_as) + page(tom, whole)
    assert "3.25" not in page(tom, "/instructor/statistics?quiz=2-graded")
    assert "UNDER REVIEW" not in page(tom, story) + page(tom, seen_as)
    assert tom.get(reel).status_code == 404
    decide(tom, made["id"], "review/second", 3.25)
    assert "3.25" in page(tom, book)
    assert "UNDER REVIEW" in page(tom, story)
    assert "UNDER REVIEW" in page(tom, seen_as)
    assert "UNDER REVIEW" in page(tom, reel)


def test_learners_of_one_name_are_told_apart_wherever_they_are_named(site: Site, tina: httpx.Client) -> None:
    ids, exports = {}, []
    for account in ("oidc:1", "oidc:2"):
        kim = site.anonymous({"Origin": site.origin, "Sec-Fetch-Site": "same-origin"})
        with site.app.state.services.database.write() as session:
            member = members.get_with_account(session, account, "Kim", Role.STUDENT, site.course or "")
            code = invite_member(session, None, member).code
            kim.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
            ids[member.id] = ""
        ids[member.id] = answer(kim, "small", "q1", 1)["id"]
        exports.append(tina.get(f"{API}/gradebook.csv?quiz=small&format=canvas").text)
    twins = list(ids)
    answer(site.client("ann"), "small", "q1", 1)
    addresses = ["gradebook?quiz=small", "people", "review?which=submissions"]
    for address in addresses:
        told = words(page(tina, f"/instructor/{address}"))
        assert all(f"Kim …{twin[-4:]}" in told for twin in twins), address
        assert "ann …" not in told
    for one, submission in ids.items():
        for address in (f"learners/{one}", f"learners/{one}/lessons/2", f"review/{submission}?which=submissions"):
            assert f"Kim …{one[-4:]}" in words(page(tina, f"/instructor/{address}")), address
    rows = list(csv.DictReader(io.StringIO(tina.get(f"{API}/gradebook.csv?quiz=small").text)))
    assert {row["id"] for row in rows if row["user"] == "Kim"} == set(twins)
    students = [{line.partition(",")[0] for line in text.splitlines()[2:]} for text in exports]
    assert students == [{"Kim"}, {f"Kim …{twin[-4:]}" for twin in twins}]  # Canvas finds a learner without ids by name


def test_a_reviewer_reads_when_the_learner_can_see_the_decision(site: Site, tina: httpx.Client) -> None:
    ann = site.client("ann")
    held, shown = (answer(ann, quiz, name, 0)["id"] for quiz, name in (("2-graded", "which"), ("small", "q1")))
    text = words(page(tina, f"/instructor/review/{held}?which=submissions&said=decided"))
    assert "Decided. The learner can see it once the feedback of the quiz is published, on the page Extensions." in text
    tina.put(f"{API}/quizzes/2-graded/publication")
    for one in (held, shown):
        text = words(page(tina, f"/instructor/review/{one}?which=submissions&said=decided"))
        assert "Decided. The learner can see it now." in text


def test_an_extension_is_given_refused_and_taken_back(site: Site, tina: httpx.Client) -> None:
    learner = answer(site.client("ann"), "2-graded", "which", 0)["learner"]
    address, form = "/instructor/extensions", {"quiz": "2-graded", f"learner-{learner}": "yes"}
    assert "Fri 1 Jan 2100, 00:00 UTC" in page(tina, f"{address}?quiz=2-graded")
    for wrong in ({"due": "soon"}, {"attempts": "-1"}, {"attempts": "many"}, {"due": "1999-01-01T00:00"}):
        refused = tina.post(address, data={**form, **wrong})
        assert (refused.status_code, "Check " + next(iter(wrong)) in refused.text) == (422, True)
    refused = tina.post(address, data={**form, "due": "2101-02-03T04:05", "until": "2101-02-02T04:05"})
    assert (refused.status_code, "needs a due date, and an until that is later" in refused.text) == (422, True)
    given = {**form, "due": "2101-02-03T04:05", "attempts": "2"}
    assert "ann: due Thu 3 Feb 2101, 04:05 UTC , 2 further attempts" in words(tina.post(address, data=given).text)
    text = words(page(tina, f"{address}?quiz=2-graded"))
    assert "ann Thu 3 Feb 2101, 04:05 UTC – 2 tina" in text
    assert tina.get(f"{API}/quizzes/2-graded/extensions").json()["items"][0]["attempts"] == 2
    early = words(tina.post(address, data={**given, "due": "2099-12-31T00:00"}).text)
    assert "due Thu 31 Dec 2099, 00:00 UTC changes nothing: the quiz itself has Fri 1 Jan 2100, 00:00 UTC ." in early
    empty = tina.post(address, data=form)
    assert (empty.status_code, "Give a date or further attempts." in empty.text) == (422, True)
    assert "2 further attempts" in early and "2 tina" in words(page(tina, f"{address}?quiz=2-graded"))
    assert "ann: has no extension any more" in words(tina.post(address, data={**form, "back": "yes"}).text)
    assert "None." in words(page(tina, f"{address}?quiz=2-graded"))
    log = words(page(tina, "/instructor/people/audit"))
    assert "2-graded, ann due 3 Feb 2101, 04:05 UTC , attempts 2" in log
    assert "2-graded, ann taken back" in log
    assert browser(site, "ann").post(address, data=given).status_code == 403
    refused = tina.post(address, data={**given, "learner-" + "0" * 32: "yes"})
    assert (refused.status_code, "no learner of this course any more" in refused.text) == (422, True)


def test_an_exercise_that_is_closed_says_so_beside_a_button_that_is_off(site: Site, tina: httpx.Client) -> None:
    ann, path, policy = browser(site, "ann"), "/quizzes/3-scripts/rk4-step", f"{API}/quizzes/3-scripts/policy"
    off = '<button class="push" disabled>Run and judge</button>'
    assert off not in page(ann, path)
    etag = tina.get(policy).headers["etag"]
    closed = tina.put(policy, json={"due": "2020-01-01T00:00Z"}, headers={"If-Match": etag})
    assert closed.status_code == 200, closed.text
    shown = page(ann, path)
    assert off in shown
    assert "This quiz closed on 1 Jan 2020, 00:00 UTC" in words(shown.partition('id="trouble"')[2])
    etag = tina.get(policy).headers["etag"]
    assert tina.put(policy, json={}, headers={"If-Match": etag}).status_code == 200


def test_several_learners_get_an_extension_at_once_or_none_does(site: Site, tina: httpx.Client) -> None:
    ids = {name: answer(site.client(name), "2-graded", "which", 0)["learner"] for name in ("ann", "bob", "cem")}
    with site.app.state.services.database.write() as session:
        for account in ("oidc:1", "oidc:2"):
            last = members.get_with_account(session, account, "Kim", Role.STUDENT, site.course or "").id
    address, wanted = "/instructor/extensions", {"quiz": "2-graded", "attempts": "2"}
    kept = f"{API}/quizzes/2-graded/extensions"
    for names, why in (("ann\nAnn", "Ann: no learner"), ("bob\nKim", "Kim: 2 learners have this name"), ("", "Tick")):
        refused = tina.post(address, data={**wanted, "names": names})
        assert (refused.status_code, why in refused.text) == (422, True)
        assert tina.get(kept).json()["items"] == []
    ticked = {**wanted, f"learner-{ids['ann']}": "yes", "names": f" bob \nann\n\nKim …{last[-4:]}"}
    text = words(tina.post(address, data=ticked).text)
    for name in ("ann", "bob", f"Kim …{last[-4:]}"):
        assert f"{name}: 2 further attempts" in text
    assert {item["learner"] for item in tina.get(kept).json()["items"]} == {ids["ann"], ids["bob"], last}


def test_learners_beyond_the_boxes_of_a_large_course_are_named(
    site: Site, tina: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extensions, "BOXES", 1)
    ids = {name: answer(site.client(name), "2-graded", "which", 0)["learner"] for name in ("ann", "bob")}
    page = tina.get("/instructor/extensions?quiz=2-graded").text
    assert "These are the first 1 by name. Name others below." in words(page)
    assert page.count('name="learner-') == 1
    given = tina.post("/instructor/extensions", data={"quiz": "2-graded", "attempts": "1", "names": "bob"})
    assert "bob: 1 further attempt" in words(given.text)
    assert [item["learner"] for item in tina.get(f"{API}/quizzes/2-graded/extensions").json()["items"]] == [ids["bob"]]


def test_the_feedback_is_published_and_withheld_by_form(site: Site, tina: httpx.Client) -> None:
    ann = site.client("ann")
    made = answer(ann, "2-graded", "which", 1)["id"]
    statuses = []
    for more in ({}, {"withhold": "yes"}):
        assert tina.post("/instructor/extensions/publication", data={"quiz": "2-graded", **more}).status_code == 303
        statuses.append(ann.get(f"{API}/submissions/{made}").json()["verdict"]["status"])
    assert statuses == ["correct", "needs_review"]
    assert tina.post("/instructor/extensions/publication", data={"quiz": "gone"}).status_code == 404


def test_the_service_page_tells_workers_and_the_queue(site: Site, tina: httpx.Client) -> None:
    text = words(page(tina, "/instructor/service"))
    assert "No worker is running : scripts wait until one is started." in text
    assert "Scripts to grade 0 0 –" in text
    assert browser(site, "ann").post("/instructor/service/deliveries/1/replay").status_code == 403
    assert tina.post(f"/instructor/service/deliveries/{2**70}/replay").status_code == 422


def test_mistakes_show_names_between_backticks_as_code(site: Site, tina: httpx.Client) -> None:
    told = "The dictionary that your function returns has no `period`: its keys are spelt as the task gives them."
    for name in ("ann", "bob", "cem"):
        answer(site.client(name), "small", "q2", "50 ms")
    with site.app.state.services.database.write() as session:
        for row in session.scalars(select(VerdictRow).where(VerdictRow.course == site.course)):
            row.body = json.dumps(json.loads(row.body) | {"diagnosis": told})
    assert tina.post(f"{API}/quizzes/small/results:recount").is_success
    for address in ("/instructor", "/instructor/statistics?quiz=small", "/instructor/class/small/q2"):
        shown = page(tina, address)
        assert "has no <code>period</code>" in shown
        assert "`" not in shown
    sent = tina.get(f"{API}/submissions").json()["items"][0]["id"]
    assert "has no <code>period</code>" in page(tina, f"/instructor/review/{sent}")


@pytest.mark.parametrize("address", ["/instructor", "/instructor/"])
def test_today_has_its_address_with_and_without_a_slash(tina: httpx.Client, address: str) -> None:
    assert "needs a person today" in page(tina, address)


def test_content_tells_digests_and_keys_that_no_simulation_confirms(tina: httpx.Client) -> None:
    assert "The course has no learners yet" in words(page(tina, "/instructor"))
    text = words(page(tina, "/instructor/content"))
    assert "A small quiz small 4 1 Gradebook Plots" in text
    keys = words(page(tina, "/instructor/certificates"))
    assert "How long? small q2 not derivable by simulation No simulation confirms this key" in keys


def test_a_third_reviewer_alone_is_offered_to_decide_between_two_marks(site: Site, tina: httpx.Client) -> None:
    sent = answer(site.client("ann"), "2-graded", "why", "Because.")["id"]
    tom, tess = (browser(site, name, "instructor") for name in ("tom", "tess"))
    decide(tina, sent, "review", 1)
    decide(tom, sent, "review/second", 3)
    for client, deciding in ((tina, False), (tom, False), (tess, True)):
        desk = page(client, f"/instructor/review/{sent}?which=disagreements")
        assert ("Decide and next" in desk, "a third reviewer decides" in desk) == (deciding, not deciding)
        assert ("has two marks that differ" in page(client, "/instructor")) == deciding
        assert (f"/instructor/review/{sent}" in page(client, "/instructor/review?which=disagreements")) == deciding


def test_people_refuses_a_name_that_only_the_roster_has(tina: httpx.Client) -> None:
    csv_type = {"Content-Type": "text/csv"}
    tina.post(f"{API}/roster:import?namespace=canvas", content="name,external_id\nHana,7\n", headers=csv_type)
    for path, form in (("tokens", {"user": "Hana", "role": "student"}), ("invitations", {"names": "Hana"})):
        refused = tina.post(f"/instructor/people/{path}", data={**form, "role": "student"})
        assert refused.status_code == 422
        assert "give an id in its place" in words(refused.text)
    assert [item["name"] for item in tina.get(f"{API}/members").json()["items"]].count("Hana") == 1


def test_content_that_was_refused_is_told_until_it_is_mended(site: Site, tina: httpx.Client) -> None:
    path = site.settings.content / "quizzes" / "2-graded.json"
    number = {
        "kind": "numeric",
        "id": "which",
        "q": "Which?",
        "tol": 0,
        "verify": {"by": "expression", "expr": "2 * 3"},
    }
    for question, why in (({**number, "answr": 6}, "answr"), ({**number, "answer": 7}, "which.answer")):
        path.write_text(json.dumps({**GRADED, "questions": [question]}))
        assert tina.post(f"{API}/content:reload").status_code == 422
        for address in ("/instructor", "/instructor/content"):
            text = words(page(tina, address))
            assert "The changed content was refused" in text
            assert why in text
            assert address != "/instructor" or "measured:" not in text
            assert "Graded" in text or address == "/instructor"
    again: Any = {"headers": {"Sec-Fetch-Site": "same-origin"}, "follow_redirects": True}
    assert "The changed content was refused" in words(tina.post("/instructor/content", **again).text)
    path.write_text(json.dumps(GRADED))
    assert "loaded again, without a fault" in words(tina.post("/instructor/content", **again).text)
    assert "refused" not in words(page(tina, "/instructor"))


def test_a_draft_is_read_previewed_and_published_as_it_was_seen(alone: Site) -> None:
    site, tina = alone, browser(alone, "tina", "instructor")
    path = site.settings.content / "quizzes" / "2-graded.json"
    assert "nothing to publish" in words(page(tina, DRAFT))
    answer(site.client("ann"), "2-graded", "which", 1)
    which, why = GRADED["questions"]
    path.write_text(json.dumps({**GRADED, "questions": [{**which, "answer": 0}, {**why, "q": "Why not?"}, LENGTH]}))
    seen = page(tina, DRAFT)
    text = words(seen)
    assert "Which? 2-graded which changed which › answer: before: 1, “b” → now: 0, “a” 1 learner has" in text
    assert "their verdicts stay until you regrade" in text
    assert "2-graded why changed why › q: before: Why? → now: Why not? Nobody has answered it yet." in text
    assert "2-graded length added Learners see it once it is published." in text
    assert "leads to the regrade of 2-graded/which, which shows" in text
    shown = page(tina, f"{DRAFT}/2-graded/length")
    assert "How long is six?" in shown and "certified" in shown and "method=" not in shown.partition("<main")[2]
    assert "6 Correct" in words(page(tina, f"{DRAFT}/2-graded/length?state=right"))
    assert tina.get(f"{DRAFT}/2-graded/gone").status_code == 404

    path.write_text(json.dumps({**GRADED, "questions": [why]}))
    late = tina.post(DRAFT, data={"revision": revision_in(seen)})
    assert (late.status_code, "changed since you looked" in late.text) == (412, True)
    assert "Which?" in json.dumps(tina.get(f"{API}/quizzes/2-graded").json())
    assert tina.post(DRAFT).status_code == 412

    path.write_text(json.dumps({**GRADED, "questions": [which, {**why, "q": "Why not?"}]}))
    seen = page(tina, DRAFT)
    assert "remarks" not in words(seen)
    form = {"revision": revision_in(seen), "regrade": "2-graded/which,2-graded/gone"}
    published = tina.post(DRAFT, data=form, follow_redirects=True)
    assert "Published: learners have this content from now on." in words(published.text)
    assert published.text.count('href="/instructor/regrades?what=') == 1
    chosen = page(tina, "/instructor/regrades?what=2-graded/which")
    assert re.findall(r'<option value="([^"]+)" selected>', chosen)[0] == "2-graded/which"
    assert "Why not?" in json.dumps(tina.get(f"{API}/quizzes/2-graded").json())
    assert "nothing to publish" in words(page(tina, DRAFT))
    assert any(item["action"] == "content reloaded" for item in tina.get(f"{API}/audit").json()["items"])
    path.write_text(json.dumps(GRADED))
    assert tina.post(f"{API}/content:reload").status_code == 200


def test_results_keep_the_points_that_they_are_out_of_until_a_regrade(alone: Site) -> None:
    tina, ann, cem = browser(alone, "tina", "instructor"), browser(alone, "ann"), browser(alone, "cem")
    path = alone.settings.content / "quizzes" / "4.1-points.json"

    def write(points: int, **more: Any) -> None:
        asked = [{**LENGTH, "points": points, **more}, {**GRADED["questions"][1], "points": points}]
        path.write_text(json.dumps({"id": "4.1-points", "title": "Points", "questions": asked}))

    def publish() -> None:
        assert tina.post(f"{API}/content:reload").status_code == 200

    write(3)
    publish()
    answer(ann, "4.1-points", "length", 6)
    write(5)
    text = words(page(tina, DRAFT))
    assert "The points of why change" not in text
    assert "The points of length change from 3 to 5: 1 learner has results out of 3. They stay so until a" in text
    assert 'href="/instructor/regrades?what=4.1-points/length">the regrade of length</a>' in page(tina, DRAFT)
    publish()
    answer(ann, "4.1-points", "why", "Because.")
    seen = words(page(ann, "/lessons/4.1"))
    assert "3 of 8" in seen  # the sum counts what each result is out of
    assert ("3 / 3" in seen, "3 / 5" in seen, "waits / 5" in seen, "Correct 3 of 3 points" in seen) == (
        True, False, True, True,
    )  # fmt: skip
    answer(cem, "4.1-points", "length", 6)
    write(3)
    text = words(page(tina, DRAFT))
    assert "length change from 5 to 3: 1 learner has results out of 5. They stay so until a regrade brings" in text
    publish()
    seen = words(page(cem, "/lessons/4.1"))
    assert ("5 / 5" in seen, "5 / 3" in seen, "5 of 8" in seen) == (True, False, True)
    assert "3 / 3" in words(page(ann, "/lessons/4.1"))
    write(3, tol=0.5)
    assert "The points of length" not in words(page(tina, DRAFT))


def test_a_draft_says_that_the_same_options_stand_in_another_order(alone: Site) -> None:
    tina = browser(alone, "tina", "instructor")
    which, why = GRADED["questions"]
    turned = {**which, "options": ["b", "a"], "answer": 0}
    (alone.settings.content / "quizzes" / "2-graded.json").write_text(
        json.dumps({**GRADED, "questions": [turned, why]})
    )
    text = words(page(tina, DRAFT))
    assert "which › options: the order has changed, the entries are the same: no. 1 to 2 were no. 2, 1 before" in text
    assert "which › answer: the same texts are right" in text and "before: " not in text


@pytest.mark.parametrize(
    ("by_maximum", "told"),
    [
        ({3.0: 4, 4.0: 1, 5.0: 2}, ": 4 learners have results out of 3, 1 learner has results out of 4. They stay so"),
        ({5.0: 2}, ", and all results are out of 5 already."),
    ],
)  # fmt: skip
def test_other_points_are_told_with_what_the_results_are_out_of(by_maximum: dict[float, int], told: str) -> None:
    sentences = describe_points("a", 3.0, by_maximum, now=5.0)
    assert sentences.partition(" until")[0] == f"The points of a change from 3 to 5{told}"


def test_a_draft_of_a_folder_that_several_courses_use_says_so(alone: Site) -> None:
    site, tina = alone, browser(alone, "tina", "instructor")
    path = site.settings.content / "quizzes" / "2-graded.json"
    answer(site.client("ann"), "2-graded", "which", 1)
    rob = browser(site, "rob", "instructor", "robots")
    which, *others = GRADED["questions"]
    path.write_text(json.dumps({**GRADED, "questions": [{**which, "q": "Which one?"}, *others]}))
    seen = page(rob, DRAFT)
    assert "Nobody has answered it yet" not in words(seen)
    assert "for all learners of the course, and of another that uses the same folder, at once" in words(seen)
    assert rob.post(DRAFT, data={"revision": revision_in(seen)}).status_code == 303
    assert tina.get(f"{API}/audit").json()["items"][0]["action"] == "content reloaded"
    path.write_text(json.dumps(GRADED))
    assert tina.post(f"{API}/content:reload").status_code == 200


def test_a_draft_tells_the_remarks_of_what_it_changes_before_publish(site: Site, tina: httpx.Client) -> None:
    path = site.settings.content / "quizzes" / "2-graded.json"
    which, why = GRADED["questions"]
    pictured = {**why, "q": "Why? ![a pendulum](images/gone.png) $\\frac{1$"}
    path.write_text(json.dumps({**GRADED, "questions": [which, pictured]}))
    text = words(page(tina, DRAFT)).partition("Read these remarks first")[2]
    assert "images/gone.png" in text and "Publish" in text.partition("images/gone.png")[2]
    path.write_text(json.dumps(GRADED))


def test_a_draft_without_a_verify_shows_one_to_paste(site: Site, tina: httpx.Client) -> None:
    path = site.settings.content / "quizzes" / "2-graded.json"
    sim = {"xml": FALLING, "seconds": 0.5, "readouts": [{"label": "height", "expr": "data.qpos[0]", "unit": "m"}]}
    falls = {"kind": "numeric", "id": "falls", "q": "Where is it after 0.5 s?", "unit": "mm", "tol": 5, "sim": sim}
    for answer, told in ((-1226, "under which the key holds"), (-900, "under which the key does not hold")):
        path.write_text(json.dumps({**GRADED, "questions": [*GRADED["questions"], {**falls, "answer": answer}]}))
        shown = page(tina, f"{DRAFT}/2-graded/falls")
        assert told in words(shown)
        (pasted,) = re.findall(r"<textarea[^>]* data-copy>(.*?)</textarea>", shown)
        verify = json.loads(f"{{{html.unescape(pasted)}}}")["verify"]
        assert (verify["expr"], verify["seconds"]) == ("1000 * data.qpos[0]", 0.5)
    path.write_text(json.dumps(GRADED))
    assert tina.post(f"{API}/content:reload").status_code == 200


def test_a_draft_with_faults_is_not_published(site: Site, tina: httpx.Client) -> None:
    path = site.settings.content / "quizzes" / "2-graded.json"
    for question, why in (({**LENGTH, "answr": 6}, "answr"), ({**LENGTH, "answer": 7}, "length.answer")):
        path.write_text(json.dumps({**GRADED, "questions": [question]}))
        text = words(page(tina, DRAFT))
        assert "The folder cannot be published" in text and why in text and "Publish " not in text
        refused = tina.post(DRAFT, data={"revision": "0" * 64})
        assert (refused.status_code, "Nothing was published" in refused.text) == (422, True)
    assert "length.answer" in words(page(tina, DRAFT))
    assert tina.get(f"{DRAFT}/2-graded/length").status_code == 200
    path.write_text("{")
    assert tina.get(f"{DRAFT}/2-graded/length").status_code == 404
    path.write_text(json.dumps(GRADED))
    assert tina.post(f"{API}/content:reload").status_code == 200


def test_a_draft_is_for_instructors(site: Site) -> None:
    for method in ("GET", "POST"):
        assert browser(site, "ann").request(method, DRAFT).status_code == 403
    assert browser(site, "ann").get(f"{DRAFT}/2-graded/which").status_code == 403


def test_the_draft_says_that_marks_follow_a_changed_rubric_at_once(alone: Site) -> None:
    site, tina = alone, browser(alone, "tina", "instructor")
    path = site.settings.content / "quizzes" / "2-graded.json"
    which, why = GRADED["questions"]

    def write(force: int, **more: int) -> None:
        rubric = [{"id": "force", "title": "Names it", "points": force}, {"id": "rest", "title": "Rest", "points": 4}]
        path.write_text(json.dumps({**GRADED, "questions": [which, {**why, "rubric": rubric, **more}]}))

    write(1)
    assert tina.post(f"{API}/content:reload").status_code == 200
    ann, *_ = (answer(site.client(name), "2-graded", "why", "Because.")["id"] for name in ("ann", "bob", "cem"))
    write(2)
    text = words(page(tina, DRAFT))
    assert "No verdict can differ." in text
    etag = tina.get(f"{API}/submissions/{ann}/review").headers["etag"]
    marked = tina.put(f"{API}/submissions/{ann}/review", json={"rubric": ["force"]}, headers={"If-Match": etag})
    assert marked.status_code == 200, marked.text
    text = words(page(tina, DRAFT))
    assert "3 learners have answered: publishing computes the marks by the rubric again, those of 1 of them, at" in text
    assert "until you regrade" not in text and "leads to the regrade" not in text
    write(2, points=3)
    assert "at once; other verdicts stay until you regrade them." in words(page(tina, DRAFT))
    path.write_text(json.dumps(GRADED))
    assert tina.post(f"{API}/content:reload").status_code == 200


def revision_in(text: str) -> str:
    match = re.search(r'name="revision" value="(\w{64})"', text)
    assert match
    return match[1]


def test_the_chance_of_luck_is_computed_once_when_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def luck(question: Any, *_: object) -> Luck:
        asked.append(question.id)
        return Luck(1.0 if question.id == "rk4-step" else 1e-8, 1e-6)

    monkeypatch.setattr(keys, "estimate_luck", luck)
    monkeypatch.setattr(certificates, "lucks", certificates.Lucks())
    library = load(Settings().content, passed=PASSED)

    def exercises(with_luck: bool = False) -> dict[str, Any]:
        rows = certificates.list_certificates(library, with_luck=with_luck)
        return {row["question"]: row for row in rows if row["quiz"] == "1.3-exercises"}

    assert {row["state"] for row in exercises().values()} == {"guessing not computed"}
    assert asked == []
    first, again = exercises(with_luck=True), exercises()
    assert first == again
    assert sorted(asked) == sorted(first)
    assert first["rk4-step"]["state"] == "can be guessed"
    assert "passes every time; at most one in 1\u202f000\u202f000 is allowed" in first["rk4-step"]["why"]
    assert "Draw more numbers" in first["rk4-step"]["remarks"][0]
    assert "with a chance of at most one in 100\u202f000\u202f000;" in first["servo-threshold"]["why"]


def test_a_kind_that_cannot_tell_the_chance_of_luck_leaves_the_page_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("no width")

    monkeypatch.setattr(type(load_kinds()["threshold"]), "list_accepted", fail)
    monkeypatch.setattr(certificates, "lucks", certificates.Lucks())
    rows = certificates.list_certificates(load(Settings().content, passed=PASSED), with_luck=True)
    (row,) = (row for row in rows if row["question"] == "servo-threshold")
    assert row["state"] == "cannot be computed"
    assert row["why"].startswith("the kind fails: ZeroDivisionError: no width")
    assert "Answers are graded all the same" in row["remarks"][0]
    assert len(rows) > 5
    assert sum(one["state"] == "cannot be computed" for one in rows) == 1


def test_certificates_say_what_was_simulated_what_came_out_and_how_far_from_the_key() -> None:
    rows = {row["question"]: row["facts"] for row in certificates.list_certificates(load_content("1.3-check"))}
    texts = {name: unspaced(" ".join(line for _, lines in rows[name] for line in lines)) for name in ("q1", "q2", "q3")}
    assert "mj_fwdPosition changes it first: from 0 contacts to 1 contact." in texts["q1"]
    assert "Stable at 4.995 ms, unstable at 5.005 ms. 5 ms, with a tolerance of 0.05 ms." in texts["q2"]
    assert "0 % of the tolerance." in texts["q2"]
    assert "under the setting of each option, 10 s each. Euler: MuJoCo warned of BADQACC at 0.07 s." in texts["q3"]
    assert "discrete: stable to the end. RK4, which is no option: stable; its limit is 10.22 ms." in texts["q3"]
    assert "“discrete”: the simulation finds the same." in texts["q3"]


MEASURED: dict[str, tuple[dict[str, Any], str]] = {
    "measurement": ({"h/1": 2.0061, "h/2": 2.0062, "h/4": 2.00625, "nudged": [2.0061, 2.0061], "unit": "s"},
                    "2.0061 s at the timestep, 2.0062 s at a half of it, 2.00625 s at a quarter of it."),
    "expression": ({"value": 2.006}, "Nothing: a closed form was evaluated. 2.006 s."),
    "options": ({"up": {"holds": True, "max": 0.3}, "down": {"holds": False, "final": "-0.2"}},
                "up: true (its largest value is 0.3). down: not true (the last value is −0.2)."),
    "outcome": ({"up": True, "down": {"true": False, "first": 1.5}, "off": {"true": True, "times": 3.0}},
                "up: true. down: not true (it is so first at 1.5 s). off: true (it is so 3 times)."),
}  # fmt: skip


@pytest.mark.parametrize("method", MEASURED)
def test_every_way_to_derive_a_key_is_told_in_sentences(method: str) -> None:
    measured, sentence = MEASURED[method]
    numeric: dict[str, Any] = {"kind": "numeric", "id": "n", "q": "T?", "answer": 2.006, "tol": 0.01, "unit": "s"}
    certificate = Certificate("certified", "", method, 2.0062, 2.006, measured, tolerance=0.01)
    lines = [
        line for _, several in word_key(NumberQuestion.model_validate(numeric).key, certificate) for line in several
    ]
    assert sentence in unspaced(" ".join(lines))
    assert "2.006 s, with a tolerance of 0.01 s. What came out is 2·10⁻⁴ s away, 2 % of the" in unspaced(lines[-1])


def test_a_key_that_cannot_be_told_says_why_it_was_accepted_and_how_short_the_timesteps_were() -> None:
    numeric: dict[str, Any] = {"kind": "numeric", "id": "n", "q": "T?", "answer": 2.006, "tol": 0.01, "unit": "s"}
    regime = {"failed": None, "own timestep [s]": 2e-3, "fastest rate [1/s]": 12.5, "shortest timestep [s]": 5e-4}
    measured = MEASURED["measurement"][0]
    key = NumberQuestion.model_validate(numeric).key
    certificate = Certificate(
        "cannot tell", "it still changes", "measurement", 2.0062, 2.006, measured, tolerance=0.01, regime=regime,
        accepted="Timed on the rig.",
    )  # fmt: skip
    row = certificates.word_certificate(key, certificate)
    assert (row["state"], row["tone"]) == ("cannot tell", "")
    assert row["why"] == "Accepted: Timed on the rig. Simulation cannot tell: it still changes"
    checked = unspaced(dict(row["facts"])["Checked"][0])
    assert "rate of 12.5 1/s. The timesteps went from 2 ms to 0.5 ms: what is faster stays unseen." in checked
    states = {verdict: certificates.word_certificate(key, replace(certificate, verdict=verdict))["tone"]
              for verdict in ("certified", "refuted")}  # fmt: skip
    assert states == {"certified": "ok", "refuted": "no"}


def test_a_script_that_waits_is_told_how_many_are_before_it(site: Site, tina: httpx.Client) -> None:
    body = {"quiz": "3-scripts", "question": "rk4-step", "answer": {"source": "def rk4_step(model, data): pass"}}
    said = []
    for name in ("ann", "bob"):
        client = browser(site, name)
        made = client.post(f"{API}/submissions", json=body)
        assert made.status_code == 202
        said.append(words(page(client, "/quizzes/3-scripts/rk4-step")))
    assert "waiting, you are next" in said[0]
    assert "waiting, 1 before you" in said[1]
    assert re.search(r"scripts waiting, running 2, 0 workers(, jail)? none", words(page(tina, "/instructor")))
    seen = page(tina, f"/instructor/learners/{made.json()['learner']}/quizzes/3-scripts/rk4-step")
    assert '<button class="push" disabled>' in seen
    assert "rk4_step(model, data): pass" in seen
    assert re.findall(r"<form[^>]*(?:method|action)", seen) == []


def test_marks_of_direction_in_answers_are_written_out(site: Site, tina: httpx.Client) -> None:
    source = 'def rk4_step(model, data):\n    "right-to-left: \u202e and an isolate: \u2066"\n'
    body = {"quiz": "3-scripts", "question": "rk4-step", "answer": {"source": source}}
    learner = browser(site, "bidi")
    made = learner.post(f"{API}/submissions", json=body).json()
    for path in (
        f"/instructor/review/{answer(learner, '2-graded', 'why', source)['id']}?which=submissions",
        f"/instructor/learners/{made['learner']}",
        f"/instructor/learners/{made['learner']}/reel/3-scripts/rk4-step",
    ):
        seen = page(tina, path)
        assert "right-to-left: [U+202E] and an isolate: [U+2066]" in seen, path
        assert not {"\u202e", "\u2066"} & {*seen}, path


def test_a_class_that_has_solved_a_question_is_told_nothing_more(site: Site, tina: httpx.Client) -> None:
    at = "/instructor/class/small/q1"
    answer(site.client("ann"), "small", "q1", 1)
    assert "Nothing: everybody who answered has solved it." in words(page(tina, at))
    answer(site.client("bob"), "small", "q1", 0)
    assert "Nothing: everybody" not in words(page(tina, at))


def test_the_two_sentences_for_a_class_are_about_two_mistakes(site: Site, tina: httpx.Client) -> None:
    given = {"ann": ("10", "5"), "bob": ("10", "5"), "cem": ("10", "5"), "dee": ("0.005",), "eve": ("0.005", "5")}
    for name, numbers in given.items():
        for number in numbers:
            answer(site.client(name), "small", "q2", number)
    text = words(page(tina, "/instructor/class/small/q2")).partition("What to say on Monday")[2]
    assert "1 of 5 learners still get this verdict, 1 no longer: “Your number would be right in seconds (s).”" in text
    assert "3 learners met “Your number is off by a factor of two”; 3 got past it." in text
