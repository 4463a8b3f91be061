"""The scene of a lab under light, in a real browser: shadows, picking, pulling; and the painter without a GPU."""

import gzip
import json
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, Request, expect

from grader.settings import Settings
from grader.web.frame import assets
from web.browsing import SOFTWARE, Chromium, chromium, findings, service

pytestmark = [pytest.mark.browser, pytest.mark.slow]

expect.set_options(timeout=30_000)

OURS = ("light.js", "shaders.js", "solids.js", "painting.js", "pulling.js")
COMPRESSED_MAX = 14_000
"""What the light may cost a page with a lab, compressed [bytes]."""

TABLE = """<mujoco><option gravity="0 0 0"/><worldbody><geom type="plane" size="2 2 .1"/>
  <body name="ball" pos="0 0 .5"><freejoint/><geom type="sphere" size=".3" rgba=".2 .4 .8 1"/></body>
  </worldbody></mujoco>"""
EVERY_SOLID = """<mujoco><asset><mesh name="wedge" vertex="0 0 0 .4 0 0 0 .4 0 0 0 .4"/>
  <hfield name="hill" nrow="2" ncol="3" size=".5 .5 .3 .1" elevation="0 1 0 0 0 0"/></asset><worldbody>
  <geom type="plane" size="0 0 .1"/><geom type="hfield" hfield="hill" pos="-1 0 .1"/>
  <body pos="-.5 0 1"><freejoint/><geom type="mesh" mesh="wedge" rgba=".2 .4 .8 1"/></body>
  <body pos="0 0 1"><freejoint/><geom type="capsule" size=".1 .2"/></body>
  <body pos=".5 0 1"><freejoint/><geom type="ellipsoid" size=".1 .2 .3" rgba=".2 .8 .4 .5"/></body>
  <body pos="1 0 1"><freejoint/><geom type="cylinder" size=".1 .2"/></body>
  <body pos="0 .5 1"><freejoint/><geom type="box" size=".1 .2 .1"/></body>
  <body pos=".5 .5 1"><freejoint/><geom type="sphere" size=".2"/></body></worldbody></mujoco>"""
LAB: dict[str, Any] = {
    "id": "ball", "model": "ball", "seconds": 2, "toggles": ["shadows"], "overlays": ["shadows"],
    "camera": {"azimuth": 90, "elevation": -35, "distance": 4, "target": [0, 0, 0.3]},
    "readouts": [{"label": "x", "expr": "data.qpos[0]", "digits": 3}],
}  # fmt: skip
BLUES = """canvas => { const { data, width } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const seen = { tones: new Set(), x: 0, y: 0, count: 0 };
  for (let i = 0; i < data.length; i += 4) {
    const [red, green, blue, alpha] = data.slice(i, i + 4);
    if (alpha < 250 || blue < red + 30) continue;
    seen.tones.add(blue >> 3); seen.count += 1; seen.x += (i / 4) % width; seen.y += Math.floor(i / 4 / width);
  }
  const box = canvas.getBoundingClientRect(), scale = box.width / width / seen.count;
  return { tones: seen.tones.size, count: seen.count, x: box.x + scale * seen.x, y: box.y + scale * seen.y };
}"""
"""The pixels of the ball: how many, of how many tones of blue, and where their middle is on the page."""
DARK = """canvas => { const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) {
    const [red, , blue, alpha] = data.slice(i, i + 4);
    count += alpha > 40 && alpha < 200 && red < 60 && blue < 90;
  }
  return count; }"""
"""The translucent dark pixels, which are shadows on the floor."""
COUNT = """Light => {
  const { shared } = Light, draw = shared.draw.bind(shared), calls = shared.gl.drawElementsInstanced.bind(shared.gl);
  window.counted = { ms: [], calls: 0 };
  shared.gl.drawElementsInstanced = (...given) => { window.counted.calls += 1; calls(...given); };
  shared.draw = (...given) => {
    const began = performance.now(), isDrawn = draw(...given);
    window.counted.ms.push(performance.now() - began);
    return isDrawn;
  };
}"""
"""Counts what drawing takes from now on: the time of each picture in JavaScript, and the calls of all."""
SOLIDS: dict[str, Any] = {
    "id": "solids", "model": "solids", "seconds": 2,
    "readouts": [{"label": "y", "expr": "data.qpos[1]", "digits": 3}],
    "controls": [
        {"type": "slider", "label": "gravity", "set": "model.opt.gravity[2]", "min": -10, "max": 0, "value": 0},
    ],
}  # fmt: skip
FRAME_MS = 8
"""Half of a frame at 60 Hz, for a scene of eight solids: it takes 1 ms on a machine that is not busy."""


