"""A lesson written in Markdown becomes quiz JSON, or is refused with every fault and its line."""

import json
from pathlib import Path

import pytest

from grader.errors import ContentError
from grader.importing.lesson import import_lesson
from grader.library import load
from grader.questions import Quiz

ROOT = Path(__file__).parents[2]
LESSON = Path(__file__).with_name("lesson-9.9.md").read_text()


def faults_of(markdown: str) -> list[str]:
    with pytest.raises(ContentError) as caught:
        import_lesson(markdown, "9.9")
    return [str(fault) for fault in caught.value.faults]


def test_quizzes_and_labs_come_out_as_they_were_written() -> None:
    files = import_lesson(LESSON, "9.9").quizzes
    assert list(files) == ["9.9-check", "9.9-labs"]
    quiz = files["9.9-check"]
    assert [q["kind"] for q in quiz["questions"]] == ["mcq", "numeric", "predict"]
    assert quiz["questions"][0] == {
        "kind": "mcq",
        "q": "What rests?",
        "options": ["The rod", "The <code>mjData</code>"],
        "answer": 0,
        "x-note": "easy",
    }
    assert "```" in quiz["questions"][1]["explain"]
    labs = files["9.9-labs"]
    assert labs["title"] == "Labs of Lesson 9.9: Rods and rests"
    assert [(lab["id"], lab["kind"]) for lab in labs["labs"]] == [
        ("a-falling-rod", "simlab"),
        ("integrators", "integrators"),
    ]


def test_the_imported_files_load_as_content(tmp_path: Path) -> None:
    (tmp_path / "quizzes").mkdir()
    (tmp_path / "models").mkdir()
    for name in ("pendulum", "double_pendulum"):
        (tmp_path / f"models/{name}.xml").write_text((ROOT / f"models/{name}.xml").read_text())
    for name, quiz in import_lesson(LESSON, "9.9").quizzes.items():
        (tmp_path / f"quizzes/{name}.json").write_text(json.dumps(quiz))
    library = load(tmp_path)
    assert [question.id for question in library.quizzes["9.9-check"].questions] == ["q1", "q2", "q3"]
    assert len(library.quizzes["9.9-labs"].labs) == 2


def test_the_knowledge_check_of_lesson_1_3_survives_the_way_through_markdown() -> None:
    raw = json.loads((ROOT / "quizzes/1.3-check.json").read_text())
    labs = json.loads((ROOT / "quizzes/1.3-labs.json").read_text())["labs"]
    lesson = "# Lesson 1.3\n\n```quiz\n" + json.dumps(raw) + "\n```\n"
    for lab in labs:
        lesson += f"\n```lab {lab['kind']}\n{json.dumps({k: v for k, v in lab.items() if k != 'kind'})}\n```\n"
    files = import_lesson(lesson, "1.3").quizzes
    assert files["1.3-check"] == raw
    assert Quiz.model_validate(files["1.3-labs"]).labs[1].id == "servo-stability"


def test_every_fault_is_told_with_its_line() -> None:
    lesson = """# Wrong

```quiz
{"id": "a", "title": "A", "questions": [{"kind": "mcq", "q": "?", "options": ["x", "y"]}]}
```

```quiz
{"id": "b", "title": "B",
 "questions": [}
```

```lab simlab
{"model": "pendulum", "setup": "data.qpos[0] ="}
```

```lab gymnasium
{"model": "pendulum",}
```

```lab simlab
{"model": "pendulum", "controler": "data.ctrl[0] = 1"}
```
"""
    faults = faults_of(lesson)
    assert [fault.split(":")[1].strip() for fault in sorted(faults, key=lambda f: int(f.split()[2].rstrip(":,")))] == [
        "line 3",
        "line 9, column 16",
        "line 12",
        "line 17, column 21",
        "line 20",
    ]
    text = "\n".join(faults)
    assert "answer" in text
    assert "column 16" in text
    assert "setup: line 1, column" in text
    assert "controler" in text


@pytest.mark.parametrize(
    ("lesson", "why"),
    [
        ("# Nothing here", "no quiz or lab block"),
        ("```quiz\n{}", "never ends"),
        ("```quiz\n[1]\n```", "one JSON object"),
        ('```quiz\n{"id": "a b", "title": "t", "questions": []}\n```', "id"),
        ('```lab simlab\n{"id": "x", "model": "m"}\n```\n```lab simlab\n{"id": "x", "model": "m"}\n```', "two labs"),
        ('```quiz\n{"kind": "open", "q": "a", "q": "b"}\n```', "q: occurs more than once"),
        ('```quiz\n{"kind": "open", "q": "a", "qq": "b"}\n```', "unknown key"),
        ("```quiz\n" + "[" * 100_000 + "]" * 100_000 + "\n```", "nested too deeply"),
        ('```quiz\n{"kind": "numeric", "q": "a", "answer": ' + "9" * 5000 + "}\n```", "a number"),
        ('```quiz\n{"kind": "open", "q": "a", "x-a": NaN}\n```', "a finite number"),
        ('```quiz\n{"kind": "open", "q": "a", "x-a": "\\ud800"}\n```', "x-a: holds half a surrogate pair"),
        ('```lab simlab\n{"id": [], "model": "m"}\n```', "id: must be a valid string"),
        (
            '```quiz\n{"id": "9.9-labs", "title": "t", "questions": []}\n```\n```lab integrators\n{"model": "m"}\n```',
            "9.9: line 1: the labs of this lesson have the id '9.9-labs'",
        ),
        (
            '```quiz\n{"kind": "open", "q": "a"}\n```\n```quiz\n{"kind": "open", "q": "b", "id": "q1"}\n```',
            "two questions of '9.9-check' have the id 'q1'",
        ),
    ],
)
def test_a_lesson_that_is_wrong_is_refused(lesson: str, why: str) -> None:
    assert why in "\n".join(faults_of(lesson))


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_a_byte_order_mark_and_the_line_ends_of_other_alphabets_do_no_harm(newline: str) -> None:
    question = {"kind": "open", "q": "one\u2028two\x85three\x0b"}
    text = json.dumps(question, ensure_ascii=False)
    (quiz,) = import_lesson(newline.join(["\ufeff```quiz", text, "```", ""])).quizzes.values()
    assert quiz["questions"] == [question]


