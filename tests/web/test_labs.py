"""A lab in a real browser: its length, what is drawn over the scene, the camera, and a kind that is not there."""

import json
from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from grader.settings import Settings
from labs.made_up import CUBE
from web.browsing import chromium, service

pytestmark = pytest.mark.browser

expect.set_options(timeout=30_000)

LABS = [
    {
        "id": "cube",
        "title": "Cube",
        "model": "cube",
        "forceScale": 0.03,
        "overlays": {"contacts": True},
        "toggles": ["contacts", "forces", "com"],
        "seconds": 1,
        "controls": [{"label": "friction", "min": 0, "max": 1, "value": 0.6, "set": "model.geom_friction[0]"}],
        "readouts": [
            {"label": "pairs", "expr": "lib.contactPairs().length", "digits": 0},
            {"label": "late", "expr": "data.time < 0.5 ? lib.qpos('nothing') : 7", "digits": 0},
        ],
        "plots": [{"xlabel": "t in s", "height": 140, "traces": [{"label": "z", "expr": "data.qpos[2]"}]}],
    },
    {"id": "search", "kind": "policies", "title": "A policy search", "episodes": 3},
]
PICTURE = "canvas => canvas.toDataURL()"
REDS = """canvas => { const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    const [red, green, blue] = data.slice(i, i + 3);
    count += red > 180 && green < 60 && blue > 70 && blue < 110;
  }
  return count; }"""
"""How many pixels have the colour of a contact force."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """The page of a lesson with these labs; its console shows no error. The player stands, so that a picture lasts."""
    content = tmp_path_factory.mktemp("content")
    for folder in ("quizzes", "models"):
        (content / folder).mkdir()
    (content / "models/cube.xml").write_text(CUBE)
    (content / "quizzes/labs.json").write_text(json.dumps({"id": "labs", "title": "Labs", "labs": LABS}))
    settings = Settings(data=tmp_path_factory.mktemp("data"), workers=1, content=content)
    complaints: list[str] = []
    with service(settings) as origin, chromium() as browser:
        page = browser.new_context(base_url=origin, reduced_motion="reduce").new_page()
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto("/")
        yield page
        assert complaints == []


@pytest.fixture
def cube(page: Page) -> Locator:
    lab = page.locator('[data-lab-id="cube"]')
    lab.scroll_into_view_if_needed()
    expect(lab.locator("svg.strips .line").first).to_be_attached()
    return lab


def test_a_lab_of_another_kind_leaves_a_placeholder(page: Page) -> None:
    lab = page.locator('[data-lab-id="search"]')
    lab.scroll_into_view_if_needed()
    expect(lab).to_contain_text("Labs of the kind “policies” do not run here.")


def test_the_learner_sets_the_length_of_a_run(cube: Locator) -> None:
    length = cube.get_by_label("length of the run")
    expect(length).to_have_value("1")
    late = cube.locator("dd").nth(1)
    expect(late).to_have_text("–")
    length.fill("2")
    length.press("Enter")
    clock = cube.get_by_label("Time in the run")
    expect(clock).to_have_attribute("max", "125")
    clock.press("End")
    expect(late).to_have_text("7")
    expect(cube.locator("svg.strips")).to_contain_text("t in s")


def test_forces_are_drawn_where_the_learner_wants_them(cube: Locator) -> None:
    cube.get_by_label("Time in the run").press("End")
    canvas = cube.locator("canvas")
    before = canvas.evaluate(REDS)
    cube.get_by_label("contact forces").check()
    assert canvas.evaluate(REDS) > before + 20
    cube.get_by_label("contact forces").uncheck()
    assert canvas.evaluate(REDS) == before


def test_the_camera_turns_by_keys_and_by_dragging(cube: Locator, page: Page) -> None:
    canvas = cube.locator("canvas")
    pictures = [canvas.evaluate(PICTURE)]
    for key in ("ArrowLeft", "ArrowUp", "+"):
        canvas.press(key)
        pictures.append(canvas.evaluate(PICTURE))
    box = canvas.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 50, box["y"] + 50)
    page.mouse.down()
    page.mouse.move(box["x"] + 120, box["y"] + 70)
    page.mouse.up()
    pictures.append(canvas.evaluate(PICTURE))
    assert len(set(pictures)) == len(pictures)
    page.mouse.move(box["x"] + 10, box["y"] + 10)
    assert canvas.evaluate(PICTURE) == pictures[-1]


def test_a_slider_without_a_step_takes_any_value(cube: Locator, page: Page) -> None:
    with page.expect_response("**/labs:run") as answer:
        cube.get_by_label("friction, slider").evaluate(
            "one => { one.value = '0.12345'; one.dispatchEvent(new Event('input', {bubbles: true})) }"
        )
    assert answer.value.json()["controls"] == {"friction": pytest.approx(0.1235, abs=1e-4)}
