"""The pages without JavaScript: forms, redirects, errors in the site's own pages; over HTTP, with the real service."""

import html
import re
from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import expect
from sqlalchemy import select
from sqlalchemy.orm import Session

from grader.courses.answering import stopping
from grader.courses.answering.stopping import STOPPED, STOPPING, TOO_LATE
from grader.courses.people.identity import COOKIE, Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.queue import jobs
from grader.service.accounts import in_database
from grader.settings import Settings
from grader.store import regrades, submissions
from grader.store.tables import Member
from grader.web.frame.rendering import templates
from support.servers import PLAIN
from web.browsing import chromium, findings, service

BROWSER = {"Accept": "text/html,*/*;q=0.8", "Sec-Fetch-Site": "same-origin"}
expect.set_options(timeout=30_000)
HOSTILE = "<script>alert(1)</script></textarea><b>\"'&amp; \u202e"


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    return Settings(data=tmp_path_factory.mktemp("data"), workers=0)


@pytest.fixture(scope="module")
def origin(settings: Settings) -> Iterator[str]:
    with service(settings) as origin:
        yield origin


@pytest.fixture
def browser(origin: str) -> Iterator[httpx.Client]:
    """A browser without JavaScript, whose session has not begun."""
    with httpx.Client(base_url=origin, headers=BROWSER, follow_redirects=True, verify=PLAIN) as browser:
        yield browser


def card(page: str, name: str) -> str:
    """One question of a page."""
    match = re.search(rf'<article [^>]*id="{re.escape(name)}".*?</article>', page, re.DOTALL)
    assert match is not None, page
    return match[0]


def fields(form: str) -> dict[str, str]:
    """The hidden fields of a form."""
    hidden = re.findall(r'<input type="hidden" name="(\w+)" value="([^"]*)"', form)
    return {name: html.unescape(value) for name, value in hidden}


def send(browser: httpx.Client, question: str, answer: str, **changed: str) -> httpx.Response:
    """Opens the lesson, and sends one form of it."""
    quiz, _, name = question.partition("/")
    page = browser.get("/").text
    data = fields(card(page, f"{quiz}--{name}")) | {"answer": answer} | changed
    return browser.post(f"/quizzes/{question}", data=data)


def test_the_first_answer_begins_a_session_and_comes_back_after_a_reload(browser: httpx.Client) -> None:
    response = send(browser, "1.3-check/q2", "0.005 s")
    assert response.status_code == 200
    assert str(response.url).endswith("/#1.3-check--q2")
    for page in (response.text, browser.get("/").text):
        mine = card(page, "1.3-check--q2")
        assert 'value="0.005 s"' in mine
        assert 'data-status="correct"' in mine
        assert "read as <b>5\u202fms</b>" in mine
        assert "<dd>1 of 16</dd>" in page


def test_a_choice_and_a_text_come_back(browser: httpx.Client) -> None:
    send(browser, "1.3-check/q1", "1")
    page = send(browser, "1.3-check/q4", "First\r\n\r\nsecond").text
    assert re.search(r'value="1" checked', card(page, "1.3-check--q1"))
    mine = card(page, "1.3-check--q4")
    assert ">\nFirst\n\nsecond</textarea>" in mine
    assert "Waiting for an instructor" in mine


def test_an_unreadable_answer_is_told_beside_its_field_and_touches_nothing(browser: httpx.Client) -> None:
    send(browser, "1.3-check/q2", "7 ms")
    response = send(browser, "1.3-check/q2", "5 kg")
    assert response.status_code == 422
    mine = card(response.text, "1.3-check--q2")
    assert 'value="5 kg"' in mine
    assert 'aria-invalid="true"' in mine
    assert "No attempt was used" in mine
    assert 'data-status="incorrect"' in mine  # the earlier verdict stands
    assert 'value="7 ms"' in card(browser.get("/").text, "1.3-check--q2")


@pytest.mark.parametrize(
    ("question", "why"),
    [("1.3-check/q1", "Choose one"), ("1.3-check/q2", "Write an answer"), ("1.3-check/q4", "Write")],
)
def test_an_empty_answer_is_told_so(browser: httpx.Client, question: str, why: str) -> None:
    response = send(browser, question, " ")
    assert response.status_code == 422
    assert why in card(response.text, question.replace("/", "--"))