def test_a_lab_without_a_kind_runs_one_scene_and_one_of_an_unknown_kind_costs_nothing_but_a_remark() -> None:
    lesson = import_lesson(
        """```quiz
{"kind": "open", "q": "Why?"}
```
```lab
{"model": "pendulum", "title": "No kind"}
```
```lab policies
{"title": "Searching", "anything": [1, {"model": "none"}]}
```
""",
        "9.9",
    )
    assert [(lab["id"], lab["kind"]) for lab in lesson.quizzes["9.9-labs"]["labs"]] == [
        ("no-kind", "simlab"),
        ("searching", "policies"),
    ]
    assert list(lesson.quizzes) == ["9.9-check", "9.9-labs"]
    (remark,) = lesson.remarks
    assert remark.key == "line 7"
    assert "no lab 'policies'" in remark.why


def test_a_lab_with_faults_is_left_out_and_costs_the_lesson_no_quiz() -> None:
    lesson = import_lesson(
        """```quiz
{"kind": "open", "q": "Why?"}
```
```lab simlab
{"model": "pendulum", "readout": []}
```
```lab simlab
{"model": "pendulum", "title": "Sound"}
```
```sim
{"model": "pendulum", "controller": "data.ctrl[0] ="}
```
```lab integrators
{"model": "pendulum", // the lesson's
}
```
```lab simlab
{"model": "pendulum"
""",
        "9.9",
    )
    assert list(lesson.quizzes) == ["9.9-check", "9.9-labs"]
    assert [lab["title"] for lab in lesson.quizzes["9.9-labs"]["labs"]] == ["Sound"]
    assert [fault.key for fault in lesson.faults] == ["line 10", "line 14, column 23", "line 17", "line 4"]
    assert "JSON has no comments" in lesson.faults[1].why
    assert [remark.key for remark in lesson.remarks] == ["line 10", "line 13", "line 17", "line 4"]
    assert all("left out" in remark.why for remark in lesson.remarks)


def test_a_lab_that_never_ends_and_holds_a_quiz_is_refused() -> None:
    quiz = """```quiz
{"kind": "open", "q": "Why?"}
```
"""
    (fault,) = faults_of(quiz + '```lab simlab\n{"model": "pendulum"}\n' + quiz)
    assert "line 4" in fault and "never ends" in fault


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ('{"q": "a",}', "remove the comma after the last item"),
        ('{"options": ["a", ]}', "remove the comma after the last item"),
        ('{"q": "a", /* easy */ "kind": "open"}', "JSON has no comments"),
        ("{\"q\": 'a'}", "texts stand between double quotes"),
    ],
)
def test_what_is_javascript_and_not_json_is_told_with_its_cure(text: str, cure: str) -> None:
    (fault,) = faults_of(f"```quiz\n{text}\n```")
    assert "broken JSON" in fault and cure in fault


def test_a_sim_fence_is_a_lab_beside_those_of_lab_fences() -> None:
    lab = {"model": "pendulum", "readouts": [{"label": "angle", "expr": "data.qpos[0]"}]}
    fences = [f"```{words}\n{json.dumps(lab | {'title': words})}\n```" for words in ("lab simlab", "sim", "simlab")]
    labs = import_lesson("\n".join(fences), "9.9").quizzes["9.9-labs"]["labs"]
    assert [(one["title"], one["kind"]) for one in labs] == [
        (name, "simlab") for name in ("lab simlab", "sim", "simlab")
    ]


def test_a_debug_block_becomes_a_question_or_a_remark() -> None:
    lesson = import_lesson(
        """```debug
{"q": "What is wrong?", "options": ["the mass", "the sign"], "answer": 1}
```
```debug
{"title": "Case 1", "symptom": "It falls.", "cause": "No contact."}
```
""",
        "9.9",
    )
    (question,) = lesson.quizzes["9.9-check"]["questions"]
    assert question["kind"] == "debug"
    assert Quiz.model_validate({**lesson.quizzes["9.9-check"], "questions": [{"id": "q1", **question}]}).questions
    (remark,) = lesson.remarks
    assert remark.key == "line 4"
    assert "no options" in remark.why


def test_a_single_question_is_a_quiz_of_the_lesson() -> None:
    files = import_lesson('```quiz\n{"kind": "open", "q": "Why?"}\n```', "my lesson").quizzes
    assert files == {
        "my-lesson-check": {
            "id": "my-lesson-check",
            "title": "Knowledge check",
            "questions": [{"kind": "open", "q": "Why?"}],
        }
    }
