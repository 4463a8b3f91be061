"""Ten minutes of authoring in a real browser, from an empty folder to a student's answer.

Every step leaves a screenshot: `GRADER_TEST_FILM=FOLDER` keeps them.
"""

import json
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from grader.commands.grade import open_pipeline
from grader.courses.people.identity import Role
from grader.courses.people.sign_in import create_sign_in_code
from grader.library import PassedChecks, scaffold
from grader.service.accounts import in_database
from grader.service.authoring import make_app
from grader.settings import Settings
from support.servers import serving
from support.sites import ROOT, Site, open_site
from web.browsing import Chromium

pytestmark = [pytest.mark.browser, pytest.mark.slow]

QUIZ, FILE = "1.2-check", "quizzes/1.2-check.json"
FILM = "GRADER_TEST_FILM"
CHECK_MS = 30_000

CHOICE: dict[str, Any] = {
    "id": "stage",
    "kind": "mcq",
    "q": "Which stage of <code>mj_step</code> computes <code>data.xpos</code>?",
    "options": ["Forward kinematics", "Forward dynamics", "Integration"],
    "answer": 0,
    "whys": ["Positions come first.", "Accelerations come later.", "It reads accelerations."],
    "explain": "<code>mj_kinematics</code> maps joint positions to body poses.",
}
SPEED: dict[str, Any] = {
    "id": "speed",
    "kind": "numeric",
    "q": "The pendulum is let go at 0.5 rad. How fast is it at most, $\\omega = \\sqrt{2 m g L (1 - \\cos 0.5) / I}$?",
    "unit": "rad/s",
    "answer": 2.19,
    "tol": 0.02,
    "verify": {
        "by": "measurement", "model": "pendulum", "setup": "data.qpos[0] = 0.5", "seconds": 2, "expr": "data.qvel[0]",
        "when": "max",
    },
}  # fmt: skip
FALL: dict[str, Any] = {
    "id": "fall",
    "kind": "predict",
    "q": "The double pendulum is let go as the keyframe has it. Where is its tip after a second?",
    "options": ["Below the pivot", "Above the pivot"],
    "answer": 1,
    "whys": ["No: it has swung through and is on its way up again.", "Yes: it has swung through."],
    "verify": {
        "by": "outcome", "seconds": 1, "claims": ["lib.sitePos('tip')[2] < 1", "lib.sitePos('tip')[2] > 1"],
    },
    "sim": {
        "model": "double_pendulum", "key": 0, "seconds": 1,
        "readouts": [{"label": "height (m)", "expr": "lib.sitePos('tip')[2]", "digits": 3}],
    },
}  # fmt: skip
SILENT: list[tuple[str, dict[str, Any], str]] = [
    ("a formula that is not closed", {**CHOICE, "q": "Which stage needs $\\frac{1}{2$?"}, "add it"),
    ("a tag that is not closed", {**CHOICE, "q": "<em>Which stage computes xpos?"}, "<em> is not closed"),
    ("an unknown tag", {**CHOICE, "q": "Which stage computes <cod>xpos</cod>?"}, "did you mean"),
    ("Markdown in HTML", {**CHOICE, "q": "Which stage computes **xpos**?"}, "is Markdown"),
    ("a picture that is not there", {**CHOICE, "q": 'Which? <img src="images/arm.png" alt="An arm">'}, "is not there"),
    ("two equal options", {**CHOICE, "options": ["Kinematics", "Kinematics", "Integration"]}, "is there twice"),
    ("a field by another name", {("anwser" if key == "answer" else key): CHOICE[key] for key in CHOICE}, "'answer'"),
    ("no word on why", {key: CHOICE[key] for key in CHOICE if key != "whys"}, "add a sentence on each option"),
]
"""What an author may write unnoticed elsewhere, and what the desk says of it."""

HOLD = """() => {
  const plain = window.fetch;
  window.fetch = async (address, ...more) => {
    const response = await plain(address, ...more);
    if (window.isLast) await new Promise(() => {});
    if (!String(address).includes("/edit/") || window.release) return response;
    const text = await response.text(); // read to its end, since the cache has the next one wait
    await new Promise((resolve) => { window.release = resolve; });
    return new Response(text);
  };
}"""
"""Holds the first answer with the desk back, until the page's `release()`, and all once `isLast`."""


