"""The interactive page of the study, opened from its file: a point says what it is, by pointer and by keys."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from grader.studies.bench.published.interactive import collect_points, render_page
from grader.studies.bench.published.measured import load_results
from web.browsing import chromium

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "measured.html"
RESULTS = load_results(DOCS / "measured")


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    with chromium() as browser:
        context = browser.new_context(color_scheme="dark", offline=True)
        page = context.new_page()
        faults: list[str] = []
        page.on("pageerror", lambda fault: faults.append(str(fault)))
        page.goto(PAGE.as_uri())
        yield page
        assert not faults
        context.close()


def test_the_page_is_the_rendering_of_the_results_and_asks_for_nothing_else() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == render_page(RESULTS), "run: make measured-tables"
    assert not re.search(r"(?:src|@import|url)\s*[=(]|https?://(?!www\.w3\.org/2000/svg)", text)


def test_each_point_is_in_the_results() -> None:
    points = collect_points(RESULTS)
    quantities = RESULTS["quantities"]
    assert len(points) == sum(len(scene["errors"]) for scene in quantities["scenes"].values()) * len(
        quantities["timesteps_s"]
    )
    point = next(one for one in points if (one["scene"], one["integrator"], one["ms"]) == ("cube", "RK4", 2.0))
    scene = quantities["scenes"]["cube"]
    assert point["errors"] == {name: own[3] for name, own in scene["errors"]["RK4"].items()}
    assert point["orders"]["violation"] == scene["orders"]["RK4"]["violation"]["order"]


def test_a_text_of_the_data_cannot_end_the_script() -> None:
    results = json.loads(json.dumps(RESULTS))
    results["quantities"]["versions"]["mujoco"] = "</script>"
    assert render_page(results).count("</script>") == 1


def test_a_point_tells_its_model_timestep_integrator_order_error_and_cost(page: Page) -> None:
    page.get_by_role("combobox", name="Scene").select_option("spinning body")
    page.get_by_role("combobox", name="Error of").select_option("position")
    page.locator('[data-integrator="RK4"][data-ms="2"]').hover()
    order = RESULTS["quantities"]["scenes"]["spinning_body"]["orders"]["RK4"]["position"]["order"]
    cost = RESULTS["precision"]["scenes"]["spinning_body"]["costs"]["RK4"][3]
    shown = page.locator("#detail")
    for text in (
        "spinning body, RK4, timestep 2 ms",
        "error of position 1.6e-5",
        f"order {order:.2f}",
        f"{cost:.3g} runs",
    ):
        expect(shown).to_contain_text(text)


def test_keys_move_along_a_line_and_choose_scene_and_quantity(page: Page) -> None:
    page.get_by_role("combobox", name="Scene").select_option("cube")
    page.get_by_role("combobox", name="Error of").select_option("violation")
    page.locator('[data-integrator="Euler"][tabindex="0"]').focus()
    before = page.locator("#detail").inner_text()
    page.keyboard.press("ArrowRight")
    after = page.locator("#detail").inner_text()
    assert before != after
    assert after.startswith("cube, Euler, timestep")
    assert "error of violation" in after


def test_a_scene_without_the_quantity_falls_back_and_light_follows_the_reader(page: Page) -> None:
    page.get_by_role("combobox", name="Scene").select_option("servo")
    expect(page.get_by_role("combobox", name="Error of")).to_have_value("position")
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.emulate_media(color_scheme="light")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != dark
