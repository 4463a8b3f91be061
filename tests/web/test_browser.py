"""Labs and the instructor's pages, in a real browser against the real service."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from playwright.sync_api import Locator, Page, expect

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.service.accounts import in_database
from grader.settings import Settings
from web.browsing import Chromium, chromium, service, settings_in

PATIENCE_MS = 30_000
"""A busy machine is slow, not wrong: how long anything on the page may take to appear."""

expect.set_options(timeout=PATIENCE_MS)

PAINTED = """canvas => canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data
  .filter((value, index) => index % 4 === 3 && value > 0).length"""
"""How many pixels of a canvas are not empty."""


@dataclass
class Site:
    """The running service and a browser."""

    origin: str
    settings: Settings
    browser: Chromium


@dataclass
class Visit:
    """One browser's tab, and whatever its console complained of."""

    page: Page
    complaints: list[str] = field(default_factory=list)

    def card(self, quiz: str, question: str) -> Locator:
        """One question."""
        return self.page.locator(f'[id="{quiz}--{question}"]')

    def status(self, quiz: str, question: str) -> Locator:
        """The verdict's status in words."""
        return self.card(quiz, question).locator("[data-status]")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    settings = settings_in(tmp_path_factory.mktemp("data"))
    with service(settings) as origin, chromium() as browser:
        yield Site(origin, settings, browser)


@pytest.fixture
def visit(site: Site) -> Iterator[Visit]:
    """A new learner, at the student page; the console must stay quiet."""
    context = site.browser.new_context(base_url=site.origin)
    visit = Visit(context.new_page())
    visit.page.on("console", lambda message: visit.complaints.append(message.text) if message.type != "log" else None)
    visit.page.on("pageerror", lambda error: visit.complaints.append(str(error)))
    visit.page.goto("/")
    yield visit
    context.close()
    assert visit.complaints == []


WRITTEN = {"0": "0", "-2.5": "−2.5", "1/3": "0.3333", "1e-11": "10⁻¹¹", "-2.5e7": "−2.5·10⁷", "1/0": "∞"}


def test_numbers_are_written_for_people(visit: Visit) -> None:
    values = ", ".join(WRITTEN)
    written = visit.page.evaluate(f"import('/static/dom.js').then(dom => [{values}].map(value => dom.number(value)))")
    assert written == list(WRITTEN.values())


def test_the_lab_of_a_prediction_opens_once_it_is_made(visit: Visit) -> None:
    card = visit.card("1.3-check", "q3")
    expect(card.locator("canvas")).to_have_count(0)
    card.get_by_label("implicitfast").check()
    card.get_by_role("button", name="Send").click()
    expect(card.get_by_text("MuJoCo warned BADQACC")).to_be_visible()
    card.get_by_label("integrator").select_option("discrete")
    expect(card.get_by_text("MuJoCo warned BADQACC")).to_have_count(0)
    assert card.locator("canvas").evaluate(PAINTED) > 100
    visit.page.reload()
    card.scroll_into_view_if_needed()
    expect(card.locator("canvas")).to_be_visible()


def test_the_lessons_own_labs_run(visit: Visit) -> None:
    servo, drift = visit.card("1.3-labs", "servo-stability"), visit.card("1.3-labs", "energy-drift")
    drift.scroll_into_view_if_needed()
    expect(drift.get_by_role("row", name="RK4")).to_contain_text("·10⁻⁵")
    expect(drift.get_by_role("row", name="implicitfast")).to_contain_text("none")
    drift.get_by_label("timestep").fill("1")
    drift.get_by_label("timestep").press("Enter")
    expect(drift.get_by_text("at a timestep of 1 ms")).to_be_visible()
    servo.scroll_into_view_if_needed()
    expect(servo.locator("svg.strips .line")).to_be_attached()
    for label, value in (("timestep h", "0.02"), ("stiffness kp", "40000")):
        servo.get_by_label(label, exact=True).fill(value)
        servo.get_by_label(label, exact=True).press("Enter")
    expect(servo.get_by_text("MuJoCo warned")).to_be_visible()


def test_the_instructor_page_lists_what_was_handed_in(site: Site) -> None:
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "teacher", Role.INSTRUCTOR))
    context = site.browser.new_context(base_url=site.origin)
    page = context.new_page()
    page.goto("/")
    page.locator('[id="1.3-check--q2"]').get_by_label("Your answer").fill("7 ms")
    page.locator('[id="1.3-check--q2"]').get_by_role("button", name="Send").click()
    expect(page.locator('[id="1.3-check--q2"] [data-status]')).to_have_text("Not correct")
    page.goto("/instructor")
    expect(page.locator("main")).to_contain_text("this page is for instructors")
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    page.goto("/instructor/content")
    expect(page.locator("main")).to_contain_text("1.3-check")
    page.get_by_role("link", name="Derive the answer keys again").click()
    expect(page.get_by_role("row").filter(has_text="1.3-check q2").filter(has_text="certified")).to_be_visible()
    page.goto("/instructor/review?which=submissions")
    row = page.get_by_role("row").filter(has_text="learner").filter(has_text="Not correct").first
    row.get_by_role("link").click()
    expect(page.locator("[data-one] pre").first).to_have_text("7 ms")
    context.close()


def test_an_instructor_reviews_an_open_answer_and_its_learner_sees_it(site: Site) -> None:
    learner, teacher = (site.browser.new_context(base_url=site.origin) for _ in range(2))
    page = learner.new_page()
    page.goto("/")
    card = page.locator('[id="1.3-check--q4"]')
    card.get_by_role("textbox").fill("I would halve the step until the answer stays.")
    card.get_by_role("button", name="Send").click()
    expect(card.locator("[data-status]")).to_contain_text("instructor")

    desk = teacher.new_page()
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "reader", Role.INSTRUCTOR))
    desk.goto(f"/signin?code={code}")
    desk.get_by_role("button", name="Sign in").click()

    desk.get_by_role("link", name="Review", exact=True).first.click()
    desk.locator("[name=which]").select_option("waiting for a review")
    desk.get_by_role("button", name="Show").click()
    expect(desk.locator("[data-submissions] tr").filter(has_text="Not correct")).to_have_count(0)
    rows = desk.locator("[data-submissions] tr").filter(has_text="Your RL environment")
    expect(rows.first).to_be_visible()
    waiting = rows.count()
    rows.last.get_by_role("button").click()
    expect(desk.locator("[data-one] pre").first).to_have_text("I would halve the step until the answer stays.")
    form = desk.get_by_role("form", name="Review")
    expect(form).to_contain_text("Yours until")
    form.get_by_label("Points").fill("0.5")
    form.get_by_role("textbox", name="Comment").fill("And what about stability?")
    form.get_by_role("button", name="Decide", exact=True).click()
    expect(desk.get_by_role("status").first).to_contain_text("Decided")
    desk.get_by_role("link", name="Review", exact=True).first.click()
    expect(rows).to_have_count(waiting - 1)

    page.reload()
    expect(card.locator("[data-status]")).to_have_text("Partly correct")
    expect(card).to_contain_text("And what about stability?")
    for context in (learner, teacher):
        context.close()