TYPE_ON = """text => {
  const plain = window.fetch;
  const field = document.querySelector("[data-source]").elements.source;
  window.puts = 0;
  window.fetch = async (address, options) => {
    if (options?.method !== "PUT") return plain(address, options);
    window.puts += 1;
    if (window.puts === 1) { // typed and saved while this one is on its way
      await new Promise((resolve) => setTimeout(resolve));
      field.value = text;
      field.form.requestSubmit();
    }
    return plain(address, options);
  };
  field.value += "\\n";
  field.form.requestSubmit();
}"""
"""Saves, and saves another text before the first answer is there."""


@dataclass
class Author:
    """An author with a folder, an editor of their own for new questions, and the desk in a browser."""

    root: Path
    page: Page
    film: Path
    complaints: list[str]
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    @property
    def said(self) -> Locator:
        """What the check says of the question."""
        return self.page.get_by_role("region", name="Faults").or_(self.page.get_by_role("region", name="Remarks"))

    def shoot(self, name: str) -> None:
        """Adds a picture to the film."""
        name = name.replace(" ", "-").lower()
        self.page.screenshot(path=self.film / f"{next(self.numbers):02}-{name}.png", full_page=True)

    def write_file(self, questions: list[dict[str, Any]], **more: Any) -> None:
        """Saves the quiz in an editor beside the browser."""
        quiz = {"id": QUIZ, "title": "Pendulums", "questions": questions, **more}
        (self.root / FILE).write_text(json.dumps(quiz, indent=2), encoding="utf-8")

    def save(self, question: dict[str, Any]) -> None:
        """Types the source of the question on the page, and saves it."""
        self.page.get_by_label(f"{FILE}: {question['id']}").fill(json.dumps(question, indent=2))
        self.page.get_by_role("button", name="Save").click()

    def expect_said(self, words: str) -> None:
        """The page says so, without being read again."""
        expect(self.said.filter(has_text=words)).not_to_have_count(0, timeout=CHECK_MS)

    def expect_whole(self) -> None:
        """No fault and no remark."""
        expect(self.page.locator("[data-doing]")).to_contain_text("No fault", timeout=CHECK_MS)
        expect(self.said).to_have_count(0, timeout=CHECK_MS)


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """The folder of the screenshots."""
    folder = Path(os.environ[FILM]) if FILM in os.environ else tmp_path / "film"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture
def author(tmp_path: Path, film: Path, browser: Chromium, monkeypatch: pytest.MonkeyPatch) -> Iterator[Author]:
    """An author who has made a lesson by `grader new lesson`, and opened the desk."""
    monkeypatch.setattr("grader.web.author.pages.WAIT_S", 2.0)  # the server ends when the last request has
    root = tmp_path / "course"
    scaffold.begin_quiz(root, QUIZ, "Pendulums")
    shutil.copytree(ROOT / "models", root / "models")
    with serving(make_app(root, PassedChecks(tmp_path / "passed"), open_pipeline)) as origin:
        context = browser.new_context(base_url=origin, viewport={"width": 1280, "height": 900})
        page, complaints = context.new_page(), list[str]()
        page.on("console", lambda message: complaints.append(f"{message.text} {message.location['url']}"))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        yield Author(root, page, film, complaints)
        context.close()


def test_from_an_empty_folder_to_an_answer(author: Author, browser: Chromium, tmp_path: Path) -> None:
    write_a_first_question(author)
    mend_what_is_silent_elsewhere(author)
    correct_a_key_that_the_physics_refutes(author)
    add_a_prediction(author)
    assert [complaint for complaint in author.complaints if "arm.png" not in complaint] == []
    with open_site(Settings(content=author.root, data=tmp_path / "data", workers=0)) as site:
        author.write_file([{**CHOICE, "label": "Warm-up"}, SPEED, FALL])
        publish(author, site, browser)
        answer(author, site, browser)


def test_a_page_that_was_fetched_before_a_save_replaces_nothing(author: Author) -> None:
    author.write_file([CHOICE])
    author.page.goto(f"/edit/{QUIZ}/stage")
    author.expect_whole()
    author.page.evaluate(HOLD)
    (author.root / "models/pendulum.xml").touch()
    while not author.page.evaluate("Boolean(window.release)"):
        author.page.wait_for_timeout(50)
    _, question, words = SILENT[1]
    author.save(question)
    author.expect_said(words)
    author.page.evaluate("window.isLast = true, window.release()")
    author.page.wait_for_timeout(500)
    author.expect_said(words)
    assert "<em>Which" in author.page.get_by_label(f"{FILE}: stage").input_value()


