"""Takes docs/student-page.png: `PYTHONPATH=tests python -m web.screenshot`. Not a test; run by hand."""

import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page

from web.browsing import chromium, service, settings_in

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "reference_solutions/1.3-exercises/servo-threshold/partial__pd_law_on_a_motor.py"
VERDICT_MS = 60_000
WIDTH = 900


def answer_everything(page: Page) -> None:
    """A number, a prediction and a script, each with its verdict."""
    number = page.locator('[id="1.3-check--q2"]')
    number.get_by_label("Your answer").fill("0.005 s")
    number.get_by_text("read as 5 ms").wait_for()
    number.get_by_role("button", name="Send").click()
    prediction = page.locator('[id="1.3-check--q3"]')
    prediction.get_by_label("discrete").check()
    prediction.get_by_role("button", name="Send").click()
    exercise = page.locator('[id="1.3-exercises--servo-threshold"]')
    exercise.get_by_label("Your script, as a file").set_input_files(SCRIPT)
    exercise.get_by_role("button", name="Hand in").click()
    for card in (number, prediction, exercise):
        card.locator("[data-status]").wait_for(timeout=VERDICT_MS)
    page.locator("[data-lab-of] canvas").wait_for()
    page.wait_for_timeout(1500)
    page.evaluate("document.activeElement.blur(); window.scrollTo(0, 0)")


def main(target: Path) -> None:
    """The page from its top to the first exercise, answered, as a picture."""
    with tempfile.TemporaryDirectory() as data, service(settings_in(Path(data))) as origin, chromium() as browser:
        page = browser.new_page(viewport={"width": WIDTH, "height": 900})
        page.goto(origin)
        answer_everything(page)
        card = page.locator('[id="1.3-exercises--servo-threshold"]').bounding_box()
        assert card is not None
        height = card["y"] + card["height"] + 16
        page.screenshot(path=target, full_page=True, clip={"x": 0, "y": 0, "width": WIDTH, "height": height})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "student-page.png")
