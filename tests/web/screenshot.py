"""Takes the pictures of the pages, docs/*-page.png: `PYTHONPATH=src:tests python -m web.screenshot`. Run by hand."""

import random
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Locator, Page

from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.service.accounts import in_database
from grader.settings import Settings
from support.sites import Site, open_site
from web.browsing import SOFTWARE, Chromium, chromium

ROOT = Path(__file__).parents[2]
SOLUTIONS = ROOT / "reference_solutions/1.3-exercises/servo-threshold"
STEP, WRONG_STEP = "/quizzes/1.3-exercises/rk4-step", "../rk4-step/incorrect__stages_half_as_far.py"
SCRIPTS = ("incorrect__returns_the_bound.py", "correct__the_lessons_script_and_a_bisection.py")
EXERCISE, LAB = "/quizzes/1.3-exercises/servo-threshold", "1.3-labs--servo-stability"
VERDICT_MS = 60_000
WIDTH, HEIGHT, MARGIN = 1280, 900, 24
COLOURS = 256
"""Colours of a kept picture: enough for text and plots, and half of the bytes."""
LEARNERS, SEED = 24, 3
RIGHT: dict[str, int | str] = {"q1": 1, "q2": "5 ms", "q3": 2}
WRONG: dict[str, tuple[int | str, ...]] = {
    "q1": (3, 3, 0, 2),
    "q2": ("0.005", "0.005", "10 ms", "2.5 ms"),
    "q3": (1, 1, 0, 3),
}


def student_page(site: Site, browser: Chromium, target: Path) -> None:
    """The page of an exercise, from its top to the stability map of the verdict, after a wrong and a right script."""
    page = new_page(site, browser)
    page.goto(EXERCISE)
    for count, script in enumerate(SCRIPTS, 1):
        page.locator("textarea.code").fill(source(script))
        page.get_by_role("button", name="Run and judge").click()
        page.locator("#result").get_by_text(f"attempt {count},").first.wait_for(timeout=VERDICT_MS)
    page.goto(f"{EXERCISE}?attempt={attempt(page, len(SCRIPTS) - 1)}")
    stop_film(page, "300")
    page.evaluate("document.querySelector('textarea').scrollTop = 0")
    keep(page, target, page.locator("figure").first)


def verdict_page(site: Site, browser: Chromium, target: Path) -> None:
    """The verdict on a wrong step with its line marked, and the film of the step beside MuJoCo's near its end."""
    page = new_page(site, browser)
    page.goto(STEP)
    page.locator("textarea.code").fill(source(WRONG_STEP))
    page.get_by_role("button", name="Run and judge").click()
    page.locator("#result .verdict").wait_for(timeout=VERDICT_MS)
    stop_film(page, "510")
    first, last = page.locator("#result .verdict").bounding_box(), page.locator("[data-film]").bounding_box()
    assert first is not None
    assert last is not None
    clip = {
        "x": first["x"] - MARGIN, "y": first["y"] - MARGIN, "width": first["width"] + 2 * MARGIN,
        "height": last["y"] + last["height"] - first["y"] + 2 * MARGIN,
    }  # fmt: skip
    page.screenshot(path=target, full_page=True, clip=clip)  # type: ignore[arg-type]
    fewer_colours(target)


def stop_film(page: Page, tick: str) -> None:
    """Fetches the film of the verdict, and stops it at a tick of its clock, of 600; shows the top of the page."""
    film = page.locator("[data-film]")
    film.scroll_into_view_if_needed()
    film.locator(".run").first.wait_for()
    film.get_by_label("Time in the runs").fill(tick)
    page.evaluate("document.activeElement.blur(); scrollTo({ top: 0, behavior: 'instant' })")


def source(script: str) -> str:
    """A reference program without the comment that says how it must be graded."""
    lines = (SOLUTIONS / script).read_text(encoding="utf-8").splitlines()
    return "\n".join(line for line in lines if not line.startswith("# "))


def attempt(page: Page, place: int) -> str:
    """The id of an attempt of the page; 0 is the newest."""
    address = page.locator("#attempts .chip").nth(place).get_attribute("href")
    assert address is not None
    return address.partition("attempt=")[2].partition("#")[0]


def lab(site: Site, browser: Chromium, target: Path) -> None:
    """A lab between two runs: the servo is stiffer than Euler bears, and the last run is the ghost."""
    page = new_page(site, browser)
    page.goto("/lessons/1.3?scene=light")
    box = page.locator(f"[id='{LAB}']")
    box.scroll_into_view_if_needed()
    for control, value in ((3, "0.01"), (1, "20000")):
        field = page.locator(f"[id='{LAB}-control-{control}']")
        field.fill(value)
        field.press("Enter")
        page.wait_for_timeout(2000)
    page.get_by_label("Time in the run", exact=True).last.fill("8")
    page.evaluate("document.activeElement.blur()")
    box.screenshot(path=target)
    fewer_colours(target)


def instructor_page(site: Site, browser: Chromium, target: Path) -> None:
    """The statistics of the knowledge check after a class has answered it, with the hardest question unfolded."""
    chance = random.Random(SEED)
    for number in range(LEARNERS):
        client = site.client(f"learner-{number}")
        skill = chance.random()
        for question, right in RIGHT.items():
            answer = right if chance.random() < skill else chance.choice(WRONG[question])
            body = {"quiz": "1.3-check", "question": question, "answer": answer}
            assert client.post("/api/v1/submissions", json=body).status_code == 201
    page = new_page(site, browser)
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "tina", Role.INSTRUCTOR))
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    page.goto("/instructor/statistics?quiz=1.3-check")
    page.locator(".asked-question summary").first.click()
    page.evaluate("document.activeElement.blur()")
    keep(page, target, page.locator(".pair"))


def new_page(site: Site, browser: Chromium) -> Page:
    """A page of a person whom the service does not know yet."""
    return browser.new_context(
        base_url=site.origin, viewport={"width": WIDTH, "height": HEIGHT}, reduced_motion="reduce"
    ).new_page()


def keep(page: Page, target: Path, last: Locator) -> None:
    """The page from its top to the end of `last`."""
    page.mouse.move(0, 0)
    box = last.bounding_box()
    assert box is not None
    clip = {"x": 0.0, "y": 0.0, "width": float(WIDTH), "height": box["y"] + box["height"] + MARGIN}
    page.screenshot(path=target, full_page=True, clip=clip)  # type: ignore[arg-type]
    fewer_colours(target)


def fewer_colours(target: Path) -> None:
    """Writes a picture again with a palette."""
    with Image.open(target) as picture:
        small = picture.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    small.save(target, optimize=True)


def main(folder: Path) -> None:
    """All pictures, of a service with a database of its own."""
    with (
        tempfile.TemporaryDirectory() as data,
        open_site(Settings(data=Path(data), workers=1)) as site,
        chromium(*SOFTWARE) as browser,
    ):
        student_page(site, browser, folder / "student-page.png")
        verdict_page(site, browser, folder / "verdict-page.png")
        lab(site, browser, folder / "lab-page.png")
        instructor_page(site, browser, folder / "instructor-page.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs")
