"""A made-up course of ten lessons with every kind, imported from Markdown: checked, served, and looked at.

Another kind of exercise joins by one more `N-name.md` in course/, with its starter and its reference programs.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page

from grader.commands.grade import open_pipeline
from grader.exercises import load_kinds
from grader.grading.checking import check_content
from grader.library import Library, load
from grader.questions import FORMS, Question, installed_kinds, kind_of
from grader.questions.kinds.script import ScriptQuestion
from grader.settings import Settings
from support.command_line import grader
from support.content import PASSED
from web.browsing import chromium, service

ROOT = Path(__file__).parents[2]
COURSE = Path(__file__).with_name("course")
LESSONS = sorted(COURSE.glob("*.md"))
SOURCE = "https://course.example.org/lessons/"
COURSE_S_MAX = 60.0
"""Of the imports and the check, where nothing has passed before."""

FOLDERS = ("models", "starters", "programs", "solutions", "reference_solutions")

GRADER = Path(sys.executable).with_name("grader")

SEEN = {
    "1.1": ["A rod that hangs askew", '<math display="block"', "<samp>0.0", 'data-quiz="1.1-check"', "swing.csv",
            "/lessons/1.2"],
    "1.2": ["<strong>Rest is not equilibrium</strong>", "<td>released</td>", "<samp>5.0", "No contact is found."],
    "2.1": ["The pipeline</h2>", "<li>velocities</li>", 'data-quiz="2.1-check"'],
    "2.2": ['data-lab="2.2-labs"', 'data-quiz="2.2-check"', "Measure it</h2>", 'data-quiz="2.2-exercises"'],
    "3.1": ["<msqrt>", 'data-quiz="3.1-check"', "numbers of your own", 'data-quiz="3.1-drawn"'],
    "3.2": [
        'data-quiz="3.2-check"', 'id="3.2-labs--a-pendulum-with-friction"', "the kind “graph3d” do not run here.",
        f'<a href="{SOURCE}3.2.html"', f'<a href="{SOURCE}3.2.html" rel="noopener noreferrer">Turn the cube',
        'href="https://videos.example.org/42"',
    ],
    "4.1": ['alt="The arm"', 'data-quiz="4.1-exercises"'],
    "5.1": ["5.1-exercises"],
    "6.1": ["6.1-exercises"],
    "7.1": ["7.1-exercises", "<mover>"],
}  # fmt: skip
"""What stands on each page, in this order."""


def import_course(root: Path) -> dict[str, bytes]:
    """Imports every lesson into a content folder, and returns what was written, by path."""
    for lesson in LESSONS:
        number = lesson.name.partition("-")[0]
        source = [] if number == "1.1" else ["--source", f"{SOURCE}{number}.html"]  # it names its own
        done = grader("import", str(lesson), "--out", str(root / "quizzes"), *source)
        assert done.returncode == 0, done.stderr
    written = [*root.glob("quizzes/*"), *root.glob("lessons/*"), *root.glob("images/**/*"), *root.glob("files/**/*")]
    return {str(path.relative_to(root)): path.read_bytes() for path in written if path.is_file()}


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("course")
    shutil.copytree(ROOT / "models", root / "models")
    for folder in FOLDERS:
        shutil.copytree(COURSE / folder, root / folder, dirs_exist_ok=True)
    import_course(root)
    return root


def test_an_import_that_is_repeated_writes_the_same_bytes(content: Path) -> None:
    before = {str(path.relative_to(content)): path.read_bytes() for path in content.rglob("*") if path.is_file()}
    again = import_course(content)
    assert again == {path: before[path] for path in again}
    assert len([path for path in again if path.startswith("lessons/")]) == 10
    assert {path for path in again if path.startswith(("images/", "files/"))} == {
        "images/1.1/fig/arm.png", "images/1.1/fig/rod.svg", "images/4.1/fig/arm.png", "files/1.1/data/swing.csv",
    }  # fmt: skip


def read_questions(library: Library) -> list[tuple[str, Question]]:
    """Returns every question with the id of its quiz."""
    return [(quiz.id, question) for quiz in library.quizzes.values() for question in quiz.questions]


def test_the_course_has_every_kind_and_the_import_keeps_each(content: Path) -> None:
    library = load(content, passed=PASSED)
    questions = read_questions(library)
    assert {kind_of(question) for _, question in questions} == {*installed_kinds().values()}
    assert {question.kind for _, question in questions} == {*installed_kinds()}
    scripts = [question for _, question in questions if isinstance(question, ScriptQuestion)]
    assert {question.check.kind for question in scripts} == {*load_kinds()}
    assert {question.takes for question in scripts} == {*FORMS}
    assert [quiz for quiz, question in questions if getattr(question, "draw", None)] == ["3.1-drawn"]
    kept = [one for file in content.glob("quizzes/*.json") for one in json.loads(file.read_text()).get("questions", ())]
    written = [block for lesson in LESSONS for block in read_blocks(lesson.read_text())]
    assert sorted(map(json.dumps, kept)) == sorted(
        json.dumps(one).replace("fig/", "images/1.1/fig/") for one in written
    )
    assert len(kept) == len(questions)


def read_blocks(lesson: str) -> Iterator[dict[str, Any]]:
    """Yields the questions in the `quiz` and `debug` blocks of a lesson, as their author wrote them."""
    for word, text in re.findall(r"^```(quiz|debug)\n(.*?)^```", lesson, re.DOTALL | re.MULTILINE):
        raw = json.loads(text)
        yield from ({"kind": word} | question for question in raw.get("questions", [raw]) if "q" in question)


@pytest.mark.jail
@pytest.mark.slow
def test_the_course_passes_the_check(content: Path) -> None:
    report = check_content(content, open_pipeline, lambda _: None)
    assert [str(fault) for fault in (*report.faults, *report.undecided)] == []
    programs = [path for path in content.glob("reference_solutions/*/*/*.*") if path.suffix != ".txt"]
    assert len(report.references) == len(programs)
    tried = [(path.parts[-3], path.parts[-2], path.stem.startswith("correct__")) for path in programs]
    scripts = [
        (quiz, one.id) for quiz, one in read_questions(load(content, passed=PASSED)) if isinstance(one, ScriptQuestion)
    ]
    assert {*tried} == {(*script, is_right) for script in scripts for is_right in (True, False)}


@pytest.mark.cost
@pytest.mark.jail
def test_the_course_is_imported_and_checked_in_less_than_a_minute(content: Path, tmp_path: Path) -> None:
    """CPU time of all processes: of so much one core is free in a minute, and of two more."""

    def run(*arguments: str | Path) -> None:
        done = subprocess.run([GRADER, *arguments], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout

    for folder in FOLDERS:
        shutil.copytree(content / folder, tmp_path / folder)
    before = getrusage(RUSAGE_CHILDREN)
    for lesson in LESSONS:
        run("import", lesson, "--out", tmp_path / "quizzes", "--source", f"{SOURCE}{lesson.stem}.html")
    run("check", "--again", tmp_path)
    used = getrusage(RUSAGE_CHILDREN)
    cpu_s = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    print(f"imported and checked in {cpu_s:.1f} s of CPU time")
    assert cpu_s < COURSE_S_MAX


@pytest.fixture(scope="module")
def origin(content: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with service(Settings(data=tmp_path_factory.mktemp("data"), content=content, workers=0)) as origin:
        yield origin


def test_every_page_shows_what_its_author_wrote_in_the_authors_order(origin: str) -> None:
    with httpx.Client(base_url=origin, follow_redirects=True) as client:
        client.post("/session", headers={"Sec-Fetch-Site": "same-origin"})
        listed = client.get("/").text
        places = [listed.index(f'href="/lessons/{number}"') for number in SEEN]
        assert places == sorted(places)
        assert "Lesson 1.1: States and time" in listed
        for number, marks in SEEN.items():
            page = client.get(f"/lessons/{number}")
            body = page.text[page.text.index("<main") :]
            positions = [body.index(mark) for mark in marks]
            assert positions == sorted(positions), number
            assert len(page.content) < 60_000


MISSING = (
    """() => [...document.querySelectorAll('.prose img')].filter(img => !img.complete || !img.naturalWidth).length"""
)
OVERFLOW = "() => document.documentElement.scrollWidth - innerWidth"


@pytest.mark.browser
@pytest.mark.slow
def test_pictures_are_seen_and_nothing_sticks_out_on_a_phone(origin: str) -> None:
    complaints: list[str] = []

    def look(page: Page, number: str) -> None:
        page.goto(f"/lessons/{number}")
        page.wait_for_load_state("networkidle")
        assert page.evaluate(MISSING) == 0, number
        assert page.evaluate(OVERFLOW) <= 0, number
        if folder := os.environ.get("GRADER_TEST_SHOTS"):
            page.screenshot(path=f"{folder}/{number}-{page.viewport_size['width']}.png", full_page=True)  # type: ignore[index]

    with chromium() as browser:
        for width in (1280, 390):
            context = browser.new_context(base_url=origin, viewport={"width": width, "height": 900})
            page = context.new_page()
            page.on("console", lambda message: complaints.append(message.text))
            for number in SEEN if width == 1280 else ("1.1", "1.2", "3.2"):
                look(page, number)
    assert complaints == []


def test_what_is_missing_is_told_with_its_line_and_costs_nothing_else(tmp_path: Path) -> None:
    lines = [
        "# Lesson 8.1", "", "![An arm](fig/arm.png) and [notes](notes.txt)", "", "![Out](../secret.png)", "",
        "[up](../index.html)", "", '<img src="fig/leg.png" alt="A leg">', "", "[arm]: fig/hand.png", "",
        "Then ![a hand][arm].", "", "```quiz", '{"kind": "open", "q": "<img src=\'fig/q.png\' alt=\'Q\'>"}', "```",
    ]  # fmt: skip
    lesson = tmp_path / "lesson/8.1.md"
    lesson.parent.mkdir()
    (tmp_path / "secret.png").write_bytes((COURSE / "fig/arm.png").read_bytes())
    lesson.write_text("\n".join(lines))
    done = grader("import", str(lesson), "--out", str(tmp_path / "content/quizzes"))
    assert done.returncode == 0
    told = [line.split(": ")[2] + ": " + line.split('"')[1] for line in done.stderr.splitlines()]
    assert sorted(told) == [
        "line 11: fig/hand.png", "line 15: fig/q.png", "line 3: fig/arm.png", "line 3: notes.txt",
        "line 5: ../secret.png",
        "line 7: ../index.html", "line 9: fig/leg.png",
    ]  # fmt: skip
    assert not list((tmp_path / "content").rglob("*.png"))
    warned = {(warning.file, warning.key) for warning in load(tmp_path / "content").warnings}
    assert {("lessons/8.1.md", "line 3"), ("lessons/8.1.md", "line 9"), ("quizzes/8.1-check.json", "q1.q")} <= warned
    (lesson.parent / "fig").mkdir()
    shutil.copy(COURSE / "fig/arm.png", lesson.parent / "fig/q.png")
    grader("import", str(lesson), "--out", str(tmp_path / "content/quizzes"))
    assert "images/8.1/fig/q.png" in load(tmp_path / "content").media
