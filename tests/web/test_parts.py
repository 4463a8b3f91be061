"""Questions whose answers have several parts: by mouse, by keyboard and without JavaScript; drafts; statistics."""

import html
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, Locator, Page, expect

from grader.courses.people.identity import COOKIE
from grader.courses.people.sign_in import create_sign_in_code, redeem_sign_in_code
from grader.questions import question_view
from grader.settings import Settings
from support.sites import Site, open_site
from web.browsing import Chromium, findings

CONTENT = Path(__file__).parents[1] / "questions" / "content"
STATIC = Path(__file__).parents[2] / "src" / "grader" / "web" / "static"
PLAIN_QUIZ = {"id": "plain", "title": "Plain", "questions": [
    {"kind": "mcq", "q": "Which?", "options": ["a", "b"], "answer": 0},
]}  # fmt: skip
STAGES = ["mj_fwdPosition", "mj_fwdVelocity", "mj_fwdActuation", "mj_fwdConstraint", "mj_Euler"]
UNITS = ["N m s/rad", "kg m²", "N m/rad", "N m/rad"]
BYTES_MAX = 6_000
API = "/api/v1"
PATIENCE_MS = 30_000
expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = shutil.copytree(CONTENT, tmp_path_factory.mktemp("content") / "content")
    (folder / "quizzes" / "plain.json").write_text(json.dumps(PLAIN_QUIZ))
    with open_site(Settings(content=folder, data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        yield site


@pytest.fixture
def context(site: Site, browser: Chromium) -> Iterator[BrowserContext]:
    context = browser.new_context(base_url=site.origin, viewport={"width": 1280, "height": 900})
    yield context
    context.close()


@pytest.fixture
def page(context: BrowserContext) -> Page:
    return context.new_page()


def opened(page: Page) -> None:
    page.goto("/?quiz=parts", wait_until="networkidle")
    expect(page.locator(".is-live")).to_have_count(2)


def card(page: Page, question: str) -> Locator:
    return page.locator(f'[id="parts--{question}"]')


def send(page: Page, question: str) -> str:
    """Sends the form of a question, and returns the status of the verdict."""
    card(page, question).get_by_role("button", name="Send").click()
    expect(card(page, question).locator("[data-said]")).to_be_visible()
    return card(page, question).locator("[data-status]").get_attribute("data-status") or ""


def stages(page: Page) -> list[str]:
    """The names of the stages as they stand."""
    return card(page, "stages").locator("li code").all_inner_texts()[:5]


def put_in_order(page: Page, press: str) -> None:
    """Moves each stage up to its place by the keyboard."""
    for place, stage in enumerate(STAGES):
        while stages(page)[place] != stage:
            button = card(page, "stages").get_by_role("button", name=f"Move up: {stage}")
            button.focus()
            page.keyboard.press(press)
            expect(button).to_be_focused()


@pytest.mark.parametrize("press", ["Enter", "Space"])
def test_items_are_put_in_order_with_the_keyboard_alone(page: Page, press: str) -> None:
    opened(page)
    assert stages(page) != STAGES
    put_in_order(page, press)
    expect(card(page, "stages").get_by_role("status").first).to_contain_text(re.compile(r"position \d of 5"))
    assert send(page, "stages") == "correct"
    assert stages(page) == STAGES


def test_a_button_at_the_end_of_the_list_does_nothing(page: Page) -> None:
    opened(page)
    before = stages(page)
    first = card(page, "stages").get_by_role("button", name=f"Move up: {before[0]}")
    expect(first).to_have_attribute("aria-disabled", "true")
    first.focus()
    page.keyboard.press("Enter")
    assert stages(page) == before
    expect(card(page, "stages")).not_to_contain_text("not sent")


def drag(page: Page, start: Locator, target: Locator) -> None:
    target.scroll_into_view_if_needed()
    start.scroll_into_view_if_needed()
    page.wait_for_function("new Promise(done => { const at = scrollY; setTimeout(() => done(at === scrollY), 150); })")
    begin, end = start.bounding_box(), target.bounding_box()
    assert begin is not None
    assert end is not None
    page.mouse.move(begin["x"] + 12, begin["y"] + 10)
    page.mouse.down()
    page.mouse.move(end["x"] + 40, end["y"] + 4, steps=15)
    page.mouse.up()


def test_items_are_dragged_into_an_order(page: Page) -> None:
    opened(page)
    items = card(page, "stages").locator("li")
    before = stages(page)
    drag(page, items.nth(3).locator("[data-grip]"), items.nth(0))
    assert stages(page) == [before[3], *before[:3], before[4]]
    assert [box.input_value() for box in card(page, "stages").locator("select").all()] == ["1", "2", "3", "4", "5"]
    expect(card(page, "stages").locator("[data-draft]")).to_have_text("not sent yet")


def test_partners_are_dragged_and_chosen(page: Page) -> None:
    opened(page)
    units = card(page, "units")
    for row, unit in enumerate(UNITS[:2]):
        drag(
            page,
            units.locator("[data-right]").filter(has_text=re.compile(rf"^\w\s*{unit}$")),
            units.locator(".pair").nth(row),
        )
    for row, unit in enumerate(UNITS[2:], 2):
        options = units.locator("select").nth(row).locator("option").all_inner_texts()
        units.locator("select").nth(row).select_option(
            next(option for option in options if option.endswith(f": {unit}"))
        )
    assert send(page, "units") == "correct"


def test_the_page_goes_on_while_a_partner_is_dragged_to_a_row_below_the_screen(page: Page) -> None:
    opened(page)
    page.set_viewport_size({"width": 390, "height": 420})
    units = card(page, "units")
    last, grip = units.locator(".pair").last, units.locator("[data-right] [data-grip]").first
    grip.evaluate("one => one.scrollIntoView({ block: 'center', behavior: 'instant' })")
    at = grip.bounding_box()
    assert at is not None
    assert page.evaluate("one => one.getBoundingClientRect().top > innerHeight", last.element_handle())
    page.mouse.move(at["x"] + 8, at["y"] + 8)
    page.mouse.down()
    page.mouse.move(at["x"] + 20, 400, steps=4)
    for _ in range(100):
        top = last.evaluate("one => one.getBoundingClientRect().top")
        if top < 280:
            break
        page.wait_for_timeout(50)
    page.mouse.move(at["x"] + 20, top + 20, steps=2)
    page.mouse.up()
    assert [box.input_value() != "" for box in units.locator("select").all()] == [False, False, False, True]


def test_a_formula_is_told_without_its_dollars(page: Page) -> None:
    opened(page)
    for row in range(4):
        card(page, "units").locator("select").nth(row).select_option(index=1)
    send(page, "units")
    expect(card(page, "units").locator("[data-said]")).to_contain_text('"stiffness k"')


def test_what_is_dropped_beside_the_rows_is_given_to_none(page: Page) -> None:
    opened(page)
    drag(page, card(page, "units").locator("[data-right]").first, card(page, "units").locator("h3"))
    assert [box.input_value() for box in card(page, "units").locator("select").all()] == [""] * 4


def fill(page: Page) -> None:
    """Answers all questions by their controls, partly wrong, without sending."""
    for box in (0, 1):
        card(page, "arrays").get_by_role("checkbox").nth(box).check()
    for row in range(4):
        card(page, "units").locator("select").nth(row).select_option(index=1)
    card(page, "cart").get_by_label("Angular").fill("158")
    card(page, "cart").get_by_label("Largest").fill("122.5")


def test_drafts_keep_every_part(page: Page) -> None:
    opened(page)
    fill(page)
    card(page, "stages").get_by_role("button", name="Move down").first.click()
    order = stages(page)
    opened(page)
    assert stages(page) == order
    assert [box.is_checked() for box in card(page, "arrays").get_by_role("checkbox").all()] == [True, True] + 3 * [
        False
    ]
    assert len({box.input_value() for box in card(page, "units").locator("select").all()} - {""}) == 1
    assert [box.input_value() for box in card(page, "cart").locator("input[type=text]").all()] == ["158", "122.5"]


def test_each_number_is_read_back_while_it_is_typed_and_the_wrong_one_is_marked(page: Page) -> None:
    opened(page)
    cart = card(page, "cart")
    trouble, angular, largest = (
        cart.locator("[data-trouble]"),
        cart.get_by_label("Angular"),
        cart.get_by_label("Largest"),
    )
    angular.fill("15.8")
    largest.fill("0.1225 s")
    expect(trouble).to_contain_text("ω: 15.8 rad/s; Largest stable timestep under Euler: 122.5 ms")
    largest.fill("5 kg")
    expect(trouble).to_contain_text('Euler: "kg" does not measure')
    expect(largest).to_have_attribute("aria-invalid", "true")
    expect(angular).not_to_have_attribute("aria-invalid", "true")
    cart.get_by_role("button", name="Send").click()
    expect(trouble).to_contain_text("No attempt was used.")
    expect(largest).to_be_focused()
    expect(largest).to_have_attribute("aria-invalid", "true")
    expect(angular).to_have_value("15.8")


def test_an_image_button_of_a_kind_hands_in_where_it_was_clicked(page: Page) -> None:
    opened(page)
    card(page, "cart").get_by_label("Angular").fill("15.8")
    picture = card(page, "cart").locator("input[type=image]")
    card(page, "cart").locator("fieldset").evaluate(
        """(fields) => fields.insertAdjacentHTML("afterbegin", `<input type="image" name="answer.at" alt="A picture"
             width="200" height="100" src="data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg'/>">`)"""
    )
    assert picture.evaluate("(one) => [one.clientWidth, one.clientHeight, one.offsetWidth]") == [200, 100, 200]
    with page.expect_request(lambda one: one.method == "POST") as sent:
        picture.click(position={"x": 50, "y": 30})
    assert "answer.at.x=50&answer.at.y=30" in (sent.value.post_data or "")
    expect(card(page, "cart").locator("[data-trouble]")).to_contain_text("No attempt was used.")


def test_without_javascript_every_kind_is_answered(site: Site, browser: Chromium) -> None:
    context = browser.new_context(base_url=site.origin, java_script_enabled=False)
    page = context.new_page()
    page.goto("/?quiz=parts")
    card(page, "arrays").get_by_role("button").click()
    expect(card(page, "arrays").locator("[data-trouble]")).to_contain_text("Choose at least one")
    expect(card(page, "arrays").locator("[data-trouble]")).to_be_in_viewport()
    for box in (0, 2, 3):
        card(page, "arrays").get_by_role("checkbox").nth(box).check()
    assert send(page, "arrays") == "correct"
    for stage in STAGES[:4]:
        card(page, "stages").get_by_label(f"Position of {stage}").select_option(str(STAGES.index(stage) + 1))
    card(page, "stages").get_by_role("button", name="Send").click()
    expect(card(page, "stages").locator("[data-trouble]")).to_contain_text("mj_Euler")
    assert page.url.endswith("#parts--stages-trouble")
    assert page.locator(":target").get_attribute("data-trouble") is not None
    expect(card(page, "stages").locator("[data-trouble]")).to_be_in_viewport()
    expect(card(page, "stages").get_by_label("Position of mj_Euler")).to_be_in_viewport()
    expect(card(page, "stages").get_by_label("Position of mj_fwdConstraint")).to_have_value("4")
    card(page, "stages").get_by_label("Position of mj_Euler").select_option("5")
    assert send(page, "stages") == "correct"
    assert stages(page) == STAGES
    for row in range(4):
        card(page, "units").locator("select").nth(row).select_option(index=1)
    assert send(page, "units") == "partial"
    card(page, "cart").get_by_label("Angular").fill("15.8")
    card(page, "cart").get_by_role("button").click()
    expect(card(page, "cart").locator("[data-trouble]")).to_contain_text("Largest stable timestep under Euler: type a")
    expect(card(page, "cart").locator("[data-trouble]")).to_be_in_viewport()
    expect(card(page, "cart").get_by_label("Angular")).to_have_value("15.8")
    card(page, "cart").get_by_label("Largest").fill("122.5 s")
    assert send(page, "cart") == "partial"
    expect(card(page, "cart").locator("[data-said]")).to_contain_text("your number would be right in milliseconds")
    context.close()


def test_answers_and_their_parts_are_accessible_and_fit_every_width(page: Page) -> None:
    opened(page)
    assert findings(page) == []
    fill(page)
    card(page, "stages").get_by_role("button", name="Move down").first.click()
    statuses = [send(page, question) for question in ("arrays", "stages", "units", "cart")]
    assert {*statuses} <= {"partial", "incorrect"}
    expect(card(page, "units").locator(".parts li")).to_have_count(4)
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert findings(page) == []
    for width in (1280, 640, 390, 320):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= width, width
    assert findings(page, contrast=False) == []


def test_the_script_is_small_and_loaded_only_where_something_is_dragged(page: Page) -> None:
    assert (STATIC / "arrange.js").stat().st_size < BYTES_MAX
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url.rsplit("/", 1)[1]))
    page.goto("/?quiz=plain", wait_until="networkidle")
    assert "page.js" in asked
    assert "arrange.js" not in asked
    opened(page)
    assert "arrange.js" in asked


