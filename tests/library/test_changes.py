"""What a content folder changes, question by question."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from grader.library import load
from grader.library.changes import ADDED, CHANGED, REMOVED, Change, list_changes
from grader.library.edits import list_edits

XML = "<mujoco><worldbody><body><joint name='{}'/><geom size='.1'/></body></worldbody></mujoco>"
NUMBER: dict[str, Any] = {"kind": "numeric", "id": "n", "q": "How much?", "answer": 1.0}
CHOICE: dict[str, Any] = {"kind": "mcq", "id": "c", "q": "Which?", "options": ["a", "b"], "answer": 0}
LAB: dict[str, Any] = {"id": "l", "model": "one", "readouts": [{"label": "t", "expr": "data.time"}]}
QUIZ: dict[str, Any] = {"id": "a", "title": "A", "questions": [NUMBER, CHOICE], "labs": [LAB]}
SCRIPT: dict[str, Any] = {
    "kind": "code", "id": "s", "q": "Write it.", "entry": "f", "starter": "quizzes/s.py",
    "check": {"kind": "rk4", "cases": [{"id": "a", "model": "one", "steps": 2, "timestep_s": 0.01}]},
}  # fmt: skip

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a folder of quizzes, each a JSON object."""

    def write(name: str, *quizzes: dict[str, Any], joint: str = "j", starter: str = "") -> Path:
        folder = tmp_path / name
        for place in ("quizzes", "models"):
            (folder / place).mkdir(parents=True)
        (folder / "models/one.xml").write_text(XML.format(joint))
        (folder / "quizzes/s.py").write_text(starter or "def f(): ...\n")
        for quiz in quizzes:
            (folder / f"quizzes/{quiz['id']}.json").write_text(json.dumps(quiz))
        return folder

    return write


def test_the_same_files_change_nothing(write: Write) -> None:
    assert list_changes(load(write("one", QUIZ)), load(write("two", QUIZ))) == []


def test_quizzes_questions_and_labs_come_change_and_go(write: Write) -> None:
    before = load(write("one", QUIZ, {**QUIZ, "id": "gone"}))
    changed = {**NUMBER, "answer": 2.0, "q": "How many?"}
    after = load(
        write("two", {**QUIZ, "title": "B", "questions": [changed, {**CHOICE, "id": "d"}], "labs": []},
              {**QUIZ, "id": "new"})
    )  # fmt: skip
    assert list_changes(before, after) == [
        Change("a", "", CHANGED, ("title",)),
        Change("a", "n", CHANGED, ("q", "answer")),
        Change("a", "d", ADDED),
        Change("a", "c", REMOVED),
        Change("a", "l", REMOVED, is_question=False),
        Change("new", "", ADDED),
        Change("gone", "", REMOVED),
    ]


def test_another_order_is_a_change_of_the_quiz(write: Write) -> None:
    changes = list_changes(load(write("one", QUIZ)), load(write("two", {**QUIZ, "questions": [CHOICE, NUMBER]})))
    assert changes == [Change("a", "", CHANGED, ("order of the questions",))]


@pytest.mark.parametrize(
    ("key", "value", "is_silent"),
    [("explain", "So.", True), ("q", "How many?", True), ("tol", 0.5, False), ("answer", 2.0, False),
     ("points", 2.0, False), ("unit", "s", False)],
)  # fmt: skip
def test_a_change_of_texts_alone_alters_no_verdict(write: Write, key: str, value: object, *, is_silent: bool) -> None:
    after = load(write("two", {**QUIZ, "questions": [{**NUMBER, key: value}, CHOICE]}))
    (change,) = list_changes(load(write("one", QUIZ)), after)
    assert (change.keys, not change.is_for_regrade) == ((key,), is_silent)


def test_what_differs_is_told_with_the_old_and_the_new(write: Write) -> None:
    long = " ".join(f"word{n}" for n in range(60))
    parts = {"attempts": 3, "q": long}, {"attempts": None, "q": long.replace("word30", "other")}
    old, new = (
        {**QUIZ, "questions": [{**NUMBER, **part}, {**CHOICE, "options": options, "answer": answer}, SCRIPT | check]}
        for part, options, answer, check in (
            (parts[0], ["a", "b"], 0, {}), (parts[1], ["a", "c", "b"], 2, {"check": {**SCRIPT["check"], "cases": [
                {**SCRIPT["check"]["cases"][0], "steps": 3}]}}))
    )  # fmt: skip
    changes = list_changes(load(write("one", old)), load(write("two", new, joint="k", starter="def f(): pass\n")))
    edits = {change.part: {edit.path: (edit.old, edit.new) for edit in change.edits} for change in changes}
    words = " ".join(f"word{n}" for n in range(24, 30)), " ".join(f"word{n}" for n in range(31, 37))
    assert edits["n"] == {
        "attempts": ("3", "nothing"),
        "q": (f"… {words[0]} word30 {words[1]} …", f"… {words[0]} other {words[1]} …"),
    }
    assert edits["c"] == {"options › no. 2": ("nothing", "c"), "answer": ("0, “a”", "2, “b”")}
    assert edits["s"]["check › cases › a › steps"] == ("2", "3")
    assert edits["s"]["starter"] == ("def f(): ...", "def f(): pass")
    assert "name='j'" in edits["s"]["models › one"][0] and "name='k'" in edits["s"]["models › one"][1]