def test_a_form_sent_twice_makes_one_submission(browser: httpx.Client) -> None:
    data = fields(card(browser.get("/").text, "1.3-check--q2"))
    browser.post("/quizzes/1.3-check/q2", data=data | {"answer": "7 ms"})
    browser.post("/quizzes/1.3-check/q2", data=data | {"answer": "7 ms"})
    items = browser.get("/api/v1/submissions?quiz=1.3-check").json()["items"]
    assert [item["attempt"] for item in items] == [1]
    browser.post("/quizzes/1.3-check/q2", data=data | {"answer": "8 ms"})
    assert len(browser.get("/api/v1/submissions?quiz=1.3-check").json()["items"]) == 2


def test_a_script_is_handed_in_and_its_page_says_that_it_waits(browser: httpx.Client) -> None:
    page = browser.get("/quizzes/1.3-exercises/servo-threshold").text
    assert "def largest_stable_timestep" in page  # the starter stands in the editor
    source = f"# {HOSTILE}\r\ndef largest_stable_timestep(model, integrator):\r\n    return None\r\n"
    response = browser.post("/quizzes/1.3-exercises/servo-threshold", data=fields(page) | {"answer": source})
    assert str(response.url).endswith("/quizzes/1.3-exercises/servo-threshold")
    assert "Waiting for its turn" in response.text
    assert '<noscript><meta http-equiv="refresh"' in response.text
    editor = re.search(r'<textarea id="answer".*?>(.*?)</textarea>', response.text, re.DOTALL)
    assert editor is not None
    assert html.unescape(editor[1]).strip() == source.replace("\r\n", "\n").strip()


def test_what_a_learner_types_is_never_markup(browser: httpx.Client) -> None:
    for question in ("1.3-check/q2", "1.3-check/q4"):
        page = send(browser, question, HOSTILE).text
        assert "<script>alert" not in page
        assert "&lt;script&gt;alert(1)" in card(page, question.replace("/", "--"))


def test_another_site_cannot_send_a_form(browser: httpx.Client) -> None:
    send(browser, "1.3-check/q1", "1")
    for headers in ({"Sec-Fetch-Site": "cross-site"}, {"Sec-Fetch-Site": "none"}):
        response = browser.post("/quizzes/1.3-check/q1", data={"answer": "1"}, headers=headers)
        assert response.status_code == 403


def test_an_answer_of_an_expired_session_is_given_back(browser: httpx.Client) -> None:
    page = send(browser, "1.3-check/q1", "1").text
    browser.cookies.set(COOKIE, "grs_0000000000000000_0", domain="127.0.0.1")
    for cookie in list(browser.cookies.jar):
        browser.cookies.delete(cookie.name, domain=cookie.domain)
    data = fields(card(page, "1.3-check--q4")) | {"answer": "A long text <b>"}
    response = browser.post("/quizzes/1.3-check/q4", data=data)
    assert response.status_code == 401
    assert "the session of this browser has ended. Load the page again, then send it once more." in response.text
    assert "A long text &lt;b&gt;" in response.text


def test_whoever_had_signed_in_is_not_told_to_go_on_as_somebody_else(browser: httpx.Client, settings: Settings) -> None:
    in_database(settings, lambda session: create_sign_in_code(session, "cat", Role.STUDENT))
    cat = in_database(settings, lambda session: session.scalars(select(Member.id).where(Member.name == "cat")).one())
    response = browser.post("/quizzes/1.3-check/q1", data={"answer": "1", "learner": cat})
    assert response.status_code == 401
    assert "Sign in in another tab, then send it again." in response.text


def test_where_accounts_are_needed_the_cure_is_to_sign_in() -> None:
    page = templates.get_template("signed_out.html").render(who=None, typed="", begin=False)
    assert "the session of this browser has ended. Sign in in another tab, then send it again." in page


def test_a_form_of_an_expired_session_is_not_said_to_be_kept(browser: httpx.Client) -> None:
    page = browser.post("/instructor/dates", data={"quiz": "1.3-check", "attempts": "2"})
    assert page.status_code == 401
    assert "Nothing was taken. Sign in in another tab, then go back here and send it again." in page.text
    assert "is kept" not in page.text


def test_an_answer_typed_by_another_learner_of_the_browser_is_not_taken(browser: httpx.Client) -> None:
    send(browser, "1.3-check/q1", "1")
    response = send(browser, "1.3-check/q4", "Mine.", learner="someone-else")
    assert response.status_code == 401
    assert "signed in as someone else" in response.text
    assert "Mine." in response.text


def test_a_return_to_another_site_is_not_possible(browser: httpx.Client) -> None:
    for option, back in enumerate(("//evil.example", "https://evil.example", "/instructor", "/lessons/../x")):
        response = send(browser, "1.3-check/q1", str(option), back=back)
        assert response.url.path == "/"
        assert response.url.host == "127.0.0.1"


