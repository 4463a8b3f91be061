"""The pages of an instructor in a browser: axe-core finds nothing, nothing scrolls sideways, and they are true."""

import json
import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext, Page, expect
from sqlalchemy.orm import Session

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.service.accounts import in_database
from grader.settings import Settings
from grader.store.outbox import DEAD, Delivery, add_webhook
from grader.store.tables import now
from support.sites import Site, open_site, write_content
from web.browsing import chromium, findings

API = "/api/v1"
HOSTILE = "<img src=x onerror=alert(1)> " + "unbrokenword" * 30
ESSAY = {
    "id": "essay",
    "title": "An essay",
    "questions": [{"kind": "open", "id": "why", "q": "Why does it grow?", "points": 4, "reference": "The damping."}],
}
ANSWERS: dict[str, dict[str, object]] = {
    "ann": {"q1": 1, "q2": "5 ms", "q4": "Because."},
    "bob": {"q1": 2, "q2": "7 ms", "q4": HOSTILE},
    "cem": {"q1": 1, "q2": "7 ms"},
    "dee": {"q1": 0, "q2": "50 ms"},
    "=eve": {"q1": 1},
}
PAGES = {
    "today": "/instructor",
    "stuck": "/instructor/stuck",
    "review": "/instructor/review",
    "gradebook": "/instructor/gradebook?quiz=small",
    "gradebook of all quizzes": "/instructor/gradebook",
    "statistics": "/instructor/statistics?quiz=small",
    "scripts alike": "/instructor/alike",
    "people": "/instructor/people",
    "invitations": "/instructor/people/invitations",
    "tokens": "/instructor/people/tokens",
    "audit log": "/instructor/people/audit",
    "regrades": "/instructor/regrades",
    "extensions": "/instructor/extensions?quiz=small",
    "dates": "/instructor/dates?quiz=small",
    "platforms": "/instructor/lti",
    "courses": "/instructor/courses",
    "content": "/instructor/content",
    "draft": "/instructor/draft",
    "answer keys": "/instructor/certificates",
    "service": "/instructor/service",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Answers of five learners, one of them hostile; two wait for a review."""
    folder = tmp_path_factory.mktemp("course")
    content = write_content(folder / "content")
    (content / "quizzes" / "essay.json").write_text(json.dumps(ESSAY))
    with open_site(Settings(content=content, data=folder / "data", workers=0)) as site:
        for name, answers in ANSWERS.items():
            client = site.client(name)
            for question, answer in answers.items():
                body = {"quiz": "small", "question": question, "answer": answer}
                assert client.post(f"{API}/submissions", json=body).status_code == 201
        yield site


@pytest.fixture(scope="module")
def teacher(site: Site) -> Iterator[BrowserContext]:
    """The browser of an instructor."""
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "tina", Role.INSTRUCTOR))
    with chromium() as browser:
        context = browser.new_context(base_url=site.origin)
        page = context.new_page()
        page.goto(f"/signin?code={code}")
        page.get_by_role("button", name="Sign in").click()
        page.goto("/instructor/courses")
        page.get_by_label("Name").fill(HOSTILE)  # a course to switch to
        page.get_by_role("button", name="Make the course").click()
        page.close()
        yield context


@pytest.fixture(scope="module")
def page(teacher: BrowserContext) -> Page:
    """One tab for all pages."""
    return teacher.new_page()


def test_a_due_date_is_set_on_the_page_and_reaches_the_learner(teacher: BrowserContext, site: Site) -> None:
    page = teacher.new_page()
    page.goto("/instructor/content")
    page.get_by_role("link", name="Dates and rules").click()
    page.locator("select[name=quiz]").select_option("essay")
    page.get_by_role("button", name="Show").click()
    due = page.locator("[data-rule=due]")
    expect(due).to_contain_text("As in the content.")
    due.get_by_label("Due", exact=True).fill("2190-12-24T18:00")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("status")).to_contain_text("Saved.")
    expect(due).to_contain_text("Set in this course. The content says: none.")
    ann = site.client("ann")
    assert ann.get(f"{API}/quizzes/essay").json()["policy"]["due"] == "2190-12-24T18:00:00Z"
    due.get_by_label("Due", exact=True).fill("2190-12-25T18:00")
    due.get_by_role("button", name="Back to the content").click()
    expect(due).to_contain_text("As in the content.")
    assert ann.get(f"{API}/quizzes/essay").json()["policy"]["due"] is None
    page.close()


def check(page: Page) -> None:
    """Nothing that axe-core finds or cannot decide, light and wide, dark and narrow; nothing wider than the screen."""
    page.emulate_media(color_scheme="light")
    assert findings(page) == []
    for width in (1280, 390, 320):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width, width
    page.emulate_media(color_scheme="dark")
    assert findings(page) == []


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_accessible_fits_every_width_and_says_where_it_is(page: Page, name: str) -> None:
    page.set_viewport_size({"width": 1280, "height": 800})
    page.goto(PAGES[name], wait_until="networkidle")
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    check(page)
    assert page.locator("h1").count() == 1
    assert page.locator("img[src=x]").count() == 0
    current = page.get_by_role("navigation").locator("[aria-current=page]")
    expect(current).to_have_count(1)
    expect(current).to_have_attribute("href", PAGES[name].partition("?")[0])


def test_five_entries_lead_to_every_page_by_links_alone(page: Page) -> None:
    page.goto("/instructor")
    main = page.get_by_role("navigation", name="Pages")
    expect(main.get_by_role("link")).to_have_text(["Today", "Review", "Grades", "Content", "People"])
    reached = set()
    for address in main.get_by_role("link").evaluate_all("links => links.map(one => one.getAttribute('href'))"):
        page.goto(address)
        expect(main.locator("[aria-current]")).to_have_attribute("href", address)
        links = page.get_by_role("navigation").get_by_role("link")
        reached |= set(links.evaluate_all("links => links.map(one => one.getAttribute('href'))"))
    assert reached == {path.partition("?")[0] for path in PAGES.values()}


def test_today_counts_what_waits_and_leads_to_it(page: Page) -> None:
    page.goto("/instructor")
    expect(page.get_by_role("heading", level=1)).to_have_text("What needs a person today")
    expect(page.locator(".tasks")).to_contain_text("No worker is running")
    expect(page.locator(".tasks")).to_contain_text("2")
    expect(page.locator(".tasks")).to_contain_text("small: Why?: 2, the oldest for ")
    page.get_by_role("link", name="small: Why?").click()
    expect(page.locator("[name=which]")).to_have_value("reviews")
    expect(page.locator("[data-submissions] tr")).to_have_count(2)


def test_an_answer_on_the_desk_is_wrapped_and_accessible(page: Page) -> None:
    page.goto("/instructor/review")
    page.locator("[data-submissions] button").nth(1).click()
    page.wait_for_url("**/review/*")
    answer = page.get_by_label("Answer", exact=True)
    expect(answer).to_contain_text(HOSTILE)
    expect(page.locator("[data-one]")).to_contain_text("SECRET reference")
    expect(page.get_by_role("form", name="Review")).to_contain_text("Yours until")
    assert answer.evaluate("it => it.scrollWidth <= it.clientWidth")
    assert page.locator("img[src=x]").count() == 0
    check(page)


def expect_learners(page: Page, *names: str) -> None:
    expect(page.locator("tbody th")).to_have_text(list(names))


def test_the_gradebook_is_sorted_filtered_and_told_without_scripts(teacher: BrowserContext, site: Site) -> None:
    assert teacher.browser is not None
    context = teacher.browser.new_context(
        base_url=site.origin, java_script_enabled=False, storage_state=teacher.storage_state()
    )
    page = context.new_page()
    page.goto("/instructor/gradebook?quiz=small")
    expect_learners(page, "=eve", "ann", "bob", "cem", "dee")
    page.get_by_role("link", name="Points of 4").click()
    expect(page.get_by_role("columnheader", name="Points of 4")).to_have_attribute("aria-sort", "ascending")
    page.get_by_role("link", name="Points of 4").click()
    expect(page.get_by_role("columnheader", name="Points of 4")).to_have_attribute("aria-sort", "descending")
    expect_learners(page, "ann", "=eve", "cem", "bob", "dee")
    expect(page.get_by_role("row", name="ann").locator("td")).to_have_text(
        ["Correct, 1 of 1", "Correct, 1 of 1", "Not answered", "waits", "3", "2"]
    )
    page.get_by_label("Show").select_option("who waits for a verdict")
    page.get_by_role("button", name="Show").click()
    expect_learners(page, "ann", "bob")
    page.get_by_label("Find a learner").fill("B")
    page.get_by_role("button", name="Show").click()
    expect_learners(page, "bob")
    page.get_by_role("link", name="bob").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("bob")
    expect(page.locator(".story li")).to_have_count(2)
    expect(page.locator("main")).to_contain_text("answered 7 ms")
    expect(page.locator("main")).to_contain_text("answered c")
    expect(page.locator("main")).to_contain_text("1 answer is under review without a name")
    expect(page.locator("main")).not_to_contain_text(HOSTILE)
    context.close()


def test_the_gradebook_of_the_course_has_a_column_for_every_quiz(teacher: BrowserContext, site: Site) -> None:
    assert teacher.browser is not None
    context = teacher.browser.new_context(
        base_url=site.origin, java_script_enabled=False, storage_state=teacher.storage_state()
    )
    page = context.new_page()
    page.goto("/instructor")
    page.get_by_role("link", name="Grades").click()
    heads = page.locator("thead th")
    expect(heads).to_have_text(["Learner ↑", "essay of 4", "small of 4", "Answered", "Points of 8"])
    expect(page.get_by_role("row", name="ann").locator("td")).to_have_text(
        ["–Not answered", "2 waits, 3 of 4 answered", "3", "2"]
    )
    expect(page.get_by_role("row", name="bob").locator("td").nth(1)).to_have_text("waits, 3 of 4 answered")
    page.get_by_role("link", name="Points of 8").click()
    expect(page.get_by_role("columnheader", name="Points of 8")).to_have_attribute("aria-sort", "ascending")
    page.get_by_role("link", name="Points of 8").click()
    expect_learners(page, "ann", "=eve", "cem", "bob", "dee")
    with page.expect_download() as download:
        page.get_by_role("link", name="CSV", exact=True).click()
    heading = download.value.path().read_text().splitlines()[0]
    assert heading == "user,id,email,essay,small,points,max_points"
    page.get_by_role("link", name="small").click()
    expect(page.get_by_label("Quiz")).to_have_value("small")
    page.get_by_label("Quiz").select_option("all quizzes")
    page.get_by_role("button", name="Show").click()
    expect(heads.nth(1)).to_have_text("essay of 4")
    context.close()


def test_the_gradebook_and_stories_are_for_instructors_of_the_course(site: Site, page: Page) -> None:
    page.goto("/instructor/gradebook?quiz=small")
    address = page.get_by_role("link", name="ann", exact=True).get_attribute("href") or ""
    ann = site.client("ann")
    assert ann.get("/instructor/gradebook").status_code in (401, 403)
    assert ann.get(address).status_code in (401, 403)
    for path in (address, f"{address}/lessons/questions", "/instructor/certificates"):
        page.goto(path)
        check(page)
    page.goto("/instructor/learners/" + "0" * 32)
    expect(page.get_by_role("heading", level=1)).not_to_have_text("ann")
    expect(page.locator("main")).to_contain_text("no such learner")


def test_a_result_that_did_not_arrive_is_told_and_sent_again(site: Site, page: Page) -> None:
    def lose(session: Session) -> None:
        made = add_webhook(session, "default", {"url": "https://hook.example", "secret": "s", "created_by": "tina"})
        at = {"course": "default", "learner": "0" * 32, "quiz": "small", "question": "q1", "destination": made.id}
        told = {"state": DEAD, "version": 1, "noted_at": now(), "attempts": 5, "error": "<b>404</b>"}
        session.add(Delivery(**at, **told, has_job=False, forced=False))

    in_database(site.settings, lose)
    page.goto("/instructor")
    expect(page.locator(".tasks")).to_contain_text("small q1, to a webhook, 5 tries: <b>404</b>")
    check(page)
    page.get_by_role("button", name="Send again").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Service")
    expect(page.get_by_role("button", name="Send again")).to_have_count(0)


def test_an_answer_that_nobody_has_marked_is_no_zero_in_an_export(site: Site) -> None:
    text = site.client("tina", "instructor").get(f"{API}/gradebook.csv?quiz=small").text
    assert re.search(r"\r\nann,[0-9a-f]{32},,1,1,,,2,4\r\n", text)
    canvas = site.client("tina", "instructor").get(f"{API}/gradebook.csv?quiz=small&format=canvas").text
    assert canvas.partition("\r\n")[0].endswith(",A small quiz: q1,A small quiz: q2,A small quiz: q3,A small quiz: q4")
