"""An instructor's desk, by keyboard: a rubric, saved comments, second marks and disagreements."""

import json
from collections.abc import Iterator
from contextlib import ExitStack

import httpx
import pytest
from playwright.sync_api import Page, expect

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.service.accounts import in_database
from grader.settings import Settings
from support.sites import write_content
from support.tokens import issue_token
from web.browsing import Chromium, service

ITEMS = [
    {"id": "a", "title": "Names the damping", "points": 3, "group": "Physics"},
    {"id": "b", "title": "Compares with $2/\\omega$", "points": 1},
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


@pytest.fixture
def clients() -> Iterator[ExitStack]:
    with ExitStack() as clients:
        yield clients


def desk_of(browser: Chromium, origin: str, settings: Settings, name: str, *, scripts: bool = True) -> Page:
    page = browser.new_context(base_url=origin, java_script_enabled=scripts).new_page()
    code = in_database(settings, lambda session: create_sign_in_code(session, name, Role.INSTRUCTOR))
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("today")
    return page


def show(page: Page, which: str) -> None:
    page.goto("/instructor/review")
    page.locator("[name=which]").select_option(which)
    page.get_by_role("button", name="Show").click()


def test_two_reviewers_mark_by_keyboard_and_a_third_decision_settles(
    settings: Settings, origin: str, browser: Chromium, clients: ExitStack
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
    expect(form.locator("math")).to_have_count(1)
    expect(form).not_to_contain_text("$")
    expect(form.get_by_label("Points")).to_have_attribute("placeholder", "0")  # by the script, which now listens
    tina.keyboard.press("1")
    expect(form.get_by_label("Names the damping")).to_be_checked()
    expect(form.get_by_label("Points")).to_have_attribute("placeholder", "3")
    form.get_by_label("Comment for the learner").fill("Which bound?")
    form.get_by_role("button", name="Save my comment").click()
    expect(form.get_by_label("Saved comments")).to_contain_text("Which bound?")
    expect(form.get_by_label("Names the damping")).to_be_checked()
    form.get_by_label("Comment for the learner").press("Control+Enter")
    expect(tina.locator("[data-one] pre").first).to_have_text("bob says.")  # the next one
    expect(form.get_by_label("Names the damping")).not_to_be_checked()
    form.get_by_role("button", name="Insert").click()
    expect(form.get_by_label("Comment for the learner")).to_have_value("Which bound?")
    tina.get_by_label("Answer", exact=True).focus()
    tina.keyboard.press("Enter")
    expect(tina.get_by_role("alert")).to_contain_text("Tick what holds")
    expect(form.get_by_label("Comment for the learner")).to_have_value("Which bound?")
    expect(form.get_by_label("Points")).to_have_attribute("placeholder", "0")
    tina.get_by_label("Answer", exact=True).focus()
    tina.keyboard.press("2")
    tina.keyboard.press("Enter")
    expect(tina.get_by_role("status")).to_contain_text("Nothing else waits")
    expect(rows).to_have_count(0)
    seen = learners[first].get(f"{API}/submissions/{first}").json()["verdict"]
    assert (seen["points"], seen["findings"][0]["message"]) == (3, "Which bound?")
    assert learners[second].get(f"{API}/submissions/{second}").json()["verdict"]["points"] == 1

    tom = desk_of(browser, origin, settings, "tom")
    show(tom, "waiting for my second mark")
    expect(tom.locator("[data-submissions]")).to_contain_text("says.")
    desk = tom.get_by_role("form", name="Review")
    tom.locator("[data-submissions] button").first.click()
    expect(desk).to_contain_text("Yours until")
    expect(desk.get_by_label("Names the damping")).not_to_be_checked()
    expect(desk.get_by_label("Comment for the learner")).to_have_value("")
    desk.get_by_label("Points").fill("0.5")
    desk.get_by_role("button", name="Decide", exact=True).click()
    expect(tom.get_by_role("status").first).to_contain_text("the two marks differ")

    show(tom, "two marks that differ")
    expect(tom.locator("[data-submissions]")).to_contain_text("Partly correct")
    tom.locator("[data-submissions] button").first.click()
    expect(desk).to_contain_text("tina gave 3, tom gave 0.5")
    desk.get_by_label("Points").fill("2")
    desk.get_by_role("button", name="Decide", exact=True).click()
    expect(tom.get_by_role("status").first).to_contain_text("Decided")
    assert learners[first].get(f"{API}/submissions/{first}").json()["verdict"]["points"] == 2
    assert [complaint for complaint in complaints if "422" not in complaint] == []  # 422: nothing was ticked


def test_without_javascript_answers_are_claimed_decided_and_followed_by_the_next(
    settings: Settings, origin: str, browser: Chromium, clients: ExitStack
) -> None:
    sent = []
    for name in ("cem-learner", "dee-learner"):
        token = issue_token(settings, name, "student", None)
        client = clients.enter_context(httpx.Client(base_url=origin, headers={"Authorization": f"Bearer {token}"}))
        answer = {"quiz": "essay", "question": "why", "answer": f"{name[:3]} says."}
        sent.append((client, client.post(f"{API}/submissions", json=answer).json()["id"]))
    una = desk_of(browser, origin, settings, "una", scripts=False)
    uli = desk_of(browser, origin, settings, "uli", scripts=False)
    una.goto("/instructor/review")
    una.get_by_role("button", name="Review the oldest").click()
    expect(una.locator("[data-one] pre").first).to_have_text("cem says.")
    form = una.get_by_role("form", name="Review")
    expect(form).to_contain_text("Yours until")
    expect(form.get_by_text("keys 1 to 9")).to_be_hidden()

    uli.goto("/instructor/review")
    held = uli.locator("[data-submissions] tr").first
    expect(held).to_contain_text("una has it open")
    held.get_by_role("link").click()
    theirs = uli.get_by_role("form", name="Review")
    expect(theirs).to_contain_text("una is reviewing this answer")
    theirs.get_by_label("Points").fill("4")
    theirs.get_by_role("button", name="Decide", exact=True).click()
    expect(uli.get_by_role("alert")).to_contain_text("una is reviewing")
    expect(theirs.get_by_label("Points")).to_have_value("4")

    form.get_by_label("Comment for the learner").fill("See the bound.\nAnd kv.")
    form.get_by_role("button", name="Save my comment").click()
    form.get_by_label("Comment for the learner").fill("Good.")
    form.get_by_label("Names the damping").check()
    form.get_by_label("Saved comments").select_option(
        index=form.get_by_label("Saved comments").locator("option").count() - 1
    )
    form.get_by_role("button", name="Insert").click()
    expect(form.get_by_label("Comment for the learner")).to_have_value("Good.\nSee the bound.\nAnd kv.")
    expect(form.get_by_label("Names the damping")).to_be_checked()
    form.get_by_text("Delete the saved one").click()
    form.get_by_role("button", name="Delete", exact=True).click()
    expect(form.locator("option", has_text="See the bound")).to_have_count(0)
    form.get_by_role("button", name="Decide and next").click()
    expect(una.locator("[data-one] pre").first).to_have_text("dee says.")
    expect(una.get_by_role("status").first).to_contain_text("Decided. The learner can see it now.")
    form.get_by_label("Points").fill("1.5")
    form.get_by_label("Points").press("Enter")
    expect(una.get_by_role("status")).to_contain_text("Nothing else waits")
    verdicts = [client.get(f"{API}/submissions/{one}").json()["verdict"] for client, one in sent]
    assert [verdict["points"] for verdict in verdicts] == [3, 1.5]
    assert verdicts[0]["findings"][0]["message"] == "Good.\nSee the bound.\nAnd kv."

    theirs.get_by_role("button", name="Decide", exact=True).click()  # of the page as it was before
    expect(uli.get_by_role("alert")).to_contain_text("again since you opened it")
    una.goto(f"/instructor/review/{sent[0][1]}?which=submissions")
    expect(form.get_by_label("Names the damping")).to_be_checked()
    expect(form.get_by_label("Comment for the learner")).to_have_value("Good.\nSee the bound.\nAnd kv.")

    form.get_by_text("Take the mark back").click()
    form.get_by_role("button", name="Take it back").click()
    expect(una.get_by_role("status").first).to_have_text("Taken back: the answer waits for a reviewer again.")
    expect(form.get_by_text("Take the mark back")).to_have_count(0)
    client, one = sent[0]
    assert client.get(f"{API}/submissions/{one}").json()["status"] == "needs_review"


def test_an_answer_is_left_to_others_and_no_other_site_can_decide(
    settings: Settings, origin: str, browser: Chromium, clients: ExitStack
) -> None:
    token = issue_token(settings, "fay-learner", "student", None)
    client = clients.enter_context(httpx.Client(base_url=origin, headers={"Authorization": f"Bearer {token}"}))
    answer = {"quiz": "essay", "question": "why", "answer": "fay says."}
    made = client.post(f"{API}/submissions", json=answer).json()["id"]
    vic = desk_of(browser, origin, settings, "vic", scripts=False)
    vic.goto(f"/instructor/review/{made}")
    cookies = {cooky["name"]: cooky["value"] for cooky in vic.context.cookies()}
    form = {"do": "decide", "points": "4", "version": "1"}
    forged = httpx.post(
        f"{origin}/instructor/review/{made}", data=form, cookies=cookies, headers={"Sec-Fetch-Site": "cross-site"}
    )
    assert forged.status_code == 403
    assert client.post(f"/instructor/review/{made}", data=form).status_code in (401, 403)
    vic.goto("/instructor/review")
    vic.locator("[data-submissions] button").first.click()
    vic.get_by_role("button", name="Leave it to others").click()
    expect(vic.locator("[data-submissions]")).not_to_contain_text("have it open")


@pytest.mark.parametrize("scripts", [True, False])
def test_the_decision_is_on_the_screen_before_anything_is_scrolled(
    settings: Settings, origin: str, browser: Chromium, clients: ExitStack, *, scripts: bool
) -> None:
    """Of a form that is longer than the screen, which is narrow enough for a column beside the answer."""
    token = issue_token(settings, "cem-learner", "student", None)
    client = clients.enter_context(httpx.Client(base_url=origin, headers={"Authorization": f"Bearer {token}"}))
    answer = {"quiz": "small", "question": "q4", "answer": "Because."}
    made = client.post(f"{API}/submissions", json=answer).json()["id"]
    tina = desk_of(browser, origin, settings, "tina", scripts=scripts)
    tina.set_viewport_size({"width": 1280, "height": 480})
    tina.goto(f"/instructor/review/{made}")
    form = tina.get_by_role("form", name="Review")
    box = form.bounding_box()
    assert box is not None
    assert box["y"] + box["height"] > 480
    for name in ("Decide and next", "Decide"):
        expect(form.get_by_role("button", name=name, exact=True)).to_be_in_viewport(ratio=1)