def test_lessons_and_quizzes_have_addresses(browser: httpx.Client) -> None:
    assert 'data-quiz="1.3-exercises"' in browser.get("/lessons/1.3").text
    alone = browser.get("/?quiz=1.3-check").text
    assert "1.3-exercises" not in alone
    assert str(browser.get("/quizzes/1.3-check/q1").url).endswith("/lessons/1.3#1.3-check--q1")


@pytest.mark.parametrize(
    "path", ["/nowhere", "/lessons/9", "/?quiz=none", "/quizzes/1.3-check/none", "/quizzes/none/q1", "/%3Cscript%3E"]
)
def test_what_is_not_there_is_a_page_of_the_site(browser: httpx.Client, path: str) -> None:
    response = browser.get(path)
    assert response.status_code == 404
    assert response.headers["content-type"] == "text/html; charset=utf-8"
    assert "unsafe" not in response.headers["content-security-policy"]
    assert "<h1>There is nothing here</h1>" in response.text
    assert "<script>" not in response.text


@pytest.mark.parametrize(
    ("path", "to"),
    [
        ("/lessons/1.3/?a=b%26c", "/lessons/1.3?a=b%26c"),
        ("/lessons/1.3//", "/lessons/1.3"),
        ("/a%20b%5Cc/", "/a%20b%5Cc"),
        ("//elsewhere.example/", "/elsewhere.example"),
    ],
)
def test_an_address_that_ends_in_a_slash_leads_to_the_page_on_this_host(
    browser: httpx.Client, path: str, to: str
) -> None:
    url = httpx.URL(browser.base_url).copy_with(raw_path=path.encode())
    response = browser.get(url, follow_redirects=False)
    assert (response.status_code, response.headers["location"]) == (308, to)


def test_programs_get_problem_documents_and_no_pages(browser: httpx.Client) -> None:
    for path, accept in (("/api/v1/nowhere", "text/html"), ("/nowhere", "application/json"), ("/nowhere", "*/*")):
        response = browser.get(path, headers={"Accept": accept})
        assert response.headers["content-type"] == "application/problem+json", (path, accept)


def test_too_large_a_form_is_refused_with_a_page(browser: httpx.Client) -> None:
    send(browser, "1.3-check/q1", "1")
    data = {"answer": "x" * 300_000, "learner": ""}
    assert browser.post("/quizzes/1.3-exercises/rk4-step", data=data).status_code == 413
    response = browser.post("/quizzes/1.3-exercises/rk4-step", data=data | {"answer": "x" * 900_000})
    assert response.status_code == 413
    assert "This is too long" in response.text


def test_an_expired_link_says_so(browser: httpx.Client) -> None:
    response = browser.get("/signin?code=gri_0_0")
    assert response.status_code == 401
    assert "sign-in link" in response.text


def test_a_link_that_was_used_leads_on(browser: httpx.Client, settings: Settings) -> None:
    code = in_database(settings, lambda session: create_sign_in_code(session, "Ann", Role.STUDENT))
    assert browser.post("/signin", data={"code": code}).status_code == 200
    for again in (browser.post("/signin", data={"code": code}), browser.get(f"/signin?code={code}")):
        assert again.status_code == 401
        assert 'href="/">Go on as Ann</a>' in again.text
        assert "Begin without a name" not in again.text
    browser.cookies.clear()
    for again in (browser.post("/signin", data={"code": code}), browser.get(f"/signin?code={code}")):
        assert again.status_code == 401
        assert "Ask your instructor for a new one" in again.text
        assert 'href="/">Begin without a name</a>' in again.text  # on loopback


def test_an_instructor_sees_the_lesson_too(browser: httpx.Client, settings: Settings) -> None:
    code = in_database(settings, lambda session: create_sign_in_code(session, HOSTILE[:40], Role.INSTRUCTOR))
    browser.post("/signin", data={"code": code})
    page = browser.get("/").text
    assert "<script>alert" not in page
    assert 'href="/instructor"' in page


