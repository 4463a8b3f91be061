"""An instructor's pages without a browser: statistics, a learner's view, extensions, the service, content, blinding."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import httpx
import pytest

from grader.certify.remarks import Luck
from grader.courses.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.courses.statistics import Estimate, QuestionStatistics
from grader.identity import COOKIE
from grader.library import load
from grader.settings import Settings
from grader.web import certificates
from grader.web.statistics_plots import estimates_plot
from sites import ROOT, Site, open_site, write_content

API = "/api/v1"
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


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("pages")
    content = write_content(folder / "content")
    (content / "quizzes" / "2-graded.json").write_text(json.dumps(GRADED))
    lesson = json.loads((ROOT / "quizzes" / "1.3-exercises.json").read_text())
    script = next(one for one in lesson["questions"] if one["id"] == "rk4-step")
    script.pop("starter", None)
    (content / "quizzes" / "3-scripts.json").write_text(
        json.dumps({**lesson, "id": "3-scripts", "questions": [script]})
    )
    with open_site(Settings(content=content, data=folder / "data", workers=0)) as site:
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
    with site.app.state.context.database.write() as session:
        code = create_sign_in_code(session, user, role, course or site.course)
        client.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    return client


def answer(client: httpx.Client, quiz: str, question: str, given: object) -> dict[str, Any]:
    response = client.post(f"{API}/submissions", json={"quiz": quiz, "question": question, "answer": given})
    assert response.status_code == 201, response.text
    made: dict[str, Any] = response.json()
    return made


def page(client: httpx.Client, path: str) -> str:
    response = client.get(path)
    assert response.status_code == 200, response.text
    return response.text


def words(text: str) -> str:
    """The text of a page, without its markup."""
    return " ".join(re.sub(r"<[^>]*>", " ", text).replace("\u202f", " ").split())


def decide(client: httpx.Client, submission: str, path: str, points: float) -> None:
    body, headers = {"points": points}, {"If-Match": "*"}
    assert client.put(f"{API}/submissions/{submission}/{path}", json=body, headers=headers).is_success


def test_statistics_tell_mistakes_options_wrong_numbers_and_intervals(site: Site, tina: httpx.Client) -> None:
    given = {"ann": (1, "5 ms"), "bob": (2, "7 ms"), "cem": (1, "7.01 ms"), "dee": (1, "50 ms"), "eve": (0, "50 ms")}
    for name, (choice, number) in given.items():
        answer(site.client(name), "small", "q1", choice)
        answer(site.client(name), "small", "q2", number)
    answer(site.client("ann"), "small", "q4", "Because.")
    told = words(page(tina, "/instructor/statistics?quiz=small"))
    assert "The hardest is How long?: 20 % of its points" in told
    assert "20 % (4 to 62 %, n = 5)" in told
    assert re.search(r"Option chosen first Learners a 1 b right 3 c 1", told)
    assert re.search(
        r"off by a power of ten .* 2 Wrong number that several gave first Learners 7.005 ms 2 50 ms 2", told
    )
    assert "No decided answer yet to: What then?; Why?" in told  # what waits for a person has no points yet
    assert browser(site, "ann").get("/instructor/statistics").status_code == 403


def test_the_plots_say_which_question_tells_nothing() -> None:
    def one(name: str, value: float, low: float, high: float) -> QuestionStatistics:
        share = Estimate(0.5, 0.3, 0.7, 30)
        return QuestionStatistics(name, share, share, Estimate(value, low, high, 30), {}, (), {})

    titles = {"good": "Good", "bad": f"Bad {HOSTILE}" * 9}
    shares, tells = estimates_plot([one("good", 0.5, 0.2, 0.7), one("bad", -0.4, -0.6, -0.1)], titles)
    assert tells.title.startswith("Who knows more answers Bad")
    assert tells.table[1] == ("Good", "0.5", "0.2 to 0.7", "30")
    for width in (308.0, 520.0):
        drawn = tells.draw(width).svg("wide-plot", shares.title)
        assert "<img" not in drawn
        assert drawn.count("<circle") == 2
    (_, tells) = estimates_plot([one("good", 0.5, 0.2, 0.7), one("bad", 0.1, -0.2, 0.4)], {"good": "g", "bad": "b"})
    assert tells.title == "b may tell nothing apart"


def test_an_instructor_sees_what_the_policy_shows_the_learner_and_sends_nothing(site: Site, tina: httpx.Client) -> None:
    ann = site.client(HOSTILE)
    made = answer(ann, "2-graded", "which", 0)
    path = f"/instructor/learners/{made['learner']}"
    assert "/lessons/2" in page(tina, path)
    response = tina.get(f"{path}/lessons/2")
    told = words(response.text)
    assert "sees it now. Nothing can be sent from here." in told
    assert "you see how it was graded once the results are published" in told
    assert "Not correct" not in told
    assert "SECRET" not in told
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


def test_pages_keep_answers_under_review_and_first_marks_from_reviewers(site: Site, tina: httpx.Client) -> None:
    tom, ann = browser(site, "tom", "instructor"), site.client("ann")
    made = answer(ann, "2-graded", "why", "UNDER REVIEW")
    story, book = f"/instructor/learners/{made['learner']}", "/instructor/gradebook?quiz=2-graded"
    seen_as = f"{story}/lessons/2"
    for client in (tina, tom):
        assert "1 answer is under review without a name" in words(page(client, story))
        assert "UNDER REVIEW" not in page(client, story) + page(client, seen_as)
        assert "under review without a name" in page(client, seen_as)
    decide(tina, made["id"], "review", 3.25)
    assert "3.25" in page(tina, book)
    assert "3.25" not in page(tom, book) + page(tom, story) + page(tom, seen_as)
    assert "3.25" not in page(tom, "/instructor/statistics?quiz=2-graded")
    assert "UNDER REVIEW" not in page(tom, story) + page(tom, seen_as)
    decide(tom, made["id"], "review/second", 3.25)
    assert "3.25" in page(tom, book)
    assert "UNDER REVIEW" in page(tom, story)
    assert "UNDER REVIEW" in page(tom, seen_as)


def test_an_extension_is_given_refused_and_taken_back(site: Site, tina: httpx.Client) -> None:
    learner = answer(site.client("ann"), "2-graded", "which", 0)["learner"]
    address, form = "/instructor/extensions", {"quiz": "2-graded", "learner": learner}
    assert "Fri 1 Jan, 00:00 UTC" in page(tina, f"{address}?quiz=2-graded")
    for wrong in ({"due": "soon"}, {"attempts": "-1"}, {"attempts": "many"}, {"due": "1999-01-01T00:00"}):
        refused = tina.post(address, data={**form, **wrong})
        assert (refused.status_code, "Check " + next(iter(wrong)) in refused.text) == (422, True)
    given = {**form, "due": "2101-02-03T04:05", "attempts": "2"}
    assert tina.post(address, data=given).status_code == 303
    told = words(page(tina, f"{address}?quiz=2-graded"))
    assert "ann Thu 3 Feb, 04:05 UTC – 2 tina" in told
    assert tina.get(f"{API}/quizzes/2-graded/extensions").json()["items"][0]["attempts"] == 2
    assert tina.post(address, data=form).status_code == 303
    assert "None." in words(page(tina, f"{address}?quiz=2-graded"))
    assert browser(site, "ann").post(address, data=given).status_code == 403
    assert tina.post(address, data={**form, "learner": "0" * 32}).status_code == 404


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
    told = words(page(tina, "/instructor/service"))
    assert "No worker lives : scripts wait until one is started." in told
    assert "Scripts to grade 0 0 –" in told
    assert browser(site, "ann").post("/instructor/service/deliveries/1/replay").status_code == 403
    assert browser(site, "ann").post(f"/instructor/service/deliveries/{2**70}/replay").status_code == 422


def test_content_tells_digests_and_keys_that_no_simulation_confirms(tina: httpx.Client) -> None:
    told = words(page(tina, "/instructor/content"))
    assert "A small quiz small 4 1 Gradebook Plots" in told
    keys = words(page(tina, "/instructor/certificates"))
    assert "small q2 numeric not derivable by simulation no simulation confirms this key" in keys


def test_the_chance_of_luck_is_computed_once_when_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def luck(question: Any, *_: object) -> Luck:
        asked.append(question.id)
        return Luck(1.0 if question.id == "rk4-step" else 1e-8, 1e-6)

    monkeypatch.setattr(certificates, "luck_of", luck)
    monkeypatch.setattr(certificates, "lucks", certificates.Lucks())
    library = load(ROOT)

    def exercises(**wanted: bool) -> dict[str, Any]:
        rows = certificates.certificate_rows(library, **wanted)
        return {row["question"]: row for row in rows if row["kind"] == "code"}

    assert {row["state"] for row in exercises().values()} == {"luck not computed"}
    assert asked == []
    first, again = exercises(with_luck=True), exercises()
    assert first == again
    assert sorted(asked) == sorted(first)
    assert first["rk4-step"]["state"] == "luck"
    assert "draw more numbers" in first["rk4-step"]["remarks"][0]
    assert "1.0·10⁻⁸" in first["servo-threshold"]["why"]


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
    assert re.search(r"scripts waiting 2 running 0 workers none lives", words(page(tina, "/instructor")))
    seen = page(tina, f"/instructor/learners/{made.json()['learner']}/quizzes/3-scripts/rk4-step")
    assert '<button class="push" disabled>' in seen
    assert "rk4_step(model, data): pass" in seen
    assert re.findall(r"<form[^>]*(?:method|action)", seen) == []