def answers_of(site: Site) -> dict[str, Any]:
    """Right answers by question, as the API takes them."""
    quiz = site.app.state.services.content.get(site.course or "default").library.quiz("parts")
    views = {question.id: question_view(question) for question in quiz.questions}
    stage = {item["text"][len("<code>") :].split("</code>")[0]: item["id"] for item in views["stages"]["items"]}
    unit = {right["text"]: right["id"] for right in views["units"]["right"]}
    return {
        "arrays": [0, 2, 3],
        "stages": [stage[name] for name in STAGES],
        "units": {str(row): unit[text] for row, text in enumerate(UNITS, 1)},
        "cart": {"w": "15.8", "h": "122.5"},
    }


@pytest.mark.slow
def test_statistics_and_stories_tell_the_parts_of_answers(site: Site) -> None:
    tina, right = site.client("tina", "instructor"), answers_of(site)
    wrong = {
        "arrays": [0, 1],
        "stages": [right["stages"][1], right["stages"][0], *right["stages"][2:]],
        "units": {**right["units"], "1": right["units"]["2"]},
        "cart": {"w": "15.8", "h": "245"},
    }
    before = {one["question"]: one for one in tina.get(f"{API}/quizzes/parts/statistics").json()["questions"]}
    for user, given in (("ida", right), ("jon", wrong), ("kim", {**wrong, "cart": {"w": "2", "h": "245.5"}})):
        client = site.client(user)
        for question, answer in given.items():
            body = {"quiz": "parts", "question": question, "answer": answer}
            assert client.post(f"{API}/answers:validate", json=body).json()["valid"]
            assert client.post(f"{API}/submissions", json=body).status_code == 201
    by_question = {one["question"]: one for one in tina.get(f"{API}/quizzes/parts/statistics").json()["questions"]}

    def counted(question: str) -> dict[int, int]:
        """Who chose each option since."""
        old = {one["option"]: one["learners"] for one in before.get(question, {}).get("options", ())}
        return {one["option"]: one["learners"] - old.get(one["option"], 0) for one in by_question[question]["options"]}

    assert {option: n for option, n in counted("arrays").items() if n} == {0: 3, 1: 2, 2: 1, 3: 1}
    assert sum(counted("stages").values()) == 3 * 4
    assert sum(counted("units").values()) == 3 * 4
    limits = [cluster for cluster in by_question["cart"]["clusters"] if 245 <= cluster["value"] <= 246]
    assert [(limit["number"], limit["learners"]) for limit in limits] == [(1, 2)]
    with site.app.state.services.database.write() as session:
        code = create_sign_in_code(session, "tina", "instructor", site.course)
        tina.cookies.set(COOKIE, redeem_sign_in_code(session, code).secret)
    shown = html.unescape(tina.get("/instructor/statistics?quiz=parts").text)
    assert "mj_fwdVelocity: passive forces and bias, then mj_fwdPosition: kinematics and contacts" in shown
    assert "damping: kg m²" in shown
    assert "Largest stable timestep under Euler: 245.2" in shown.replace("\u202f", " ")
    feed = site.client("lms", "service").get(f"{API}/results?limit=100").json()["items"]
    rows = {row["question"]: row for row in feed if row["user"] == "jon"}
    points = {question: row["points"] for question, row in rows.items()}
    assert points == pytest.approx({"arrays": 0, "stages": 2, "units": 3, "cart": 1})
    story = html.unescape(tina.get(f"/instructor/learners/{rows['cart']['member']}").text)
    for text in (
        "qacc, the accelerations; qpos, the positions",
        "1. mj_fwdVelocity: passive forces and bias; 2. ",
        "damping: kg m²; armature: kg m²; ",
        "Angular frequency without damping ω: 15.8; Largest",
    ):
        assert text in story
