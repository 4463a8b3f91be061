"""Content that `grader new` begins can be loaded, and its keys hold."""

import json
from pathlib import Path

import pytest

from grader.certify.keys import find_refused_keys
from grader.library import load
from grader.library.scaffold import SCHEMA, find_exercise, list_scripts, list_shipped
from grader.questions import installed_kinds
from grader.questions.kinds.script import ScriptQuestion
from grader.settings import default_content, find_content
from support.command_line import grader

EXERCISES = sorted({sample.question["check"]["kind"] for sample in (*list_scripts(), *list_shipped())})


@pytest.fixture
def course(tmp_path: Path) -> Path:
    folder = tmp_path / "mechanics"
    done = grader("new", "course", str(folder))
    assert done.returncode == 0
    assert done.stdout.split() == [str(folder / SCHEMA), str(folder / "quizzes" / "1.1-check.json")]
    return folder


def list_ids(course: Path) -> list[str]:
    library = load(course)
    assert list(find_refused_keys(library, library.quizzes)) == []
    return [question.id for question in library.quiz("1.1-check").questions]


def test_a_new_course_has_a_question(course: Path) -> None:
    assert list_ids(course) == ["mcq"]
    quiz = json.loads((course / "quizzes" / "1.1-check.json").read_text())
    assert (course / "quizzes" / quiz["$schema"]).resolve() == course / SCHEMA


def test_a_new_course_in_markdown_says_what_to_run_next(tmp_path: Path) -> None:
    folder = tmp_path / "two words"
    done = grader("new", "course", str(folder), "--markdown")
    assert (done.returncode, done.stdout.strip()) == (0, str(folder / "quizzes" / "1.1-check.md"))
    assert f"`grader author '{folder}'`" in done.stderr
    assert f"`grader check '{folder}'`" in done.stderr
    assert list_ids(folder) == ["mcq"]


def test_commands_in_a_content_folder_are_about_it(course: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GRADER_CONTENT", raising=False)
    monkeypatch.chdir(course)
    done = grader("check", "--only", "1.1-check")
    assert (done.returncode, f"the content folder is {course}" in done.stderr) == (0, True), done.stderr
    assert grader("grade", "1.1-check", "mcq", "0").returncode == 0
    absent = grader("check", "--only", "1.1-chek")
    assert "--only: 1.1-chek: is not there: take one of 1.1-check" in absent.stdout
    monkeypatch.chdir(course.parent)
    assert find_content() == default_content()


def test_every_kind_of_question_can_be_added_twice(course: Path) -> None:
    for kind in installed_kinds():
        for _ in range(2):
            assert grader("new", "question", kind, "1.1-check", "--in", str(course)).returncode == 0, kind
    ids = list_ids(course)
    assert {*installed_kinds()} <= {*ids}
    assert len(ids) == len({*ids}) == 1 + 2 * len(installed_kinds())


@pytest.mark.parametrize("kind", EXERCISES)
def test_an_exercise_comes_with_a_reference_program(course: Path, kind: str) -> None:
    assert grader("new", "exercise", kind, "1.1-check", "--in", str(course)).returncode == 0
    _, id_ = list_ids(course)
    assert len([*(course / "reference_solutions" / "1.1-check" / id_).glob("correct__example.*")]) == 1
    assert (course / "models").is_dir()


def test_a_named_exercise_begins_its_quiz_and_names_its_files(course: Path) -> None:
    done = grader("new", "exercise", "values", "1.1-exercises/distance", "--in", str(course))
    reference = "reference_solutions/1.1-exercises/distance/correct__example.py"
    named = ["quizzes/1.1-exercises.json", "starters/distance.py", "programs/distance.py", reference]
    assert done.stdout.split() == [str(course / name) for name in named]
    library = load(course)
    assert [question.id for question in library.quiz("1.1-exercises").questions] == ["distance"]
    assert library.quiz("1.1-exercises").title == "Exercises"
    assert all("def distance(" in (course / name).read_text() for name in named[1:])


@pytest.mark.parametrize("kind", EXERCISES)
def test_a_named_exercise_can_be_loaded_and_says_what_it_said(course: Path, kind: str) -> None:
    """The name of the function is a word of its texts too: `control` is a form, a swing what is measured."""
    assert grader("new", "exercise", kind, "1.1-exercises/mine", "--in", str(course)).returncode == 0
    (question,) = load(course).quiz("1.1-exercises").questions
    shipped = find_exercise(kind).question
    old = shipped.get("entry")
    assert question.q == (shipped["q"] if old is None else shipped["q"].replace(f"{old}(", "mine("))
    assert old is None or (isinstance(question, ScriptQuestion) and question.entry == "mine")


def test_a_lesson_is_added(course: Path) -> None:
    assert grader("new", "lesson", "2.1-check", "--title", "Contact", "--in", str(course)).returncode == 0
    assert load(course).quiz("2.1-check").title == "Contact"


def test_a_starter_is_named_for_its_exercise_and_says_so(course: Path) -> None:
    for quiz, question in (("2.1", "how-far"), ("2.2", "how-fast")):
        assert grader("new", "exercise", "claims", f"{quiz}/{question}", "--in", str(course)).returncode == 0
        assert f"python {question.replace('-', '_')}.py\n" in (course / f"quizzes/starters/{question}.py").read_text()
    again = grader("new", "exercise", "controller", "2.3/how-far", "--in", str(course))
    assert (again.returncode, "how-far.py is there already, and is another one: choose another id" in again.stderr) == (
        2, True
    )  # fmt: skip


def test_a_mistyped_folder_is_not_begun(course: Path) -> None:
    nowhere = course.parent / "mechancis"
    for words in (
        ["lesson", "2.1"],
        ["question", "mcq", "2.1"],
        ["exercise", "claims", "2.1"],
        ["lab", "simlab", "2.1"],
    ):
        done = grader("new", *words, "--in", str(nowhere))
        assert (done.returncode, done.stdout) == (2, "")
        assert f"{nowhere}: no content folder here" in done.stderr
    assert not nowhere.exists()


def test_what_is_there_stays(course: Path) -> None:
    model = course / "models" / "pendulum_servo.xml"
    model.parent.mkdir()
    model.write_text("<mujoco/>")
    before = (course / "quizzes" / "1.1-check.json").read_text()
    for told, *arguments in (
        ("name a new folder", "course", str(course)),
        ("1.1-check.json is there already", "lesson", "1.1-check", "--in", str(course)),
        ("is no id", "lesson", "a lesson", "--in", str(course)),
        ("is no id", "question", "mcq", "no id", "--in", str(course)),
        ("is no id", "question", "mcq", "1.1-check/", "--in", str(course)),
        ("has a question 'mcq' already", "question", "numeric", "1.1-check/mcq", "--in", str(course)),
        ("There is no quiz '9.9'", "lab", "simlab", "9.9", "--in", str(course)),
        ("no kind of question 'quiz'", "question", "quiz", "1.1-check", "--in", str(course)),
        ("there are examples of", "exercise", "quiz", "1.1-check", "--in", str(course)),
        ("rename it first", "exercise", "threshold", "1.1-check", "--in", str(course)),
        ("rename it first", "exercise", "threshold", "1.1-exercises", "--in", str(course)),
    ):
        done = grader("new", *arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert told in done.stderr
    assert (course / "quizzes" / "1.1-check.json").read_text() == before
    assert not (course / "quizzes" / "1.1-exercises.json").exists()
    (course / "quizzes" / "2.1.json").write_text("{")
    assert "2.1.json" in grader("new", "question", "mcq", "2.1", "--in", str(course)).stderr
