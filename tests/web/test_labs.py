"""A lab in a real browser: scene and plots on one time axis, controls, what is drawn over the scene, and its cost."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Locator, Page, Response, expect

from grader.settings import Settings
from labs.made_up import CUBE
from web.browsing import Chromium, service

pytestmark = pytest.mark.browser

expect.set_options(timeout=30_000)

MODELS = Path(__file__).parents[2] / "models"
ROOM = """<mujoco><worldbody><light pos="0 0 4"/><camera name="side" pos="0 -1 1" xyaxes="1 0 0 0 0 1"/>
  <geom type="plane" size="2 2 0.1"/>{}</worldbody></mujoco>"""
SOLID = '<body pos="{} {} 0.5"><freejoint/><geom type="{}" size="0.05 0.06 0.07"/></body>'
KINDS = ("box", "capsule", "cylinder", "ellipsoid", "sphere")
CROWD = ROOM.format("".join(SOLID.format(0.3 * (i % 7) - 1, 0.3 * (i // 7) - 1, KINDS[i % 5]) for i in range(49)))
"""Fifty geoms of all kinds."""

SERVO = json.loads((Path(__file__).parents[2] / "quizzes/1.3-labs.json").read_text())["labs"][1]
LABS: list[dict[str, Any]] = [
    {
        "id": "cube",
        "title": "Cube",
        "model": "cube",
        "forceScale": 0.03,
        "overlays": {"contacts": True},
        "toggles": ["contacts", "forces", "com", "cameras", "shadows"],
        "seconds": 1,
        "controls": [{"label": "friction", "min": 0, "max": 1, "value": 0.6, "set": "model.geom_friction[0]"}],
        "readouts": [
            {"label": "pairs", "expr": "lib.contactPairs().length", "digits": 0},
            {"label": "late", "expr": "data.time < 0.5 ? lib.qpos('nothing') : 7", "digits": 0},
        ],
        "plots": [{"xlabel": "t in s", "height": 140, "traces": [{"label": "z", "expr": "data.qpos[2]"}]}],
    },
    SERVO,
    {"id": "five", "kind": "integrators", "model": "pendulum", "key": 0, "timestep": 0.002, "seconds": 2},
    {"id": "crowd", "model": "crowd", "overlays": ["shadows"], "toggles": ["shadows"], "seconds": 1},
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
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A lesson with these labs."""
    content = tmp_path_factory.mktemp("content")
    for folder in ("quizzes", "models"):
        (content / folder).mkdir()
    models = {name: (MODELS / f"{name}.xml").read_text() for name in ("pendulum", "pendulum_servo")}
    camera = '<camera pos="0 0 0.12" xyaxes="1 0 0 0 0 1"/>'
    models |= {"crowd": CROWD, "cube": CUBE.replace("<worldbody>", f"<worldbody>{camera}")}
    for name, xml in models.items():
        (content / f"models/{name}.xml").write_text(xml)
    (content / "quizzes/labs.json").write_text(json.dumps({"id": "labs", "title": "Labs", "labs": LABS}))
    with service(Settings(data=tmp_path_factory.mktemp("data"), workers=0, content=content)) as origin:
        yield origin


@pytest.fixture(scope="module")
def page(origin: str, browser: Chromium) -> Iterator[Page]:
    """The page of the lesson; its console shows no error. The player stands, so that a picture lasts."""
    complaints: list[str] = []
    page = browser.new_context(base_url=origin, reduced_motion="reduce").new_page()
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto("/")
    yield page
    assert complaints == []


def opened(page: Page, lab: str) -> Locator:
    """A lab with its first run."""
    box = page.locator(f'[data-lab-id="{lab}"]')
    box.scroll_into_view_if_needed()
    expect(box.locator("svg.strips .axis").first).to_be_attached()
    return box


@pytest.fixture
def servo(page: Page) -> Locator:
    """The servo at a timestep above its limit, after a run below it."""
    lab = opened(page, "servo-stability")
    lab.get_by_label("integrator").select_option("implicitfast")
    message = lab.locator("[data-message]")
    for label, value in (
        ("stiffness kp", "8080"),
        ("damping kv", "5"),
        ("timestep h", "0.005"),
        ("timestep h", "0.02"),
    ):
        field = lab.get_by_label(label, exact=True)
        field.fill(value)
        field.press("Tab")
        if value == "0.005":
            expect(message).to_have_text("No warning within 3 s. implicitfast is stable up to 0.01176 s here.")
    expect(message).to_contain_text("you step 0.02 s")
    return lab


