"""The film of a verdict in a real browser: it plays, pauses, and needs neither motion nor scripts."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, Locator, Page, expect

from grader.settings import Settings
from web.browsing import Chromium, findings, service

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.jail]

expect.set_options(timeout=30_000)

REFERENCES = Path(__file__).parents[2] / "reference_solutions"
SERVO, STEP = "/quizzes/1.3-exercises/servo-threshold", "/quizzes/1.3-exercises/rk4-step"
CART = "/quizzes/3.1-exercises/cart-pole"
SCRIPTS = {
    SERVO: "incorrect__returns_the_bound.py",
    STEP: "incorrect__stages_half_as_far.py",
    CART: "partial__forgets_the_cart.py",
}
LATER = "at => parseFloat(document.querySelector('[data-film] [data-clock]').textContent) > at"
PICTURE = "canvas => canvas.toDataURL()"


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    settings = Settings(data=tmp_path_factory.mktemp("data"), content=REFERENCES.parent, workers=1)
    with service(settings) as origin:
        yield origin


@pytest.fixture(scope="module")
def state(origin: str, browser: Chromium) -> Any:
    """The cookies of a learner who has handed in a wrong script at each exercise."""
    context = browser.new_context(base_url=origin)
    page = context.new_page()
    for path, name in SCRIPTS.items():
        page.goto(path)
        page.locator(".code-editor").wait_for()  # as it opens, Chromium would style what is put over a selection
        source = (REFERENCES / path.removeprefix("/quizzes/") / name).read_text(encoding="utf-8")
        page.locator("textarea.code").fill(source)
        page.get_by_role("button", name="Run and judge").click()
        expect(page.locator("#result .verdict")).to_be_visible()
    stored = context.storage_state()
    context.close()
    return stored


def open_page(browser: Chromium, origin: str, state: Any, **options: Any) -> tuple[BrowserContext, Page, list[str]]:
    """A tab of this learner, and what its console complains of."""
    context = browser.new_context(base_url=origin, storage_state=state, **options)
    page, complaints = context.new_page(), list[str]()
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    return context, page, complaints


def film_of(page: Page, path: str) -> Locator:
    """The film of the newest verdict, on the screen and ready."""
    page.goto(path)
    film = page.locator("[data-film]")
    film.scroll_into_view_if_needed()
    page.mouse.move(5, 5)
    page.mouse.move(9, 9)
    expect(film.get_by_role("button", name=re.compile("Play|Pause"))).to_be_enabled()
    expect(film.locator("canvas").first).to_be_visible()
    return film


def seconds(film: Locator) -> float:
    return float(film.locator("[data-clock]").inner_text().removesuffix(" s"))


def test_what_a_controller_did_plays_case_by_case(browser: Chromium, origin: str, state: Any) -> None:
    context, page, complaints = open_page(browser, origin, state)
    film = film_of(page, CART)
    choice = film.get_by_label("show")
    cases = ["A pole that leans by 0.1 rad", "A cart away from home"]
    assert choice.locator("option").all_inner_texts() == cases
    film.locator(".runs").scroll_into_view_if_needed()
    page.wait_for_function(LATER, arg=0.2)
    choice.select_option(cases[1])
    expect(film.locator("[data-message]")).to_have_text(f"{cases[1]}: simulated to its end.")
    film.get_by_label("Time in the runs").fill("0")
    expect(film.locator(".run")).to_contain_text("0.4 m")  # where the cart begins
    assert complaints == []
    context.close()


def test_a_film_waits_until_a_pointer_has_moved(browser: Chromium, origin: str, state: Any) -> None:
    context, page, complaints = open_page(browser, origin, state)
    asked = list[str]()
    page.on("request", lambda request: asked.append(request.url))
    page.goto(SERVO, wait_until="networkidle")
    page.locator("[data-film]").scroll_into_view_if_needed()
    page.evaluate("dispatchEvent(new PointerEvent('pointermove'))")  # as a browser reports a pointer that rests
    page.wait_for_load_state("networkidle")
    page.wait_for_timeout(300)
    assert not any("/films" in url for url in asked)
    with page.expect_request(re.compile("/films")):
        page.evaluate("dispatchEvent(new PointerEvent('pointermove', { movementX: 1 }))")
    assert complaints == []
    context.close()


def test_three_runs_play_on_one_clock_and_pause(browser: Chromium, origin: str, state: Any) -> None:
    context, page, complaints = open_page(browser, origin, state)
    film = film_of(page, SERVO)
    assert film.locator(".run b").all_inner_texts() == ["Euler", "implicitfast", "discrete"]
    film.locator(".runs").scroll_into_view_if_needed()
    expect(film.get_by_role("button", name="Pause")).to_be_visible()  # it plays by itself once it is seen
    before = film.locator("canvas").first.evaluate(PICTURE)
    page.wait_for_function("before => document.querySelector('.run canvas').toDataURL() !== before", arg=before)
    film.get_by_role("button", name="Pause").click()
    at = seconds(film)
    assert at > 0
    page.wait_for_timeout(200)
    assert seconds(film) == at
    film.get_by_role("button", name="Play").click()
    page.wait_for_function(LATER, arg=at)
    assert complaints == []
    context.close()


def test_the_slider_moves_all_runs_and_the_end_says_what_ended_one(browser: Chromium, origin: str, state: Any) -> None:
    context, page, _ = open_page(browser, origin, state, reduced_motion="reduce")
    film = film_of(page, SERVO)
    slider = film.get_by_label("Time in the runs")
    start = [canvas.evaluate(PICTURE) for canvas in film.locator("canvas").all()]
    slider.focus()
    page.keyboard.press("End")
    expect(film.locator("[data-clock]")).to_have_text(re.compile(r"0\.67\d s"))
    expect(film.locator(".run.Euler .says")).to_have_text(re.compile("BADQACC at 0.421 s"))
    expect(film.locator(".run.implicitfast .says")).to_contain_text("rad")
    assert all(canvas.evaluate(PICTURE) != one for canvas, one in zip(film.locator("canvas").all(), start, strict=True))
    film.get_by_label("show").select_option("upper-end")
    expect(film.locator(".run .meta").first).to_have_text("22.57 ms")
    expect(film.locator("[data-message]")).to_contain_text("Euler, 22.57 ms: BADQACC at 0.384 s; implicitfast")
    context.close()


def test_with_reduced_motion_it_stands_until_it_is_played_by_key(browser: Chromium, origin: str, state: Any) -> None:
    context, page, _ = open_page(browser, origin, state, reduced_motion="reduce")
    film = film_of(page, STEP)
    page.wait_for_timeout(400)
    assert seconds(film) == 0
    film.get_by_role("button", name="Play").focus()
    page.keyboard.press("Enter")
    page.wait_for_function(LATER, arg=0)
    context.close()


def test_a_step_moves_beside_the_right_one_with_their_distance(browser: Chromium, origin: str, state: Any) -> None:
    context, page, complaints = open_page(browser, origin, state, reduced_motion="reduce")
    film = film_of(page, STEP)
    assert film.locator(".run b").all_inner_texts() == ["Your step", "MuJoCo's RK4"]
    strip = film.locator(".strips")
    expect(strip.locator("path.line")).to_have_count(1)
    box = strip.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + box["height"] / 2)
    assert 0.4 < seconds(film) < 0.7
    first, second = film.locator("canvas").all()
    assert first.evaluate(PICTURE) != second.evaluate(PICTURE)
    assert complaints == []
    context.close()


def test_without_scripts_the_still_pictures_stand_alone(browser: Chromium, origin: str, state: Any) -> None:
    context, page, _ = open_page(browser, origin, state, java_script_enabled=False)
    page.goto(SERVO)
    expect(page.locator("[data-film]")).to_be_hidden()
    expect(page.locator("figure svg.wide-plot").first).to_be_visible()
    page.goto(STEP)
    expect(page.locator("[data-film]")).to_be_hidden()
    expect(page.locator(".marked .hot mark").first).to_be_visible()
    expect(page.locator(".marked .margin")).to_contain_text("Move by h/2 k1, h/2 k2 and h k3.")
    folded = page.locator(".marked details").first
    expect(folded.locator("pre")).to_be_hidden()
    folded.locator("summary").click()
    expect(folded.locator("pre")).to_be_visible()
    context.close()


@pytest.mark.parametrize("path", [SERVO, STEP])
def test_a_film_is_accessible_changes_no_size_and_fits_a_phone(
    browser: Chromium, origin: str, state: Any, path: str
) -> None:
    size = {"width": 390, "height": 844}
    context, page, _ = open_page(browser, origin, state, reduced_motion="reduce", viewport=size)
    page.goto(path)
    before = page.locator("[data-film] .runs").bounding_box()
    film = film_of(page, path)
    after = film.locator(".runs").bounding_box()
    assert before is not None
    assert after is not None
    assert (before["width"], before["height"]) == (after["width"], after["height"])
    play, canvas = film.get_by_label("Time in the runs").bounding_box(), film.locator("canvas").first.bounding_box()
    assert play is not None
    assert canvas is not None
    assert play["y"] + play["height"] - canvas["y"] < size["height"] * 3 / 4  # both are on one screen
    assert findings(page) == []
    page.set_viewport_size({"width": 320, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 320
    context.close()


def test_nothing_of_a_film_is_fetched_with_the_page(browser: Chromium, origin: str, state: Any) -> None:
    context, page, _ = open_page(browser, origin, state, viewport={"width": 1280, "height": 800})
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url.rsplit("/", 1)[1]))
    page.goto(SERVO, wait_until="networkidle")
    assert not {"film.js", "film.css", "scene.js", "films"} & {*asked}
    film_of(page, SERVO)
    assert {"film.js", "film.css", "scene.js", "films"} <= {*asked}
    context.close()


def test_a_claim_is_dragged_along_its_axis_once_the_limits_are_shown(browser: Chromium, origin: str) -> None:
    context, page, complaints = open_page(browser, origin, None, reduced_motion="reduce")
    page.goto(SERVO)
    page.locator(".code-editor").wait_for()  # as it opens, Chromium would style what is put over a selection
    source = (REFERENCES / "1.3-exercises/servo-threshold/correct__spectral_radius.py").read_text(encoding="utf-8")
    page.locator("textarea.code").fill(source)
    page.get_by_role("button", name="Run and judge").click()
    expect(page.locator("#result .verdict")).to_be_visible()
    film = film_of(page, SERVO)
    expect(film.locator(".drag")).to_contain_text(
        re.compile("Limits: Euler 19.98.ms, implicitfast 24.97.ms, discrete none")
    )
    slider = film.get_by_label("Timestep (ms)")
    slider.focus()
    page.keyboard.press("End")
    expect(film.locator(".run .meta")).to_have_text(["50 ms"] * 3)
    expect(film.locator("[data-message]")).to_contain_text("discrete, 50 ms: no warning")
    page.keyboard.press("Home")
    expect(film.locator(".run .meta")).to_have_text(["1 ms"] * 3)
    expect(film.locator("[data-message]")).to_contain_text("Euler, 1 ms: no warning")
    assert complaints == []
    context.close()


def test_before_the_limits_are_shown_nothing_is_dragged(browser: Chromium, origin: str, state: Any) -> None:
    context, page, _ = open_page(browser, origin, state)
    expect(film_of(page, SERVO).locator("[data-timestep]")).to_have_count(0)
    context.close()