SEVEN = ["Newton", "Euler", "RK4", "Verlet", "Heun", "Adams", "Gear"]
MULTIPLE = {"kind": "multiple", "id": "c", "q": "Which?", "options": SEVEN, "answer": [0, 1]}
MOVED = "the order has changed, the entries are the same: no. "
BACK = f"{MOVED}1 to 7 were no. 7, 6, 5, 4, 3, 2, 1 before"
SAME, OTHER = ("answer", "", "the same texts are right"), ("answer", "", "other texts are right")
ORDERED = {"kind": "order", "id": "c", "q": "Order them.", "items": SEVEN}
PAIRS = [["a", "1"], ["b", "2"], ["c", "3"]]
MATCHED = {"kind": "match", "id": "c", "q": "Match them.", "pairs": PAIRS}


@pytest.mark.parametrize(
    ("question", "changes", "edits"),
    [
        (MULTIPLE, {"options": SEVEN[::-1], "answer": [6, 5]}, [("options", "", BACK), SAME]),
        (MULTIPLE, {"options": SEVEN[::-1], "answer": [6, 4]}, [
            ("options", "", BACK), OTHER, ("answer › no. 1", "0, “Newton”", "6, “Newton”"),
            ("answer › no. 2", "1, “Euler”", "4, “RK4”")]),
        (CHOICE, {"options": ["b", "a"]}, [("options", "", f"{MOVED}1 to 2 were no. 2, 1 before"), OTHER,
                                           ("answer", "0, “a”", "0, “b”")]),
        ({**CHOICE, "whys": ["Yes.", "No."]}, {"options": ["b", "a"], "answer": 1, "whys": ["No.", "Yes."]}, [
            ("options", "", f"{MOVED}1 to 2 were no. 2, 1 before"), SAME,
            ("whys", "", f"{MOVED}1 to 2 were no. 2, 1 before")]),
        (ORDERED, {"items": [*SEVEN[:2], SEVEN[3], SEVEN[2], *SEVEN[4:]]}, [
            ("items", "", f"{MOVED}3 to 4 were no. 4, 3 before")]),
        (MATCHED, {"pairs": PAIRS[::-1]}, [("pairs", "", f"{MOVED}1 to 3 were no. 3, 2, 1 before")]),
    ],
)  # fmt: skip
def test_lists_of_the_same_entries_are_told_by_their_order(
    write: Write, question: dict[str, Any], changes: dict[str, Any], edits: list[tuple[str, str, str]]
) -> None:
    old, new = ({**QUIZ, "questions": [part]} for part in (question, question | changes))
    (change,) = list_changes(load(write("one", old)), load(write("two", new)))
    assert sorted(change.edits) == sorted(edits)


def test_numbers_at_other_places_are_other_values() -> None:
    assert [edit.new for edit in list_edits([1, 0, 0, 2], [2, 0, 0, 1])] == ["2", "1"]
    assert list(list_edits(["a"], ["a"])) == []
    assert [edit.new for edit in list_edits(["a", "b", "a"], ["b", "a", "a"])] == [
        f"{MOVED}1 to 2 were no. 2, 1 before"
    ]


def test_of_drawn_numbers_the_names_are_compared(write: Write) -> None:
    drawn = {**NUMBER, "q": "Twice {n}?", "draw": {"n": [1, 9]}, "answer": 10.0,
             "verify": {"by": "expression", "expr": "2 * {n}"}}  # fmt: skip
    old, new = ({**QUIZ, "questions": [drawn | more, CHOICE]} for more in ({}, {"q": "What is twice {n}?"}))
    (change,) = list_changes(load(write("one", old)), load(write("two", new)))
    assert (change.keys, change.is_for_regrade) == (("q",), False)
    assert change.edits == (("q", "Twice {n}?", "What is twice {n}?"),)


def test_models_and_starters_belong_to_the_questions_that_name_them(write: Write) -> None:
    quiz = {**QUIZ, "questions": [NUMBER, SCRIPT]}
    before = load(write("one", quiz))
    assert list_changes(before, load(write("two", quiz, joint="k"))) == [
        Change("a", "s", CHANGED, ("models",)),
        Change("a", "l", CHANGED, ("models",), is_question=False),
    ]
    (change,) = list_changes(before, load(write("three", quiz, starter="def f(): pass\n")))
    assert (change.part, change.keys, change.is_for_regrade) == ("s", ("starter",), False)


def test_the_texts_of_lessons_come_change_and_go(write: Write) -> None:
    folders = {name: write(name, {**QUIZ, "id": "2-a"}) for name in ("without", "with", "other")}
    for name, text in {"with": "# Two\n\nFalling.\n", "other": "# Two\n\nRising.\n"}.items():
        (folders[name] / "lessons").mkdir()
        (folders[name] / "lessons/2.md").write_text(text)
    without, with_text, other = map(load, folders.values())
    for before, after, how in ((without, with_text, ADDED), (with_text, other, CHANGED), (other, without, REMOVED)):
        assert list_changes(before, after) == [Change("", "", how, lesson="2")]
    (change,) = list_changes(with_text, other)
    assert change.edits == (("text › no. 1", "<p>Falling.</p>", "<p>Rising.</p>"),)
