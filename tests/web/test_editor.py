"""The editor of scripts writes, indents, searches and shows the diagnosis, over a textarea that knows nothing of it."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Locator, Page, Response, Route, expect

from web.browsing import Chromium, findings, service, settings_in

REFERENCES = Path(__file__).parents[2] / "reference_solutions" / "1.3-exercises"
STEP = "/quizzes/1.3-exercises/rk4-step"
BYTES_MAX = 130_000
expect.set_options(timeout=30_000)

LINK = "line => { const a = document.createElement('a'); a.dataset.goTo = line; document.body.append(a); a.click(); }"
"""Clicks a link to a line, as sentences of a verdict have them."""

CAME_LATER = """() => performance.getEntriesByType('resource').find((one) => /editor\\.js/.test(one.name)).startTime
  >= performance.getEntriesByName('first-contentful-paint')[0].startTime"""

PUT_BACK = """async () => { const turn = () => new Promise((go) => setTimeout(go, 50));
  const marked = document.querySelector('#result .marked'), home = marked.parentNode;
  marked.remove(); await turn(); home.append(marked); await turn(); }"""
"""The result of an older attempt comes back, as after a script that was stopped."""


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with service(settings_in(tmp_path_factory.mktemp("data"))) as origin:
        yield origin


@pytest.fixture
def context(origin: str, browser: Chromium) -> Iterator[BrowserContext]:
    context = browser.new_context(base_url=origin, viewport={"width": 1280, "height": 800})
    yield context
    context.close()


@pytest.fixture
def page(context: BrowserContext) -> Page:
    page = context.new_page()
    page.goto(STEP)
    return page


def editor_of(page: Page) -> Locator:
    editor = page.get_by_role("textbox", name="rk4_step.py, code")
    expect(editor).to_be_visible()
    return editor


def clear(page: Page) -> None:
    editor_of(page).focus()
    page.keyboard.press("Control+a")
    page.keyboard.press("Delete")


def test_what_is_typed_is_indented_and_stays_in_the_form(page: Page) -> None:
    clear(page)
    page.keyboard.type("def f(x):\nif x:\nreturn 1")
    code = page.locator("textarea.code")
    expect(code).to_have_value("def f(x):\n    if x:\n        return 1")
    page.keyboard.press("Control+/")
    expect(code).to_have_value("def f(x):\n    if x:\n        # return 1")
    page.keyboard.press("Control+/")
    expect(code).to_have_value("def f(x):\n    if x:\n        return 1")
    expect(page.locator("[data-draft]")).to_have_text("not sent yet")
    page.reload()
    expect(editor_of(page)).to_contain_text("return 1")
    expect(page.locator("textarea.code")).to_have_value("def f(x):\n    if x:\n        return 1")


def test_it_takes_over_what_is_selected(context: BrowserContext) -> None:
    """A learner who has selected all, and pastes just as it comes, replaces all."""
    page, held = context.new_page(), list[Route]()

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/editor.js", hold)
    with page.expect_request("**/editor.js"):
        page.goto(STEP)
    code = page.locator("textarea.code")
    code.focus()
    page.keyboard.press("Control+a")
    for route in held:
        route.continue_()
    editor_of(page)
    page.keyboard.insert_text("x = 1\n")
    expect(code).to_have_value("x = 1\n")


def test_tab_indents_and_after_escape_it_leaves(page: Page) -> None:
    clear(page)
    page.keyboard.type("x = 1")
    page.keyboard.press("Tab")
    expect(page.locator("textarea.code")).to_have_value("    x = 1")
    page.keyboard.press("Shift+Tab")
    expect(page.locator("textarea.code")).to_have_value("x = 1")
    expect(page.get_by_text("Escape, then Tab, leaves the code")).to_be_visible()
    assert "Escape" in (editor_of(page).get_attribute("aria-description") or "")
    page.keyboard.press("Escape")
    page.keyboard.press("Tab")
    expect(page.get_by_role("button", name="Run and judge")).to_be_focused()
    expect(page.locator("textarea.code")).to_have_value("x = 1")


def test_a_search_is_no_draft(page: Page) -> None:
    editor_of(page).focus()
    page.keyboard.press("Control+f")
    page.keyboard.type("def")
    expect(page.get_by_placeholder("Find")).to_have_value("def")
    expect(page.locator("[data-draft]")).to_have_text("")
    page.keyboard.press("Escape")
    expect(page.get_by_placeholder("Find")).to_have_count(0)
    expect(editor_of(page)).to_be_focused()


def test_the_diagnosis_stands_under_its_line_and_a_link_leads_there(page: Page) -> None:
    editor = editor_of(page)
    source = (REFERENCES / "rk4-step" / "incorrect__k4_left_out.py").read_text()
    page.locator("textarea.code").fill(source)
    expect(editor).to_contain_text("def rk4_step")
    editor.focus()
    page.keyboard.press("Control+Enter")
    said = page.locator(".cm-said")
    expect(said).to_be_visible(timeout=30_000)
    hot = page.locator("#result .marked .hot").first
    line = hot.get_attribute("data-line")
    expect(page.locator(".cm-line.cm-faulty")).to_have_text(source.splitlines()[int(line or 0) - 1])
    expect(page.locator("#result .marked .margin")).to_contain_text(said.inner_text())
    page.keyboard.press("Control+Home")
    page.evaluate(LINK, line)
    page.keyboard.press("End")
    page.keyboard.type("#")
    expect(said).to_be_visible()
    changed = page.locator("textarea.code").input_value().splitlines()
    assert changed[int(line or 0) - 1].endswith("#")
    assert findings(page) == []
    page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    page.reload()
    editor_of(page).focus()
    assert findings(page) == []
    page.locator("textarea.code").fill(f"# Another script.\n{source}")
    page.evaluate(PUT_BACK)
    expect(said).to_have_count(0)


def test_it_comes_after_the_page_on_exercises_alone(context: BrowserContext) -> None:
    page, sizes, said = context.new_page(), dict[str, int](), list[str]()

    def note(response: Response) -> None:
        if re.search(r"/editor\.js|/vendor/", response.url):
            sizes[response.url] = response.request.sizes()["responseBodySize"]

    page.on("requestfinished", lambda request: note(response) if (response := request.response()) else None)
    page.on("console", lambda message: said.append(message.text))
    page.goto("/?quiz=1.3-check", wait_until="networkidle")
    assert sizes == {}
    page.goto(STEP)
    editor_of(page)
    page.wait_for_load_state("networkidle")
    assert len(sizes) == 2 and sum(sizes.values()) <= BYTES_MAX, sizes
    assert page.evaluate(CAME_LATER)
    assert said == []


def test_nothing_moves_when_it_comes(context: BrowserContext) -> None:
    page = context.new_page()
    page.route("**/editor.js", lambda route: route.abort())
    page.goto(STEP, wait_until="networkidle")
    before = page.locator(".code-box").bounding_box()
    page.unroute("**/editor.js")
    page.reload()
    editor_of(page)
    assert page.locator(".code-box").bounding_box() == before


def test_without_it_the_textarea_is_what_it_was(context: BrowserContext) -> None:
    page = context.new_page()
    page.route("**/vendor/*", lambda route: route.fulfill(content_type="text/javascript", body=""))
    page.goto(STEP, wait_until="networkidle")
    code = page.get_by_label("rk4_step.py")
    code.fill("if x:\n    y")
    expect(page.locator("[data-gutter]")).to_have_text("1\n2", use_inner_text=True)
    code.press("Control+Enter")
    expect(page.locator("#attempts .chip")).to_have_count(1)