@pytest.fixture
def cube(page: Page) -> Locator:
    return opened(page, "cube")


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
    expect(cube.locator(".ghost.there")).to_contain_text("last run: friction 0.6")


@pytest.mark.parametrize("name", ["cameras", "shadows", "centres of mass"])
def test_what_the_learner_ticks_is_drawn_over_the_scene(cube: Locator, name: str) -> None:
    canvas = cube.locator("canvas")
    before = canvas.evaluate(PICTURE)
    cube.get_by_label(name).check()
    assert canvas.evaluate(PICTURE) != before
    cube.get_by_label(name).uncheck()
    assert canvas.evaluate(PICTURE) == before


def test_a_run_that_diverges_has_a_flag_and_no_line_behind_it(servo: Locator) -> None:
    expect(servo.locator(".strips text.fault")).to_have_text("BADQACC 0.14 s")
    expect(servo.locator("[data-message]")).to_contain_text(
        "implicitfast is stable up to 0.01176 s here; you step 0.02 s"
    )
    flag, line = (servo.locator(f".strips {name}").bounding_box() for name in (".fault-line", ".line"))
    assert flag is not None
    assert line is not None
    assert line["x"] + line["width"] <= flag["x"] + 3  # the width of the lines
    servo.locator("[data-time]").press("End")
    expect(servo.get_by_text("after the reset")).to_be_visible()
    servo.locator("[data-time]").press("Home")
    expect(servo.get_by_text("after the reset")).to_be_hidden()


def test_scene_and_plot_share_one_time(servo: Locator, page: Page) -> None:
    plot, canvas = servo.locator(".strips"), servo.locator("canvas")
    box = plot.bounding_box()
    assert box is not None
    moments = set()
    for part in (0.2, 0.3):
        page.mouse.click(box["x"] + part * box["width"], box["y"] + 80)
        cursor = servo.locator(".cursor").bounding_box()
        assert cursor is not None
        assert cursor["x"] == pytest.approx(box["x"] + part * box["width"], abs=36)  # a step of 0.02 s
        moments.add((servo.locator("[data-clock]").inner_text(), canvas.evaluate(PICTURE)))
    assert len(moments) == 2
    view = page.viewport_size
    whole = servo.locator(".stage").bounding_box()
    assert view is not None
    assert whole is not None
    assert whole["height"] < view["height"]


def test_the_limit_is_a_tick_on_the_slider_of_the_timestep(servo: Locator, page: Page) -> None:
    tick = servo.locator(".ticks .limit")
    expect(tick).to_have_text("limit 0.01176 s")
    ends = servo.locator(".has-limit .ticks > :not(.limit, .beyond)")
    expect(ends).to_have_text(["0.001 s", "0.02 s"])  # as the field, the axis and the sentences
    assert tick.evaluate("one => parseFloat(one.style.left)") == pytest.approx(100 * (11.76 - 1) / 19, abs=0.1)
    with page.expect_response("**/labs:run"):
        servo.get_by_label("integrator").select_option("discrete")
    expect(tick).to_have_count(0)
    expect(servo.locator("[data-message]")).to_contain_text("discrete is stable in the whole range")


def test_a_slider_over_decades_is_logarithmic_and_runs_while_it_is_dragged(servo: Locator, page: Page) -> None:
    typed, slider = servo.get_by_label("stiffness kp", exact=True), servo.get_by_label("stiffness kp, slider")
    slider.evaluate("one => { one.value = 0.5; one.dispatchEvent(new Event('input')); }")
    assert float(typed.input_value()) == pytest.approx((10 * 40_000) ** 0.5, abs=10)  # the geometric mean
    slider.dispatch_event("change")
    expect(servo.locator(".ghost.there")).to_contain_text("last run: stiffness kp 8080 N m/rad")
    runs = list[float]()

    def keep(response: Response) -> None:
        if "labs:run" in response.url:
            runs.append(response.json()["controls"]["stiffness kp"])

    page.on("response", keep)
    box = slider.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    for part in (0.55, 0.6, 0.65, 0.7):
        with page.expect_response("**/labs:run"):
            page.mouse.move(box["x"] + part * box["width"], box["y"] + box["height"] / 2)
    shown = float(typed.input_value())
    expect(servo.locator(".ghost.there")).to_contain_text(re.compile(r"last run: stiffness kp 6[23]0 N m/rad"))
    page.mouse.up()
    assert len(runs) >= 4
    assert runs == sorted(runs)
    assert runs[-1] == shown