@contextmanager
def serve_lab(folder: Path, xml: str, lab: dict[str, Any]) -> Iterator[str]:
    """Serves a course of one lab; yields its origin."""
    content = folder / "content"
    for name in ("quizzes", "models"):
        (content / name).mkdir(parents=True)
    (content / f"models/{lab['model']}.xml").write_text(xml)
    (content / "quizzes/labs.json").write_text(json.dumps({"id": "labs", "title": "Labs", "labs": [lab]}))
    with service(Settings(data=folder / "data", workers=0, content=content)) as origin:
        yield origin


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with serve_lab(tmp_path_factory.mktemp("ball"), TABLE, LAB) as origin:
        yield origin


@pytest.fixture(scope="module")
def lit() -> Iterator[Chromium]:
    with chromium(*SOFTWARE) as browser:
        yield browser


@pytest.fixture
def lit_browser(lit: Chromium) -> Iterator[Chromium]:
    """The same browser for all tests, which close what they opened: pages would share its one renderer."""
    yield lit
    for context in lit.browser.contexts:
        context.close()


@pytest.fixture
def complaints() -> Iterator[list[str]]:
    """Errors, of the console as well."""
    said = list[str]()
    yield said
    assert said == []


def open_lab(browser: Chromium, origin: str, complaints: list[str], scene: str = "light", **options: Any) -> Page:
    page = browser.new_context(base_url=origin, reduced_motion="reduce", **options).new_page()
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(f"/?scene={scene}")
    page.locator(".lab").scroll_into_view_if_needed()
    expect(page.locator("[data-play]")).to_be_enabled()
    expect(page.locator(".readouts dd")).to_have_text("0.000")
    return page


def canvas_of(page: Page) -> Locator:
    return page.locator(".lab canvas")


def pulls_in(request: Request) -> list[dict[str, Any]]:
    """The pulls that a run was asked for with."""
    pulls: list[dict[str, Any]] = json.loads(request.post_data or "")["pulls"]
    return pulls


def wait_until(is_so: Callable[[], bool]) -> None:
    """Asks again from here: a page that polls by itself would evaluate text, which its security policy refuses."""
    until = time.monotonic() + 30
    while not is_so():
        assert time.monotonic() < until
        time.sleep(0.05)


def ask_light(page: Page, what: str) -> Any:
    """A value of the page's renderer."""
    return page.evaluate(f"import('{assets.static('light.js')}').then(({{ Light }}) => {what})")


def test_a_lit_ball_is_round_and_casts_a_shadow(lit_browser: Chromium, origin: str, complaints: list[str]) -> None:
    page = open_lab(lit_browser, origin, complaints)
    lit, shadow = canvas_of(page).evaluate(BLUES), canvas_of(page).evaluate(DARK)
    page.get_by_label("shadows").uncheck()
    assert lit["tones"] > 10
    assert shadow > 200
    assert canvas_of(page).evaluate(DARK) < shadow / 4
    assert ask_light(page, "Light.shared.frames") >= 2
    assert findings(page, contrast=False) == []


def test_a_ball_is_pulled_by_the_pointer_and_the_last_run_stays_as_a_ghost(
    lit_browser: Chromium, origin: str, complaints: list[str]
) -> None:
    page = open_lab(lit_browser, origin, complaints)
    ball = canvas_of(page).evaluate(BLUES)
    page.mouse.move(ball["x"], ball["y"])
    assert canvas_of(page).evaluate("canvas => canvas.style.cursor") == "grab"
    page.mouse.down()
    page.mouse.move(ball["x"] + 60, ball["y"], steps=3)
    with page.expect_request("**/labs:run") as asked:
        page.mouse.up()
    [pull] = pulls_in(asked.value)
    assert (pull["geom"], pull["begin"]) == (1, 0)
    assert pull["goal"][0] > 0.2
    expect(page.locator("[data-ghost]")).to_contain_text("without this pull")
    expect(page.locator("[data-message]")).to_contain_text("Pulled from 0\u00a0s to 0.4\u00a0s.")
    page.get_by_label("Time in the run").fill("60")
    expect(page.locator(".readouts dd")).not_to_have_text("0.000")
    there = canvas_of(page).evaluate(BLUES)
    assert there["x"] > ball["x"] + 10


def test_beside_the_ball_the_camera_turns(lit_browser: Chromium, origin: str, complaints: list[str]) -> None:
    page = open_lab(lit_browser, origin, complaints)
    box = canvas_of(page).bounding_box()
    assert box is not None
    before = canvas_of(page).evaluate("canvas => canvas.toDataURL()")
    page.mouse.move(box["x"] + 8, box["y"] + 8)
    page.mouse.down()
    page.mouse.move(box["x"] + 60, box["y"] + 8)
    page.mouse.up()
    assert canvas_of(page).evaluate("canvas => canvas.toDataURL()") != before
    small = canvas_of(page).evaluate(BLUES)["count"]
    canvas_of(page).focus()
    page.mouse.wheel(0, -400)
    wait_until(lambda: canvas_of(page).evaluate(BLUES)["count"] > 1.2 * small)


