"""Numbers of a learner's own in a browser: nobody is judged by numbers that the page did not show."""

import math
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from grader.settings import Settings
from support.sites import ROOT, write_content
from web.browsing import Chromium, service

QUIZ = "2.1-drawn"
OWN = "These numbers are yours"


@pytest.fixture
def page(browser: Chromium, tmp_path: Path) -> Iterator[Page]:
    """The quiz, as somebody sees it who has sent nothing yet."""
    content = write_content(tmp_path / "content")
    shutil.copy(ROOT / f"quizzes/{QUIZ}.json", content / "quizzes")
    with service(Settings(content=content, data=tmp_path / "data", workers=0)) as origin:
        context = browser.new_context(base_url=origin)
        page = context.new_page()
        page.goto(f"/?quiz={QUIZ}")
        yield page
        context.close()


def card(page: Page, question: str) -> Locator:
    return page.locator(f'[id="{QUIZ}--{question}"]')


def test_the_first_answer_brings_the_own_numbers_of_all_questions(page: Page) -> None:
    speed, rest = card(page, "speed"), card(page, "rest")
    expect(speed).to_contain_text("these are in the middle. Press Send once to get yours: that uses no attempt.")
    before = speed.locator(".prose").first.inner_text()
    speed.locator("input[type=text]").fill("6.038")
    rest.get_by_role("button", name="Send").click()
    expect(rest.locator("[data-trouble]")).to_contain_text("From now on this question has numbers of your own")
    expect(speed.locator("[data-trouble]")).to_have_text("These numbers are yours: read it again.")
    for each in (rest, speed):
        expect(each.locator("[data-numbers]")).to_contain_text(OWN)
    text = speed.locator(".prose").first.inner_text()
    assert text != before
    expect(speed.locator("[data-status]")).to_have_count(0)

    [angle] = re.findall(r"let go\s+at\s+([\d.]+)\s+rad", text)
    right = math.sqrt(2 * 9.81 * 0.5 * (1 - math.cos(float(angle))) / 0.2501)
    speed.locator("input[type=text]").fill(f"{right:.4f}")
    speed.get_by_role("button", name="Send").click()
    expect(speed.locator("[data-status]")).to_have_text("Correct")