def test_a_slider_reaches_its_end(servo: Locator) -> None:
    timestep = servo.get_by_role("slider", name="timestep h")
    timestep.press("End")  # 19 steps, whose share of the slider is no finite decimal
    expect(timestep).to_have_attribute("aria-valuetext", "0.020 s")


def test_a_typed_value_outside_the_range_is_refused_in_a_sentence(servo: Locator) -> None:
    typed = servo.get_by_label("damping kv", exact=True)
    typed.fill("101")
    typed.press("Enter")
    expect(servo.locator("[data-message]")).to_have_text("damping kv must be a number from 0 to 100 N m s/rad.")
    expect(typed).to_have_attribute("aria-invalid", "true")
    typed.fill("7.4")
    typed.press("Enter")
    expect(typed).to_have_value("7.5")  # on the slider's grid
    expect(servo.locator("[data-message]")).to_contain_text("implicitfast")


def test_curves_that_coincide_are_one_line_with_one_name(page: Page) -> None:
    lab = opened(page, "five")
    expect(lab.locator(".strips .name", has_text="here")).to_have_text(
        "Euler = implicit = implicitfast = discrete here"
    )
    expect(lab.locator(".strips .line")).to_have_count(2)
    expect(lab.locator(".strips")).to_contain_text("size of the energy error (%), log")
    expect(lab.locator("[data-integrator=RK4] td").nth(2)).to_have_text("none")
    expect(lab.locator("[data-integrator] td:nth-of-type(2)")).to_have_text([re.compile(r"^\d+\.\d\d$")] * 5)


def test_labs_are_accessible_and_fit_narrow_screens(servo: Locator, page: Page) -> None:
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        servo.locator("[data-time]").press("End")
        violations = Axe().run(page).response["violations"]
        assert [(one["id"], [node["html"][:200] for node in one["nodes"]]) for one in violations] == []
    for width in (390, 320):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width, width
        strips = servo.locator("svg.strips").bounding_box()
        assert strips is not None
        assert strips["height"] <= 400
    page.set_viewport_size({"width": 1280, "height": 720})


