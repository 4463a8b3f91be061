"""Every page of a learner in every state: axe-core finds nothing, nothing scrolls sideways, budgets are kept."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, Page, Response, expect

from web.browsing import Chromium, findings, service, settings_in

REFERENCES = Path(__file__).parents[2] / "reference_solutions" / "1.3-exercises"
PATIENCE_MS = 30_000
expect.set_options(timeout=PATIENCE_MS)

SERVO, STEP = "/quizzes/1.3-exercises/servo-threshold", "/quizzes/1.3-exercises/rk4-step"
HOSTILE = "<img src=x onerror=alert(1)> " + "unbrokenword" * 60

LATER = re.compile(r"/editor\.js$|/vendor/")
"""What comes after the first paint, with a budget of its own: tests/web/test_editor.py."""

BYTES_MAX, REQUESTS_MAX, SHIFT_MAX = 60_000, 8, 0.05

SHIFTS = """() => { window.shifts = 0; new PerformanceObserver(list => { for (const one of list.getEntries())
  if (!one.hadRecentInput) window.shifts += one.value; }).observe({ type: 'layout-shift', buffered: true }); }"""


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with service(settings_in(tmp_path_factory.mktemp("data"))) as origin:
        yield origin


@pytest.fixture(scope="module")
def learner(origin: str, browser: Chromium) -> Iterator[BrowserContext]:
    """A learner who has answered everything: right, wrong, crashed, waiting, in review; with hostile text."""
    size = {"width": 1280, "height": 800}
    context = browser.new_context(base_url=origin, viewport=size, reduced_motion="reduce")
    page = context.new_page()
    page.goto("/")
    answer(page, "q1", lambda card: card.get_by_label("Position stage").check())
    answer(page, "q2", lambda card: card.get_by_label("Your answer").fill("7 ms"))
    answer(page, "q3", lambda card: card.get_by_label("implicitfast").check())
    answer(page, "q4", lambda card: card.get_by_role("textbox").fill(HOSTILE))
    hand_in(page, STEP, "incorrect__stage_three_from_the_first_slope.py")
    hand_in(page, SERVO, "crashed__no_such_function.py")
    hand_in(page, SERVO, "incorrect__forgets_kv.py")
    hand_in(page, SERVO, "correct__spectral_radius.py")
    page.close()
    yield context
    context.close()


def answer(page: Page, question: str, choose: Callable[[Any], None]) -> None:
    """Answers one question of the knowledge check."""
    card = page.locator(f'[id="1.3-check--{question}"]')
    choose(card)
    card.get_by_role("button", name="Send").click()
    expect(card.locator("[data-said]")).to_be_visible()


def hand_in(page: Page, path: str, name: str) -> None:
    """Hands in a script, and waits for its verdict."""
    page.goto(path)
    before = page.locator("#attempts .chip").count()
    source = (REFERENCES / path.rsplit("/", 1)[1] / name).read_text(encoding="utf-8")
    page.locator("textarea.code").fill(f"print({HOSTILE!r})\n{source}")
    page.get_by_role("button", name="Run and judge").click()
    expect(page.locator("#attempts .chip")).to_have_count(before + 1)
    expect(page.locator("#under-way[data-events]")).to_have_count(0)


def unreadable(page: Page) -> None:
    """An answer that was refused beside its field."""
    card = page.locator('[id="1.3-check--q2"]')
    card.get_by_label("Your answer").fill("5 kg")
    card.get_by_role("button").click()
    expect(card.locator("[data-trouble].bad")).to_contain_text("No attempt")


def unfolded(page: Page) -> None:
    """Everything that can be opened is open."""
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")


def running(page: Page) -> None:
    """A script under way."""
    page.locator("textarea.code").fill("import time\ntime.sleep(6)\n")
    page.get_by_role("button", name="Run and judge").click()
    expect(page.locator("#under-way .steps")).to_be_visible()


def ask_for_access(page: Page) -> None:
    """A program asks for a token, and its owner opens the address that it shows."""
    body = {"method": "POST", "body": '{"client_name": "A laptop"}', "headers": {"Content-Type": "application/json"}}
    begun = page.evaluate("body => fetch('/api/v1/devices', body).then(response => response.json())", body)
    page.goto(begun["verification_uri_complete"])
    expect(page.get_by_role("button", name="Allow")).to_be_visible()


STATES: dict[str, tuple[str, Callable[[Page], None] | None]] = {
    "lesson": ("/", None),
    "lesson, unfolded": ("/", unfolded),
    "lesson, unreadable answer": ("/", unreadable),
    "one quiz": ("/?quiz=1.3-check", None),
    "exercise, right": (SERVO, unfolded),
    "exercise, crashed": (f"{SERVO}?attempt=3", unfolded),
    "exercise, wrong": (f"{SERVO}?attempt=2", unfolded),
    "exercise, wrong step": (STEP, unfolded),
    "exercise, untouched": ("/quizzes/1.3-exercises/rk4-free-joint", None),
    "two attempts": (f"{SERVO}/attempts", None),
    "exercise, running": ("/quizzes/1.3-exercises/rk4-free-joint", running),
    "not there": ("/nowhere", None),
    "for instructors": ("/instructor", None),
    "expired link": ("/signin?code=gri_0_0", None),
    "sign out": ("/signout", None),
    "devices": ("/devices", None),
    "a device that asks for access": ("/devices", ask_for_access),
}


def open_state(page: Page, state: str) -> None:
    """Opens a page in a state; an attempt is named by its place in the list."""
    path, act = STATES[state]
    address, _, place = path.partition("?attempt=")
    page.goto(address)
    if place:
        page.locator("#attempts .chip").nth(int(place) - 1).click()
        expect(page.locator("#attempts [aria-current]")).to_be_visible()
    if act is not None:
        act(page)


@pytest.fixture(scope="module")
def page(learner: BrowserContext) -> Iterator[Page]:
    """One tab for all states."""
    page = learner.new_page()
    yield page
    page.close()


@pytest.mark.parametrize("state", STATES)
def test_a_state_of_a_page_is_accessible_and_fits_every_width(page: Page, state: str) -> None:
    page.set_viewport_size({"width": 1280, "height": 800})
    open_state(page, state)
    page.emulate_media(color_scheme="light")
    assert findings(page) == []
    for width in (1280, 640, 390, 320):  # 640 is 1280 at 200 %
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width, width
    page.emulate_media(color_scheme="dark")
    assert findings(page) == []


def test_every_page_has_one_heading_of_the_first_level_and_a_name(page: Page) -> None:
    for state in ("lesson", "exercise, right", "two attempts", "not there", "sign out"):
        open_state(page, state)
        assert page.locator("h1").count() == 1
        assert page.title()


def test_nothing_that_a_learner_typed_or_printed_is_markup(page: Page) -> None:
    for state in ("lesson", "exercise, right", "two attempts"):
        open_state(page, state)
        assert page.locator("img[src=x]").count() == 0


def test_an_exercise_is_done_with_the_keyboard_alone(learner: BrowserContext) -> None:
    page = learner.new_page()
    page.goto("/quizzes/1.3-exercises/rk4-step")
    page.locator(".code-editor").wait_for()
    page.keyboard.press("Tab")
    expect(page.get_by_role("link", name="Skip to the content")).to_be_focused()
    page.keyboard.press("Enter")
    for _ in range(12):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.className") == "code-editor":
            break
    expect(page.get_by_role("textbox", name="code")).to_be_focused()
    page.keyboard.press("Control+A")
    page.keyboard.type("def rk4_step(model, data): pass")
    before = page.locator("#attempts .chip").count()
    page.keyboard.press("Escape")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(page.locator("#attempts .chip")).to_have_count(before + 1)
    expect(page.locator("#under-way[data-events]")).to_have_count(0)
    page.close()


def test_with_reduced_motion_nothing_moves_by_itself(page: Page) -> None:
    page.emulate_media(reduced_motion="reduce")
    open_state(page, "exercise, right")
    assert page.evaluate("document.getAnimations().length") == 0
    assert page.evaluate("getComputedStyle(document.documentElement).scrollBehavior") == "auto"
    page.emulate_media(reduced_motion="no-preference")


@pytest.mark.parametrize("path", ["/", SERVO, STEP])
def test_a_first_load_keeps_its_budget(learner: BrowserContext, browser: Chromium, origin: str, path: str) -> None:
    context = browser.new_context(
        base_url=origin, storage_state=learner.storage_state(), viewport={"width": 1280, "height": 800}
    )
    page, responses, blocked = context.new_page(), dict[str, Response](), list[str]()
    page.on("response", lambda response: responses.update({response.url: response}))
    page.on("console", lambda message: blocked.append(message.text))
    page.goto(path, wait_until="networkidle")
    sizes = {url: one.request.sizes()["responseBodySize"] for url, one in responses.items() if not LATER.search(url)}
    assert len(sizes) <= REQUESTS_MAX, sizes
    assert sum(sizes.values()) <= BYTES_MAX, sizes
    assert blocked == []
    assert all(url.startswith(origin) for url in sizes)
    policy = responses[origin + path].headers["content-security-policy"]
    assert "unsafe" not in policy
    assert "default-src 'none'" in policy
    context.close()


def test_only_the_page_itself_is_asked_for_again(learner: BrowserContext) -> None:
    page = learner.new_page()
    page.goto("/", wait_until="networkidle")
    page.goto(SERVO, wait_until="networkidle")
    sizes = page.evaluate(
        "Object.fromEntries(performance.getEntriesByType('resource').map(one => [one.name, one.transferSize]))"
    )
    assert {url: size for url, size in sizes.items() if size and "/static/" in url} == {}
    page.close()


def test_nothing_moves_while_a_page_loads_and_verdicts_arrive(browser: Chromium, origin: str) -> None:
    context = browser.new_context(base_url=origin, viewport={"width": 1280, "height": 800})
    context.add_init_script(f"({SHIFTS})()")
    page = context.new_page()
    page.goto("/", wait_until="networkidle")
    answer(page, "q1", lambda card: card.get_by_label("Position stage").check())
    page.wait_for_timeout(300)
    assert page.evaluate("window.shifts") <= SHIFT_MAX
    hand_in(page, SERVO, "incorrect__forgets_kv.py")
    page.wait_for_timeout(300)
    assert page.evaluate("window.shifts") <= SHIFT_MAX
    page.goto("/", wait_until="networkidle")
    assert page.evaluate("window.shifts") <= SHIFT_MAX
    context.close()


def test_without_javascript_an_exercise_is_handed_in_and_judged(browser: Chromium, origin: str) -> None:
    context = browser.new_context(base_url=origin, java_script_enabled=False)
    page = context.new_page()
    page.goto(SERVO)
    expect(page.get_by_text("load a file")).to_be_hidden()
    width = "element => element.getBoundingClientRect().width"
    assert page.locator("textarea.code").evaluate(width) > 0.9 * page.locator(".editor").evaluate(width)
    page.locator("textarea.code").fill("def largest_stable_timestep(model, integrator):\n    return 0.02, 0.0204\n")
    page.get_by_role("button", name="Run and judge").click()
    expect(page.locator("#result [data-status]")).to_have_text(re.compile("correct"))
    page.get_by_text("As a table").first.click()
    expect(page.get_by_role("cell", name="stable").first).to_be_visible()
    context.close()


def test_on_a_phone_a_link_leads_from_the_verdict_to_the_task(page: Page) -> None:
    link = page.get_by_role("link", name="Read the task")
    open_state(page, "exercise, right")
    page.set_viewport_size({"width": 390, "height": 800})
    link.click()
    expect(page.locator("#task")).to_be_in_viewport()
    page.set_viewport_size({"width": 1280, "height": 800})
    expect(link).to_be_hidden()
