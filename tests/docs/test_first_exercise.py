"""The course of docs/first-exercise.md passes the check as it stands on the page, and its mistake is named."""

import re
from pathlib import Path

import pytest

from grader.certify.keys import certify_quizzes
from grader.library import load
from support.command_line import grader

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/first-exercise.md").read_text(encoding="utf-8")
FILES = re.findall(r"`([\w./-]+\.\w+)`:\n\n```(?:xml|json|markdown|python)\n(.*?)^```", PAGE, re.DOTALL | re.M)
WRONG = "reference_solutions/1.1-exercises/distance/incorrect__no_half.py"
EXERCISE = FILES[:6]


@pytest.fixture
def course(tmp_path: Path) -> Path:
    """The course after the steps of the page."""
    folder = tmp_path / "friction"
    assert grader("new", "course", str(folder)).returncode == 0
    assert grader("new", "exercise", "values", "1.1-exercises/distance", "--in", str(folder)).returncode == 0
    begun = {str(file.relative_to(folder)) for file in folder.rglob("*.*") if file.is_file()}
    assert {name for name, _ in EXERCISE} - begun == {"programs/no_half.py", WRONG}, "files that the page calls new"
    for name, text in FILES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def test_every_file_of_the_page_is_read() -> None:
    assert len(FILES) == len(re.findall(r"^```(?:xml|json|markdown|python)$", PAGE, re.MULTILINE)) == 9


def test_the_page_is_read_in_a_few_minutes() -> None:
    words = re.sub(r"^```.*?^```", "", PAGE, flags=re.DOTALL | re.MULTILINE).split()
    assert len(words) < 800, "four minutes at 200 words a minute"


def test_the_course_loads_and_its_keys_are_certified(course: Path) -> None:
    library = load(course)
    assert library.warnings == ()
    assert set(library.lessons) == {"1.1"}
    certified = [one.certificate for one in certify_quizzes(library, library.quizzes) if one.key.verify]
    assert [certificate.why for certificate in certified if certificate is not None and not certificate.ok] == []
    assert len(certified) == 3 and None not in certified


@pytest.mark.slow
def test_the_check_holds_and_the_mistake_is_named(course: Path) -> None:
    done = grader("check", str(course))
    assert (done.returncode, done.stdout) == (0, ""), done.stdout
    assert "incorrect__no_half.py: incorrect" in done.stderr
    assert "programs/no_half.py is incorrect: The kinetic energy" in done.stderr


@pytest.mark.parametrize("change", [("0.51,", "1.02,"), ('"unit": "m"', '"unit": "cm"')])
def test_the_mistakes_of_the_table_are_told(course: Path, change: tuple[str, str]) -> None:
    file = course / "quizzes/1.1-check.json"
    file.write_text(file.read_text(encoding="utf-8").replace(*change, 1), encoding="utf-8")
    told = grader("check", str(course), "--only", "1.1-check/stop").stdout
    assert ("refuted: derived 0.5" if change[0] == "0.51," else "and the unit is cm: convert one") in told
