"""Takes docs/student-page.png: `PYTHONPATH=tests python -m web.screenshot`. Not a test; run by hand."""

import sys
import tempfile
from pathlib import Path

from web.browsing import chromium, service, settings_in

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "reference_solutions/1.3-exercises/servo-threshold/correct__the_lessons_script_and_a_bisection.py"
VERDICT_MS = 60_000
WIDTH, MARGIN = 1280, 24


def main(target: Path) -> None:
    """The page of an exercise, from its top to the stability map of the verdict, as a picture."""
    with tempfile.TemporaryDirectory() as data, service(settings_in(Path(data))) as origin, chromium() as browser:
        page = browser.new_page(viewport={"width": WIDTH, "height": 900}, reduced_motion="reduce")
        page.goto(f"{origin}/quizzes/1.3-exercises/servo-threshold")
        page.locator("textarea.code").fill(SCRIPT.read_text(encoding="utf-8"))
        page.get_by_role("button", name="Run and judge").click()
        page.locator("#result [data-status]").wait_for(timeout=VERDICT_MS)
        page.wait_for_timeout(1000)
        page.evaluate("document.activeElement.blur(); scrollTo(0, 0); document.querySelector('textarea').scrollTop = 0")
        page.mouse.move(0, 0)
        figure = page.locator("figure").first.bounding_box()
        assert figure is not None
        height = figure["y"] + figure["height"] + MARGIN
        page.screenshot(path=target, full_page=True, clip={"x": 0, "y": 0, "width": WIDTH, "height": height})


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "student-page.png")