def test_attempts_are_the_learners_own(browser: httpx.Client, origin: str) -> None:
    page = browser.get("/quizzes/1.3-exercises/rk4-step").text
    browser.post("/quizzes/1.3-exercises/rk4-step", data=fields(page) | {"answer": "SECRET = 1"})
    [mine] = browser.get("/api/v1/submissions?question=rk4-step").json()["items"]
    address = f"/quizzes/1.3-exercises/rk4-step?attempt={mine['id']}"
    assert "SECRET" in browser.get(address).text
    with httpx.Client(base_url=origin, headers=BROWSER, follow_redirects=True, verify=PLAIN) as other:
        send(other, "1.3-check/q1", "1")
        assert other.get(address).status_code == 404
        assert other.get(f"/quizzes/1.3-exercises/rk4-step/attempts?left={mine['id']}").status_code == 404
        assert other.get(f"/quizzes/1.3-exercises/rk4-step/attempts/{mine['id']}/motion.svg").status_code == 404


STEP = "/quizzes/1.3-exercises/rk4-step"
SCRIPT = "def rk4_step(model, data):\n    return None  # <later>\n"
STOP = re.compile(r'<button [^>]*formaction="([^"]*)" name="stop" value="(\w+)"')


def queue(browser: httpx.Client) -> httpx.Response:
    """Hands in a script that no worker takes."""
    form = re.search(r"<form .*?</form>", browser.get(STEP).text, re.DOTALL)
    assert form is not None
    return browser.post(STEP, data=fields(form[0]) | {"answer": SCRIPT})


def stop(browser: httpx.Client, page: str) -> httpx.Response:
    """Presses the page's button, with the script in the editor."""
    [(address, name)] = STOP.findall(page)
    return browser.post(address, data={"stop": name, "answer": SCRIPT})


def test_a_script_that_waits_can_be_stopped_and_handed_in_again(browser: httpx.Client, settings: Settings) -> None:
    stopped = stop(browser, queue(browser).text)
    assert stopped.status_code == 200
    assert STOPPED in stopped.text
    assert "&lt;later&gt;" in stopped.text
    assert "No attempt yet" in stopped.text
    [one] = browser.get("/api/v1/submissions").json()["items"]
    assert (one["status"], one["verdict"]["status"], one["attempt"]) == ("graded", "invalid_answer", 1)
    assert in_database(settings, lambda session: regrades.find_reviewed(session, [one["id"]])) == {one["id"]}
    assert STOP.findall(queue(browser).text) != []
    assert [row["status"] for row in browser.get("/api/v1/submissions").json()["items"]] == ["queued", "graded"]


def test_a_script_whose_worker_is_away_is_asked_to_stop_once(
    browser: httpx.Client, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stopping, "WAIT_S", 0.0)
    page = queue(browser).text
    name = STOP.findall(page)[0][1]

    def claim_all(session: Session) -> None:
        while (claimed := jobs.claim(session, 1, (jobs.GRADE,))) is not None:
            submissions.start(session, claimed.subject)

    in_database(settings, claim_all)
    asked = stop(browser, browser.get(STEP).text)
    assert asked.status_code == 200
    assert STOPPING in asked.text
    refused = stop(browser, asked.text)
    assert refused.status_code == 409
    assert TOO_LATE in refused.text
    assert browser.post(f"/api/v1/submissions/{name}:stop").status_code == 409


def test_nobody_stops_the_script_of_another(browser: httpx.Client, origin: str) -> None:
    page = queue(browser).text
    name = STOP.findall(page)[0][1]
    with httpx.Client(base_url=origin, headers=BROWSER, follow_redirects=True, verify=PLAIN) as other:
        assert stop(other, page).status_code == 401
        queue(other)
        assert stop(other, page).status_code == 404
        assert other.post(f"/api/v1/submissions/{name}:stop").status_code == 404
    stopped = browser.post(f"/api/v1/submissions/{name}:stop")
    assert (stopped.status_code, stopped.json()["verdict"]["status"]) == (200, "invalid_answer")


def test_the_page_stops_a_script_and_keeps_what_is_typed(origin: str) -> None:
    with chromium() as browser:
        page = browser.new_context(base_url=origin).new_page()
        page.goto(STEP)
        page.locator("textarea.code").fill(SCRIPT)
        page.get_by_role("button", name="Run and judge").click()
        page.get_by_role("button", name="Stop").click()
        expect(page.locator("[data-trouble]")).to_have_text(STOPPED)
        expect(page.locator("#under-way[data-events]")).to_have_count(0)
        expect(page.locator("textarea.code")).to_have_value(SCRIPT)
        page.reload()
        expect(page.locator("textarea.code")).to_have_value(SCRIPT)
        page.get_by_role("button", name="Run and judge").click()
        expect(page.get_by_role("button", name="Stop")).to_be_visible()
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            assert findings(page) == []
        page.set_viewport_size({"width": 320, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= 320
