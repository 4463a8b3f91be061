"""An instructor's desk, by keyboard: a rubric, saved comments, second marks and disagreements."""

import json
from collections.abc import Iterator
from contextlib import ExitStack

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from grader.accounts import in_database
from grader.courses.sign_in import create_sign_in_code
from grader.identity import Role
from grader.settings import Settings
from sites import write_content
from tokens import issue_token
from web.browsing import chromium, service

ITEMS = [
    {"id": "a", "title": "Names the damping", "points": 3, "group": "Physics"},
    {"id": "b", "title": "Compares with the bound", "points": 1},
]
QUIZ = {
    "id": "essay",
    "title": "Essay",
    "second_marking": {"share": 1, "tolerance": 1},
    "questions": [{"kind": "open", "id": "why", "q": "Why?", "points": 4, "rubric": ITEMS}],
}
API = "/api/v1"

expect.set_options(timeout=30_000)


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    folder = tmp_path_factory.mktemp("desk")
    content = write_content(folder / "content")
    (content / "quizzes" / "essay.json").write_text(json.dumps(QUIZ))
    return Settings(content=content, data=folder / "data", workers=0)


@pytest.fixture(scope="module")
def origin(settings: Settings) -> Iterator[str]:
    with service(settings) as origin:
        yield origin


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture
def clients() -> Iterator[ExitStack]:
    with ExitStack() as clients:
        yield clients


def desk_of(browser: Browser, origin: str, settings: Settings, name: str) -> Page:
    page = browser.new_context(base_url=origin).new_page()
    code = in_database(settings, lambda session: create_sign_in_code(session, name, Role.INSTRUCTOR))
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("today")
    page.goto("/instructor/review")
    return page


def show(page: Page, which: str) -> None:
    page.locator("[name=which]").select_option(which)
    page.get_by_role("button", name="Show").click()


def test_two_reviewers_mark_by_keyboard_and_a_third_decision_settles(
    settings: Settings, origin: str, browser: Browser, clients: ExitStack
) -> None:
    learners = {}
    for name in ("ann-learner", "bob-learner"):
        token = issue_token(settings, name, "student", None)
        client = clients.enter_context(httpx.Client(base_url=origin, headers={"Authorization": f"Bearer {token}"}))
        answer = {"quiz": "essay", "question": "why", "answer": f"{name[:3]} says."}
        learners[client.post(f"{API}/submissions", json=answer).json()["id"]] = client
    first, second = learners

    tina = desk_of(browser, origin, settings, "tina")
    complaints: list[str] = []
    tina.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    show(tina, "waiting for a review")
    rows = tina.locator("[data-submissions] tr")
    expect(rows).to_have_count(2)
    expect(tina.locator("main")).not_to_contain_text("ann-learner")
    rows.first.get_by_role("button").click()
    form = tina.get_by_role("form", name="Review")
    expect(form).to_contain_text("Yours until")
    expect(form).to_contain_text("Physics")
    tina.keyboard.press("1")
    expect(form.get_by_label("Names the damping")).to_be_checked()
    expect(form.get_by_label("Points")).to_have_attribute("placeholder", "3")
    form.get_by_label("Comment for the learner").fill("Which bound?")
    form.get_by_role("button", name="Save the comment above").click()
    expect(form.get_by_label("Saved comments")).to_contain_text("Which bound?")
    form.get_by_label("Comment for the learner").press("Control+Enter")
    expect(tina.locator("[data-one] pre").first).to_have_text("bob says.")  # the next one
    expect(form.get_by_label("Names the damping")).not_to_be_checked()
    form.get_by_role("button", name="Insert").click()
    expect(form.get_by_label("Comment for the learner")).to_have_value("Which bound?")
    tina.locator("[data-one]").focus()
    tina.keyboard.press("2")
    tina.keyboard.press("Enter")
    expect(rows).to_have_count(0)
    seen = learners[first].get(f"{API}/submissions/{first}").json()["verdict"]
    assert (seen["points"], seen["findings"][0]["message"]) == (3, "Which bound?")
    assert learners[second].get(f"{API}/submissions/{second}").json()["verdict"]["points"] == 1

    tom = desk_of(browser, origin, settings, "tom")
    show(tom, "waiting for my second mark")
    expect(tom.locator("[data-submissions]")).to_contain_text("needs review")
    desk = tom.get_by_role("form", name="Review")
    tom.locator("[data-submissions] button").first.click()
    expect(desk).to_contain_text("Yours until")
    expect(desk.get_by_label("Names the damping")).not_to_be_checked()
    desk.get_by_label("Points").fill("0.5")
    desk.get_by_role("button", name="Decide", exact=True).click()
    expect(desk).to_contain_text("the two marks differ")

    show(tom, "two marks that differ")
    expect(tom.locator("[data-submissions]")).to_contain_text("partial")
    tom.locator("[data-submissions] button").first.click()
    expect(desk).to_contain_text("tina gave 3, tom gave 0.5")
    desk.get_by_label("Points").fill("2")
    desk.get_by_role("button", name="Decide", exact=True).click()
    expect(desk).to_contain_text("Decided")
    assert learners[first].get(f"{API}/submissions/{first}").json()["verdict"]["points"] == 2
    assert [one for one in complaints if "404" not in one] == []  # 404: nothing else waits