def test_a_slip_leaves_the_question_in_the_box_and_the_others_in_the_file(author: Author) -> None:
    author.write_file([CHOICE, SPEED])
    author.page.goto(f"/edit/{QUIZ}/stage")
    author.expect_whole()
    box, good = author.page.get_by_label(f"{FILE}: stage"), json.dumps(CHOICE, indent=2)
    box.fill(good.replace(",", "", 1))
    author.page.get_by_role("button", name="Save").click()
    author.expect_said("broken JSON")
    assert box.input_value() == good.replace(",", "", 1)
    box.fill(good)
    author.page.get_by_role("button", name="Save").click()
    author.expect_whole()
    assert [question["id"] for question in json.loads((author.root / FILE).read_text())["questions"]] == [
        "stage",
        "speed",
    ]


def test_two_clicks_save_once_and_what_is_typed_meanwhile_is_saved_too(author: Author) -> None:
    author.write_file([CHOICE, SPEED])
    author.page.goto(f"/edit/{QUIZ}/stage")
    author.expect_whole()
    sent: list[str] = []
    author.page.on("request", lambda request: sent.append(request.method) if request.method == "PUT" else None)
    author.page.get_by_label(f"{FILE}: stage").fill(json.dumps({**CHOICE, "q": "Which stage computes poses?"}))
    author.page.get_by_role("button", name="Save").dblclick()
    expect(author.page.locator("[data-source] [data-trouble]")).to_have_text("Saved.")
    assert sent == ["PUT"]
    author.page.evaluate(TYPE_ON, json.dumps({**CHOICE, "q": "Which stage, then?"}))
    expect(author.page.locator("[data-source] [data-trouble]")).to_have_text("Saved.")
    author.page.wait_for_function("() => window.puts === 2")
    author.page.wait_for_timeout(500)
    expect(author.page.locator("[data-source] [data-trouble]")).to_have_text("Saved.")
    assert json.loads((author.root / FILE).read_text())["questions"][0]["q"] == "Which stage, then?"


def test_another_question_of_the_file_may_change_while_one_is_typed(author: Author) -> None:
    author.write_file([CHOICE, SPEED])
    author.page.goto(f"/edit/{QUIZ}/speed")
    author.expect_whole()
    said = author.page.locator("[data-source] [data-trouble]")
    typed = json.dumps({**SPEED, "q": "How fast is it at most?"})
    author.page.get_by_label(f"{FILE}: speed").fill(typed)
    tag = author.page.locator("[name=tag]").input_value()
    author.write_file([{**CHOICE, "q": "Which stage of the two computes poses?"}, SPEED])
    author.page.wait_for_function("tag => document.querySelector('[name=tag]').value !== tag", arg=tag)
    expect(said).to_be_empty()
    author.page.get_by_role("button", name="Save").click()
    expect(said).to_have_text("Saved.")
    assert typed in (author.root / FILE).read_text() and "of the two" in (author.root / FILE).read_text()
    author.page.get_by_label(f"{FILE}: speed").fill(json.dumps(SPEED))
    author.write_file([CHOICE])
    expect(said).to_contain_text("deleted, or has another id")
    assert "at most, $" in author.page.get_by_label(f"{FILE}: speed").input_value()
    author.write_file([CHOICE, {**SPEED, "q": "How fast is it at most?"}])
    expect(said).to_contain_text("has changed on the disk")


def test_a_faulty_id_is_saved_and_named(author: Author) -> None:
    author.write_file([CHOICE, SPEED])
    author.page.goto(f"/edit/{QUIZ}/stage")
    author.expect_whole()
    here = author.page.get_by_role("navigation", name="Questions").locator("[aria-current]")
    box = author.page.locator("#source")
    for id_ in ("θ1", "a/b", "../..", "speed"):
        box.fill(json.dumps({**CHOICE, "id": id_}))
        author.page.get_by_role("button", name="Save").click()
        author.expect_said(f"{id_}.id")
        expect(here).to_have_text(id_)
        expect(author.page.get_by_role("heading", level=1)).to_have_text(f"{FILE}: {id_}")
        expect(author.page.locator("[data-source] .bad")).to_have_count(0)
    author.save({**CHOICE, "id": "speed", "q": "Which stage?"})
    box.fill(json.dumps(CHOICE))
    author.page.get_by_role("button", name="Save").click()
    expect(author.page).to_have_url(re.compile(f"/edit/{QUIZ}/stage$"))
    author.expect_whole()