def test_on_a_phone_the_scene_and_every_slider_are_on_one_screen(servo: Locator, page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    for slider in servo.locator("input[type=range]").all():
        slider.evaluate("node => node.scrollIntoView({ block: 'center', behavior: 'instant' })")
        scene, box = servo.locator("canvas").bounding_box(), slider.bounding_box()
        assert scene is not None
        assert box is not None
        assert scene["y"] >= 0
        assert scene["y"] + scene["height"] <= box["y"] < 844
    page.set_viewport_size({"width": 1280, "height": 720})


KEPT_FOCUS = """() => { const { activeElement: one } = document, style = getComputedStyle(one);
  const mark = one.closest('.speeds') ? getComputedStyle(one.nextElementSibling) : style;
  return [one.labels?.[0]?.innerText.trim() || one.getAttribute('aria-label') || one.innerText.trim(),
    mark.outlineStyle !== 'none' && parseFloat(mark.outlineWidth) >= 2]; }"""
"""The name of what has the focus, and whether the focus is seen."""

STOPS = [
    "The simulated scene; the arrow keys turn it, plus and minus move it; drag a body to pull it",
    "Play",
    "Time in the run",
    "1×",
    "contacts",
    "contact forces",
    "centres of mass",
    "cameras",
    "shadows",
    "pull",
    "where to",
    "Pull",
    "friction",
    "friction, slider",
    "length of the run",
]
"""What the Tab key reaches in the lab of the cube, in the order in which it is read."""


def test_a_lab_is_operated_with_the_keyboard_alone(origin: str, browser: Chromium) -> None:
    page = browser.new_context(base_url=origin, reduced_motion="reduce").new_page()
    page.goto("/")
    lab, keys = opened(page, "cube"), page.keyboard
    clock, canvas = lab.locator("[data-clock]"), lab.locator("canvas")
    page.evaluate("one => { one.tabIndex = -1; one.focus(); }", lab.element_handle())

    def step() -> None:
        keys.press("Tab")
        name, is_seen = page.evaluate(KEPT_FOCUS)
        assert is_seen, name
        reached.append(name)

    def run_with(*pressed: str) -> dict[str, Any]:
        with page.expect_response("**/labs:run") as answer:
            for key in pressed:
                keys.press(key)
        asked: dict[str, Any] = json.loads(answer.value.request.post_data or "{}")
        return asked

    reached: list[str] = []
    step()  # the scene
    front = canvas.evaluate(PICTURE)
    keys.press("ArrowLeft")
    assert canvas.evaluate(PICTURE) != front
    step()  # Play, which becomes Pause
    keys.press("Space")
    expect(lab.get_by_role("button", name="Pause")).to_be_focused()
    keys.press("Space")
    expect(lab.get_by_role("button", name="Play")).to_be_focused()
    step()  # time
    keys.press("End")
    expect(clock).to_have_text("1.000 s")
    keys.press("Home")
    expect(clock).to_have_text("0.000 s")
    step()  # the speeds are one stop
    keys.press("ArrowRight")
    expect(lab.get_by_label("0.1×")).to_be_checked()
    for _ in range(5):
        step()
        was = page.evaluate("document.activeElement.checked")
        keys.press("Space")
        assert page.evaluate("document.activeElement.checked") is not was
        keys.press("Space")
    for _ in range(3):  # which body is pulled, where to, and the button
        step()
    step()  # a typed value
    keys.press("Control+A")
    keys.type("0.25")
    assert run_with("Enter")["controls"] == {"friction": 0.25}
    expect(lab.locator(".ghost.there")).to_be_visible()
    step()  # its slider
    assert run_with("ArrowRight")["controls"]["friction"] > 0.25
    assert run_with("End")["controls"] == {"friction": 1}  # or the next one might be taken for this run
    expect(lab.get_by_label("friction", exact=True)).to_have_value("1")
    step()  # the length of the run
    keys.press("Control+A")
    keys.type("2")
    assert run_with("Enter")["seconds"] == 2
    assert reached == STOPS
    keys.press("Tab")
    assert not page.evaluate("one => one.contains(document.activeElement)", lab.element_handle())
    page.context.close()


FRAMES = 60
FRAME_CPU_MS = 1000 / 30


def test_fifty_geoms_are_drawn_thirty_times_a_second(page: Page) -> None:
    lab = opened(page, "crowd")
    slider = lab.locator("[data-time]")
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")

    def cpu_s() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return float(next(metric["value"] for metric in metrics if metric["name"] == "ProcessTime"))

    began = cpu_s()
    slider.evaluate(
        """async (one, frames) => { for (let i = 0; i < frames; i++) {
          one.value = i; one.dispatchEvent(new Event('input'));
          await new Promise(requestAnimationFrame); } }""",
        FRAMES,
    )
    assert 1000 * (cpu_s() - began) / FRAMES < FRAME_CPU_MS


def test_a_lab_starts_when_it_is_seen_and_slowly_where_its_end_is_near(origin: str, browser: Chromium) -> None:
    page = browser.new_context(base_url=origin, viewport={"width": 1280, "height": 800}).new_page()
    page.goto("/")
    lab = page.locator('[data-lab-id="servo-stability"]')
    clock = lab.locator("[data-clock]")
    labs = page.locator(".lab")
    sizes = labs.evaluate_all("all => all.map(one => one.offsetHeight)")
    page.evaluate(
        "one => scrollTo(0, one.getBoundingClientRect().top + scrollY - innerHeight - 50)", lab.element_handle()
    )
    expect(lab.locator(".strips .line")).to_be_attached()  # near, and not seen
    page.wait_for_timeout(300)
    assert clock.inner_text() == "0.000 s"
    lab.locator(".stage").scroll_into_view_if_needed()
    expect(clock).not_to_have_text("0.000 s")
    assert lab.locator(".speeds :checked").get_attribute("value") == "1"
    lab.get_by_label("stiffness kp", exact=True).fill("40000")
    lab.get_by_label("timestep h", exact=True).fill("0.02")
    lab.get_by_label("timestep h", exact=True).press("Enter")
    expect(lab.locator(".strips text.fault")).to_be_attached()
    assert lab.locator(".speeds :checked").get_attribute("value") == "0.1"
    opened(page, "five")
    assert labs.evaluate_all("all => all.map(one => one.offsetHeight)") == sizes
    page.context.close()


def test_without_javascript_a_lab_says_what_it_needs(origin: str, browser: Chromium) -> None:
    page = browser.new_context(base_url=origin, java_script_enabled=False).new_page()
    page.goto("/")
    lab = page.locator('[data-lab-id="cube"]')
    expect(lab.get_by_text("it needs JavaScript")).to_be_visible()
    expect(lab.get_by_role("button", name="Play")).to_be_hidden()
    page.context.close()