@pytest.mark.parametrize("scene", ["light", "painted"])
def test_a_ball_is_pulled_by_keyboard(lit_browser: Chromium, origin: str, complaints: list[str], scene: str) -> None:
    page = open_lab(lit_browser, origin, complaints, scene)
    page.get_by_label("pull", exact=True).press("Tab")
    page.get_by_label("where to").select_option("left")
    with page.expect_request("**/labs:run") as asked:
        page.get_by_role("button", name="Pull").press("Enter")
    [pull] = pulls_in(asked.value)
    assert pull["goal"][0] < -0.2
    assert (ask_light(page, "Light.shared") is None) == (scene == "painted")


def test_without_a_gpu_the_painter_draws(lit_browser: Chromium, origin: str, complaints: list[str]) -> None:
    page = open_lab(lit_browser, origin, complaints, scene="")
    assert ask_light(page, "Light.shared") is None
    assert canvas_of(page).evaluate(BLUES)["count"] > 100


def test_a_lost_context_comes_back_and_a_dark_page_has_another_picture(
    lit_browser: Chromium, origin: str, complaints: list[str]
) -> None:
    page = open_lab(lit_browser, origin, complaints)
    bright = canvas_of(page).evaluate("canvas => canvas.toDataURL()")
    ask_light(
        page, "{ window.ending = Light.shared.gl.getExtension('WEBGL_lose_context'); window.ending.loseContext(); }"
    )
    wait_until(lambda: ask_light(page, "Light.shared.isLost"))
    page.get_by_label("Time in the run").fill("10")
    assert canvas_of(page).evaluate(BLUES)["count"] > 100  # painted
    assert canvas_of(page).evaluate(BLUES)["tones"] < 10
    page.evaluate("window.ending.restoreContext()")
    wait_until(lambda: canvas_of(page).evaluate(BLUES)["tones"] > 10)
    page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    wait_until(lambda: canvas_of(page).evaluate("canvas => canvas.toDataURL()") != bright)
    page.emulate_media(forced_colors="active", reduced_motion="reduce")
    assert canvas_of(page).evaluate(BLUES)["tones"] > 10
    complaints[:] = [complaint for complaint in complaints if "CONTEXT_LOST" not in complaint]


def test_a_picture_takes_few_calls_little_time_and_no_more_memory_with_each_run(
    lit_browser: Chromium, tmp_path: Path, complaints: list[str]
) -> None:
    with serve_lab(tmp_path, EVERY_SOLID, SOLIDS) as origin:
        page = open_lab(lit_browser, origin, complaints)
        ask_light(page, f"({COUNT})(Light)")
        for frame in range(40):
            page.get_by_label("Time in the run").fill(str(frame))
        counted = page.evaluate("window.counted")
        pictures, kept = len(counted["ms"]), ask_light(page, "Light.shared.meshes.size")
        assert pictures >= 40
        assert counted["calls"] <= 15 * pictures  # seven kinds, once for the shadow; the translucent one twice more
        assert statistics.median(counted["ms"]) < FRAME_MS
        for gravity in ("-1", "-2", "-3"):
            with page.expect_response("**/labs:run"):
                page.get_by_label("gravity", exact=True).fill(gravity)
                page.get_by_label("gravity", exact=True).press("Enter")
            expect(page.locator("[data-ghost]")).to_contain_text("gravity")
        assert ask_light(page, "Light.shared.meshes.size") == kept


def test_a_finger_scrolls_the_page_beside_a_body_and_pulls_on_it(
    lit_browser: Chromium, origin: str, complaints: list[str]
) -> None:
    page = open_lab(lit_browser, origin, complaints, has_touch=True, viewport={"width": 390, "height": 500})
    ball, box = canvas_of(page).evaluate(BLUES), canvas_of(page).bounding_box()
    assert box is not None
    before = page.evaluate("scrollY")
    with page.expect_request("**/labs:run") as asked:
        swipe(page, (ball["x"], ball["y"]), (40, 0))
    assert pulls_in(asked.value)[0]["goal"][0] > 0.2
    assert page.evaluate("scrollY") == before
    swipe(page, (box["x"] + 8, box["y"] + box["height"] - 8), (0, -60))
    wait_until(lambda: page.evaluate("scrollY") > before)


def swipe(page: Page, start: tuple[float, float], way: tuple[float, float]) -> None:
    """Moves a finger over the screen [px]."""
    session = page.context.new_cdp_session(page)
    for step in range(6):
        point = {"x": start[0] + step * way[0] / 5, "y": start[1] + step * way[1] / 5}
        kind = "touchMove" if step else "touchStart"
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [point]})
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def test_the_light_is_small() -> None:
    folder = Path(assets.FOLDER)
    assert sum(len(gzip.compress((folder / name).read_bytes())) for name in OURS) < COMPRESSED_MAX
