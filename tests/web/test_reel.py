"""A reel of attempts: for the learner and in the learner's story; with a slider, and by links without scripts."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from playwright.sync_api import BrowserContext, Page, expect

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.gate.admission import PREFIX as API
from grader.service.accounts import in_database
from grader.settings import Settings
from grader.web.verdict.reel import compare_scripts
from support.sites import Site, open_site
from web.browsing import Chromium, findings

REFERENCES = Path(__file__).parents[2] / "reference_solutions/1.3-exercises/rk4-step"
SCRIPTS = ("incorrect__euler.py", "incorrect__stages_half_as_far.py", "correct__classical.py")
QUIZ, QUESTION = "1.3-exercises", "rk4-step"
PAGE = f"/quizzes/{QUIZ}/{QUESTION}"

expect.set_options(timeout=30_000)

lines = st.lists(st.sampled_from(["a", "b", "c", "", "    d"]), max_size=30)


@given(lines, lines)
def test_a_comparison_has_every_line_or_says_how_many_are_equal(before: list[str], after: list[str]) -> None:
    olds, news = "\n".join(before), "\n".join(after)
    changes = compare_scripts(olds, news)
    assert changes is not None
    if olds.splitlines() == news.splitlines():
        assert changes == []
        return
    kept: list[str] = []
    for change in changes:
        if change.kind == "skipped":
            kept += news.splitlines()[len(kept) : len(kept) + change.number]
        elif change.kind != "gone":
            assert change.number == len(kept) + 1
            kept.append(change.text)
    assert kept == news.splitlines()
    gone = [change for change in changes if change.kind == "gone"]
    assert all(olds.splitlines()[change.number - 1] == change.text for change in gone)


def test_long_scripts_are_not_compared() -> None:
    assert compare_scripts("x\n" * 1500, "y\n" * 1500) is None


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(Settings(data=tmp_path_factory.mktemp("data"), workers=1)) as site:
        yield site


def sign_in(
    site: Site, browser: Chromium, user: str, role: Role = Role.STUDENT, *, scripts: bool = True
) -> BrowserContext:
    """A browser of this user."""
    code = in_database(site.settings, lambda session: create_sign_in_code(session, user, role))
    context = browser.new_context(base_url=site.origin, java_script_enabled=scripts, reduced_motion="reduce")
    page = context.new_page()
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    page.close()
    return context


@pytest.fixture(scope="module")
def handed(site: Site) -> list[str]:
    """The ids of Ann's three attempts, in their order; they are graded."""
    ann, made = site.client("ann"), []
    for name in SCRIPTS:
        source = (REFERENCES / name).read_text(encoding="utf-8")
        body = {"quiz": QUIZ, "question": QUESTION, "answer": {"source": source}}
        location = ann.post(f"{API}/submissions", json=body).headers["location"]
        deadline = time.monotonic() + 120
        while ann.get(location).json()["status"] in ("queued", "running"):
            assert time.monotonic() < deadline
            time.sleep(0.1)
        made.append(location.rsplit("/", 1)[1])
    return made


def expect_attempt(page: Page, number: int) -> None:
    expect(page.locator(".reel-bar [role=status] b")).to_have_text(f"Attempt {number}")


@pytest.mark.slow
@pytest.mark.jail
@pytest.mark.browser
def test_the_slider_changes_script_verdict_and_plots_together(site: Site, browser: Chromium, handed: list[str]) -> None:
    context = sign_in(site, browser, "ann")
    page, complaints = context.new_page(), list[str]()
    page.on("console", lambda message: complaints.append(message.text))
    page.goto(PAGE)
    page.get_by_role("link", name="step through attempts").click()
    expect_attempt(page, 3)
    expect(page.locator(".changes .new").first).to_be_visible()
    slider = page.get_by_role("slider", name="Attempt")
    expect(slider).to_be_enabled()  # once the page's script runs
    slider.focus()
    page.keyboard.press("ArrowLeft")
    expect_attempt(page, 2)
    expect(page.locator(".diagnosis")).to_contain_text("lie 1/2 times as far")
    expect(page.get_by_role("heading", name="What changed since attempt 1")).to_be_visible()
    expect(page.locator("figure h2").first).to_contain_text("your error falls by a factor of 2")
    assert page.url.endswith(handed[1])
    expect(slider).to_be_focused()
    expect(slider).to_have_attribute("aria-valuetext", "attempt 2: Not correct")
    page.get_by_role("link", name="Previous").click()
    expect(page.locator(".diagnosis")).to_contain_text("semi-implicit Euler")
    expect(page.get_by_role("heading", name="The first script")).to_be_visible()
    expect(page.get_by_role("link", name="Previous")).to_have_count(0)
    page.reload()
    expect_attempt(page, 1)
    assert complaints == []
    context.close()


@pytest.mark.slow
@pytest.mark.jail
@pytest.mark.browser
def test_links_lead_through_the_attempts_without_scripts(site: Site, browser: Chromium, handed: list[str]) -> None:
    context = sign_in(site, browser, "ann", scripts=False)
    page = context.new_page()
    page.goto(f"{PAGE}/reel")
    expect(page.locator("[data-slider]")).to_be_hidden()
    for number in (2, 1):
        page.get_by_role("link", name="Previous").click()
        expect_attempt(page, number)
    page.get_by_role("link", name="Next").click()
    expect_attempt(page, 2)
    assert page.url.endswith(handed[1])
    context.close()


@pytest.mark.slow
@pytest.mark.jail
@pytest.mark.browser
def test_an_instructor_steps_through_from_the_story(site: Site, browser: Chromium, handed: list[str]) -> None:
    context = sign_in(site, browser, "tina", Role.INSTRUCTOR)
    page, complaints = context.new_page(), list[str]()
    page.on("console", lambda message: complaints.append(message.text))
    learner = site.client("ann").get(f"{API}/me").json()["id"]
    page.goto(f"/instructor/learners/{learner}")
    page.get_by_role("link", name="Step through the 3 attempts").click()
    expect_attempt(page, 3)
    page.get_by_role("link", name="Previous").click()
    expect(page.locator(".diagnosis")).to_contain_text("lie 1/2 times as far")
    expect(page.locator(".marked .hot mark").first).to_be_visible()
    page.locator("[data-film]").scroll_into_view_if_needed()
    expect(page.locator("[data-film] .run")).to_have_count(2)
    assert findings(page) == []
    for width in (1280, 390, 320):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width, width
    assert complaints == []
    context.close()


@pytest.mark.slow
@pytest.mark.jail
def test_nobody_sees_the_reel_of_another(site: Site, handed: list[str]) -> None:
    assert site.anonymous().get(f"{PAGE}/reel", headers={"Accept": "text/html"}).status_code in (401, 403)
    assert handed
