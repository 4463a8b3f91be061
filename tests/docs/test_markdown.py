"""The quiz on docs/markdown.md loads without a remark, is certified and graded; its fault is what is told."""

import re
from pathlib import Path

import pytest

from grader.certify.keys import certify_quizzes
from grader.errors import ContentError
from grader.grading.pipeline import Pipeline
from grader.library import load
from grader.library.markdown.slips import FENCES, TEXTS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/markdown.md").read_text(encoding="utf-8")
AUTHORING = (ROOT / "docs/authoring.md").read_text(encoding="utf-8")
QUIZ = re.findall(r"````markdown\n(.*?)````", PAGE, re.DOTALL)[0]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A content folder with the quiz of the page, and the model of the other page."""
    model = re.findall(r"`models/cart.xml`:\n\n```xml\n(.*?)```", AUTHORING, re.DOTALL)[0]
    for name, text in {"quizzes/4.2-check.md": QUIZ, "models/cart.xml": model,
                       "programs/double.py": "def double(x):\n    return 2 * x\n"}.items():  # fmt: skip
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def test_the_quiz_of_the_page_is_certified_and_graded(folder: Path) -> None:
    library = load(folder)
    quiz = library.quiz("4.2-check")
    assert [question.kind for question in quiz.questions] == ["mcq", "numeric", "predict", "open", "code"]
    assert library.warnings == ()
    assert quiz.default_policy.attempts == 3
    assert [
        certified.certificate.verdict for certified in certify_quizzes(library, ["4.2-check"]) if certified.certificate
    ] == ["certified"]
    assert Pipeline(library).grade("4.2-check", "period", "2.0 s").points == 2


def test_the_fault_of_the_page_is_what_is_told(folder: Path) -> None:
    (told,) = re.findall(r"`(quizzes/4.2-check.md: line 12: .*)`", PAGE.replace("`,\n`", ""))
    (folder / "quizzes/4.2-check.md").write_text(QUIZ.replace("[x] Position", "[ ] Position"))
    with pytest.raises(ContentError) as caught:
        load(folder)
    assert told in map(str, caught.value.faults)


def test_every_fence_and_heading_is_on_the_page() -> None:
    for name in FENCES:
        assert f"| fence `{name}` |" in PAGE
    for name in TEXTS:
        assert f"`### {name}`" in PAGE
