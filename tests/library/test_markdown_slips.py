"""What an author of Markdown has slipped in is a fault with its line and its cure, and no text that learners see."""

import json
from pathlib import Path

import pytest

from grader.errors import ContentError
from grader.importing.lesson import import_lesson
from grader.library.conversion import write_converted
from grader.library.markdown import read_markdown, write_markdown
from grader.library.question_text import find_question

HEAD = "---\ntitle: T\n---\n\n## How long? {#a}\n\nIt swings.\n\n"
QUIZ = '{"q": "Q?", "options": ["yes", "no"], "answer": 0}'
ANSWER = "Answer: 5 s ± 0.1\n\n"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (f"{ANSWER}### explanation\n\nWhy.", "write ### Explanation"),
        (f"{ANSWER}### Explanation:\n\nWhy.", "write ### Explanation"),
        (f"{ANSWER}#### Explanation\n\nWhy.", "write ### Explanation"),
        (f"{ANSWER}## Explanation\n\nWhy.", "write ### Explanation"),
        ("### Referenz\n\nThis.", "write ### Reference"),
        ("How long?\nAnswer: 5 s", "an answer stands in the text"),
        ("answer: 5 s", "an answer stands in the text"),
        ("**Answer:** 5 s", "an answer stands in the text"),
        ("### Explanation\n\nWhy.\n\nAnswer: 5 s", "move them above"),
        ("### Explanation\n\nWhy.\n\n- [x] a\n- [ ] b", "move them above"),
        ("- [x]a\n- []b", "an option stands in the text"),
        ("    - [x] a\n    - [ ] b", "indented by four blanks"),
        ("Which?\n    - [x] a\n    - [ ] b", "an option stands in the text"),
        ("- [x] a\n- [ ]", "option 2 is empty"),
        (f'{ANSWER}```json verfy\n{{"by": "hand"}}\n```', "did you mean verify?"),
        (f"```python\nx = 1\n\n{ANSWER}## Next\n\nText.", "this fence never ends: close it with ```"),
        ("Answer: 1/3 m", "'1/3 m' is no number"),
        ("Answer: 5,5 m", "'5,5 m' is no number"),
        ("Answer: 12 500 N", "'12 500 N' is no number"),
        ("Answer: 5×10^-3 s", "is no number"),
        ("It has two wheels\n---\n\nAnswer: 5 s", "makes a heading of the text above it"),
        ("| a | b |\n|---|---|\n| $|k|$ | N/m |\n\nAnswer: 5 s", "in line 11 has 4 cells, its head 2"),
    ],
)
def test_a_slip_is_a_fault(text: str, why: str) -> None:
    read = read_markdown(f"{HEAD}{text}\n", "quizzes/1-a.md")
    assert read.raw is None
    assert any(why in fault.why for fault in read.faults), read.faults


@pytest.mark.parametrize(
    ("text", "question"),
    [
        (ANSWER, {"answer": 5, "unit": "s", "tol": 0.1}),
        ("Answer: 5 1/s", {"answer": 5, "unit": "1/s"}),
        ("<!-- checked by hand: 5 s -->\n\nAnswer: 5 s", {"answer": 5, "q": "It swings."}),
        ("A <!-- 5 s --> cart.\n\nAnswer: 5 s", {"answer": 5, "q": "<p>It swings.</p><p>A  cart.</p>"}),
        (f"{ANSWER}### Explanation\n\nAnswer: because it swings.", {"explain": "<p>Answer: because it swings.</p>"}),
        ("See [x](https://a.example).\n\n- [x](https://a.example) is one\n\nAnswer: 5 s", {"answer": 5}),
        ("```text\nAnswer: none\n```\n\nAnswer: 5 s", {"answer": 5}),
        ("```text\n- [x] a\n```\n\nAnswer: 5 s", {"answer": 5}),
        ("| a | b |\n|:--|--:|\n| $\\|k\\|$ | N/m |\n\nAnswer: 5 s", {"answer": 5}),
        ("1. First.\n2. Second.\n\n- A point.\n\nAnswer: 5 s", {"answer": 5}),
        ("> ```python\n> x = 1\n> ```\n\nAnswer: 5 s", {"answer": 5}),
    ],
)
def test_what_is_meant_as_it_stands_is_none(text: str, question: dict[str, object]) -> None:
    read = read_markdown(f"{HEAD}{text}\n", "quizzes/1-a.md")
    assert read.faults == ()
    assert read.raw is not None
    (one,) = read.raw["questions"]
    assert question.items() <= one.items()
    assert "style=" not in one["q"] and "<!--" not in one["q"]


@pytest.mark.parametrize(
    "text", ["<!-- to do", "<pre>x", "<script>", "<style>", "<textarea>", "<?", "<![CDATA[", "x<![0] true?", "<div>"]
)
def test_a_text_that_takes_in_what_follows_stays_in_its_place(tmp_path: Path, text: str) -> None:
    questions = [
        {"kind": "open", "q": text, "explain": text},
        {"kind": "numeric", "q": "How long?", "answer": 2, "unit": "s", "tol": 0.1},
    ]
    quiz = {"id": "1-a", "title": "T", "questions": questions}
    assert read_markdown(write_markdown(quiz), "quizzes/1-a.md").raw == quiz
    (tmp_path / "quizzes").mkdir()
    file = tmp_path / "quizzes/1-a.json"
    file.write_text(json.dumps(quiz))
    write_converted(file)
    write_converted(file.with_suffix(".md"))
    assert json.loads(file.read_text()) == quiz


@pytest.mark.parametrize("word", ["quizz", "Quiz"])
def test_a_quiz_that_the_import_would_leave_in_the_text_is_a_fault(word: str) -> None:
    with pytest.raises(ContentError) as refused:
        import_lesson(f"# Lesson\n\n```{word}\n{QUIZ}\n```\n", "6.1-x")
    assert f"line 3: a block '{word}' is read as text, with its answers" in str(refused.value)


def test_a_quiz_in_a_quotation_is_remarked() -> None:
    lesson = import_lesson(f"# Lesson\n\n> ```quiz\n> {QUIZ}\n> ```\n", "6.1-x")
    assert [remark.why for remark in lesson.remarks] == ["a quiz in a quotation stays text: take the > away to ask it"]


@pytest.mark.parametrize("character", ["\u2028", "\x0b", "\x0c", "\x85"])
def test_a_question_is_found_behind_what_only_python_takes_for_the_end_of_a_line(character: str) -> None:
    text = f"{HEAD}A{character}B\n\n## Two {{#b}}\n\nWhy?\n"
    begin, end = find_question(text, "b", "quizzes/1-a.md")
    assert text[begin:end] == "## Two {#b}\n\nWhy?"