def test_a_bracket_that_is_missing_is_told_with_its_line_in_the_box(author: Author) -> None:
    author.write_file([CHOICE, SPEED])
    author.page.goto(f"/edit/{QUIZ}/stage")
    author.expect_whole()
    box, good = author.page.get_by_label(f"{FILE}: stage"), json.dumps(CHOICE, indent=2)
    box.fill(good.removesuffix("}"))
    author.page.get_by_role("button", name="Save").click()
    author.expect_said("a { has no }: add it")
    author.expect_said(f"line {good.count(chr(10))}, column")
    author.page.set_viewport_size({"width": 390, "height": 800})
    row = author.said.locator("tbody tr")
    assert row.evaluate("row => getComputedStyle(row).display") == "block"
    widths = row.locator("th, td").evaluate_all("cells => cells.map(cell => cell.getBoundingClientRect().width)")
    assert min(widths) > 250, "each cell has the whole width"
    author.shoot("remarks on a phone")


def write_a_first_question(author: Author) -> None:
    author.page.goto("/")
    author.expect_whole()
    author.shoot("a new lesson")
    author.write_file([CHOICE])
    author.page.goto(f"/edit/{QUIZ}/stage")
    author.expect_whole()
    author.page.get_by_role("link", name="Wrong", exact=True).click()
    expect(author.page.locator("[data-shown]")).to_contain_text("later")
    author.shoot("as a student sees it")
    author.page.goto(f"/edit/{QUIZ}/stage")


def mend_what_is_silent_elsewhere(author: Author) -> None:
    for name, question, words in SILENT:
        author.save(question)
        author.expect_said(words)
        author.shoot(name)
        author.save(CHOICE)
        author.expect_whole()
    other = author.root / "quizzes/more.jsn"
    other.write_text("{}")
    author.expect_said("rename it")
    author.shoot("a file by another ending")
    other.unlink()
    author.expect_whole()
    author.write_file([CHOICE], policy={"due": "tomorrow"})
    author.expect_said("with its offset")
    author.shoot("a date without a zone")
    author.write_file([CHOICE])
    author.expect_whole()


def correct_a_key_that_the_physics_refutes(author: Author) -> None:
    author.write_file([CHOICE, SPEED])
    author.page.goto(f"/edit/{QUIZ}/speed")
    for name, question, words in [
        ("a key in another unit", {**SPEED, "unit": "deg/s"}, "deg/s"),
        ("an expression of nothing", {**SPEED, "verify": {**SPEED["verify"], "expr": "data.qpos[70]"}}, "70"),
        ("a key that is refuted", {**SPEED, "answer": 3.1}, "refuted: derived 2.19"),
    ]:
        author.save(question)
        author.expect_said(words)
        author.shoot(name)
    author.save(SPEED)
    author.expect_whole()
    expect(author.page.get_by_role("heading", name="Key:")).to_contain_text("certified", timeout=CHECK_MS)
    author.shoot("a key that holds")


def add_a_prediction(author: Author) -> None:
    author.write_file([CHOICE, SPEED, FALL])
    author.page.goto(f"/edit/{QUIZ}/fall")
    author.save({**FALL, "answer": 0})
    author.expect_said("'Above the pivot' came out right")
    author.save(FALL)
    author.expect_whole()
    author.shoot("a prediction")


def publish(author: Author, site: Site, browser: Chromium) -> None:
    author.write_file([CHOICE, SPEED, FALL])
    page = browser.new_context(base_url=site.origin).new_page()
    code = in_database(site.settings, lambda session: create_sign_in_code(session, "tina", Role.INSTRUCTOR))
    page.goto(f"/signin?code={code}")
    page.get_by_role("button", name="Sign in").click()
    author.write_file([{**CHOICE, "label": "Warm-up"}, SPEED, FALL])
    page.goto("/instructor/draft")
    author.page = page
    author.shoot("what publishing changes")
    page.get_by_role("button", name="Publish").click()
    expect(page).to_have_url(f"{site.origin}/instructor/content?loaded=published")
    author.shoot("published")


def answer(author: Author, site: Site, browser: Chromium) -> None:
    page = browser.new_context(base_url=site.origin).new_page()
    author.page = page
    page.goto("/lessons/1.2")
    question = page.locator("section, article, form").filter(has_text="How fast is it at most").last
    question.get_by_role("textbox").fill("125.5 deg/s")
    question.get_by_role("button", name="Send").click()
    expect(page.get_by_text("read as 2.19").first).to_be_visible()
    author.shoot("a students answer")
