"""Every fault of every file, told at once with file, key and cure."""

import copy
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import mujoco
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from grader.errors import ContentError, Fault, NotFound
from grader.library import Library, load
from grader.library.json_text import parse_json
from grader.questions.kinds.script import ScriptQuestion
from support.content import PASSED

REPOSITORY = Path(__file__).parents[2]
XML = '<mujoco><worldbody><body name="ball"><freejoint/><geom name="ball" size="1"/></body></worldbody></mujoco>'
HINGE = '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'
MCQ = {"kind": "mcq", "q": "Which?", "options": ["a", "b"], "answer": 1, "whys": ["a is not.", "b is."]}
NUMERIC = {"kind": "numeric", "q": "How long?", "answer": 5, "tol": 0.05, "unit": "ms"}
OPEN = {"kind": "open", "q": "Why?", "reference": "Because."}
CODE = {"kind": "code", "q": "Do", "entry": "f"}
RK4: dict[str, Any] = {
    **CODE,
    "check": {"kind": "rk4", "order": None, "cases": [{"id": "a", "xml": HINGE, "steps": 2}]},
}
SIM: dict[str, Any] = {
    "model": "ball",
    "controls": [{"label": "h", "set": "model.opt.timestep", "min": 0.001, "max": 0.01, "step": 0.001, "value": 0.002}],
}
PREDICT: dict[str, Any] = {"kind": "predict", "q": "What?", "options": ["a", "b"], "answer": 0, "sim": SIM}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A content folder with one model and one quiz."""
    for folder in ("quizzes", "models", "starters"):
        (tmp_path / folder).mkdir()
    (tmp_path / "models" / "ball.xml").write_text(XML)
    write(tmp_path, MCQ)
    return tmp_path


def write(root: Path, *questions: Any, name: str = "quiz", **more: Any) -> None:
    quiz = {"id": name, "title": "A quiz", "questions": list(questions), **more}
    (root / "quizzes" / f"{name}.json").write_text(json.dumps(quiz), encoding="utf-8")


def faults(root: Path) -> list[Fault]:
    with pytest.raises(ContentError) as error:
        load(root)
    return list(error.value.faults)


def told(root: Path) -> dict[str, str]:
    """Why, by key, where all faults are in the quiz file."""
    refused = faults(root)
    assert {fault.file for fault in refused} == {"quizzes/quiz.json"}
    return {fault.key: fault.why for fault in refused}


def without(part: Mapping[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in part.items() if name != key}


def test_quizzes_stand_in_the_order_of_their_lessons_and_numbers(root: Path) -> None:
    names = ["1.9-check", "1.10-check", "2.1-check", "10.1-check", "quiz", "week-9", "week-10"]
    for name in names:
        write(root, MCQ, name=name)
    assert list(load(root).quizzes) == names


def test_ids_are_given_by_position(root: Path) -> None:
    write(root, MCQ, {**NUMERIC, "id": "mine"}, OPEN)
    library = load(root)
    assert [question.id for question in library.quiz("quiz").questions] == ["q1", "mine", "q3"]
    assert library.question("quiz", "mine").kind == "numeric"
    assert library.file("quiz") == "quizzes/quiz.json"
    assert library.model_xml("ball") == XML
    assert library.warnings == ()


def test_comments_of_authors_are_sent_to_nobody(root: Path) -> None:
    asked = {**MCQ, "q": "Which<!-- the second -->?", "options": ["a", "b <!-- right\n -->"], "whys": ["a <!--", "b."]}
    write(root, asked)
    (question,) = load(root).quiz("quiz").questions
    shown = question.model_dump()
    assert (shown["q"], shown["options"], shown["whys"]) == ("Which?", ("a", "b "), ("a <!--", "b."))


def test_what_is_not_there_is_not_found(root: Path) -> None:
    library = load(root)
    for ask in (
        lambda: library.quiz("x"),
        lambda: library.question("x", "q1"),
        lambda: library.question("quiz", "q9"),
        lambda: library.model_xml("x"),
        lambda: library.digest("x"),
        lambda: library.file("x"),
    ):
        with pytest.raises(NotFound):
            ask()


def test_five_faults_in_five_places_are_named_at_once(root: Path) -> None:
    sim = {"model": "bell"}
    write(root, {**MCQ, "answer": 2}, {**NUMERIC, "tol": -0.05}, {**OPEN, "refrence": ""}, {**PREDICT, "sim": sim})
    (root / "quizzes" / "broken.json").write_text('{"id": "broken",\n "title": }')
    assert [(fault.file, fault.key) for fault in faults(root)] == [
        ("quizzes/broken.json", "line 2, column 11"),
        ("quizzes/quiz.json", "q1.answer"),
        ("quizzes/quiz.json", "q2.tol"),
        ("quizzes/quiz.json", "q3.refrence"),
        ("quizzes/quiz.json", "q4.sim.model"),
    ]


@pytest.mark.parametrize(
    ("question", "key", "why"),
    [
        ({**MCQ, "answer": 2}, "q1.answer", "there is no option 2: they go from 0 to 1"),
        ({**MCQ, "answer": -1}, "q1.answer", "must be greater than or equal to 0, not -1"),
        ({**MCQ, "answer": True}, "q1.answer", "must be a valid integer, not True"),
        ({**MCQ, "answer": 1.5}, "q1.answer", "not 1.5"),
        ({**MCQ, "options": ["a"], "answer": 0}, "q1.options", "at least 2 items"),
        ({**NUMERIC, "answer": "5"}, "q1.answer", "must be a valid number, not '5'"),
        ({**NUMERIC, "answer": True}, "q1.answer", "must be a valid number, not True"),
        ({**NUMERIC, "tolerance": 1}, "q1.tolerance", "unknown key: write 'tol', or remove it, or begin it with x-"),
        ({**NUMERIC, "points": 0}, "q1.points", "must be greater than 0, not 0"),
        ({**NUMERIC, "attempts": 0}, "q1.attempts", "greater than or equal to 1"),
        (without(MCQ, "answer"), "q1.answer", "is missing: add it"),
        (without(MCQ, "kind"), "q1.kind", "is missing: add it (mcq"),
        ({**without(MCQ, "kind"), "knid": "mcq"}, "q1.kind", "rename 'knid'"),
        ({**MCQ, "kind": "mqc"}, "q1.kind", "there is no 'mqc': one of 'mcq'"),
        ({**MCQ, "id": "a b"}, "a b.id", "must match pattern"),
        ({**MCQ, "id": 3}, "q1.id", "must be a valid string, not 3"),
        (7, "q1", "must be an object"),
        ({**PREDICT, "sim": {**SIM, "heigth": 1}}, "q1.sim.heigth", "write 'height'"),
        ({**PREDICT, "sim": {**SIM, "controls": [{"type": "knob"}]}}, "q1.sim.controls.0.type", "there is no 'knob'"),
        ({**PREDICT, "sim": {**SIM, "plots": [{"traces": []}]}}, "q1.sim.plots.0.traces", "at least 1 item"),
        ({**PREDICT, "sim": {**SIM, "plots": {"traces": []}}}, "q1.sim.plots", "must be a list between [ and ]"),
        (
            {**PREDICT, "sim": {**SIM, "plots": [{"ymin": 1, "ymax": 1, "traces": [{"label": "z", "expr": "1"}]}]}},
            "q1.sim.plots.0",
            "ymin must be below ymax, not 1 and 1",
        ),
        ({**PREDICT, "sim": {**SIM, "stopAt": 0}}, "q1.sim.stopAt", "must be greater than 0"),
        ({**PREDICT, "sim": {"model": "models/ball.xml"}}, "q1.sim.model", "write 'ball', without folder and .xml"),
        ({**NUMERIC, "verify": {"by": "expression", "exrp": "5", "expr": "5"}}, "q1.verify.exrp", "write 'expr'"),
        ({**NUMERIC, "verify": {"by": "thought"}}, "q1.verify.by", "there is no 'thought': one of 'options'"),
        ({**NUMERIC, "verify": {"bye": "stage"}}, "q1.verify.by", "is missing: rename 'bye' (options"),
        ({**NUMERIC, "verify": {"by": "expression", "expr": "5", "model": "bell"}}, "q1.verify.model", "there is no"),
        ({**OPEN, "verify": {"by": "expression", "expr": "5"}}, "q1.verify", "open has no key"),
        ({**RK4, "verify": {"by": "expression", "expr": "5"}}, "q1.verify", "code has no key"),
        ({**RK4, "check": {**RK4["check"], "toll": 1}}, "q1.check.toll", "unknown key: remove it, or begin it with x-"),
        ({**PREDICT, "sim": {"xml": "<mujoco>\n<bad/></mujoco>"}}, "q1.sim.xml", "does not compile: XML Error: Schema"),
        ({**PREDICT, "sim": {"model": "../x"}}, "q1.sim.model", "there is no models/../x.xml: take one of ball"),
    ],
)
def test_a_fault_is_told_where_it_stands_with_its_cure(root: Path, question: Any, key: str, why: str) -> None:
    write(root, question)
    by_key = told(root)
    assert list(by_key) == [key]
    assert why in by_key[key]


def test_where_there_is_no_model_none_is_offered(root: Path) -> None:
    for model in (root / "models").iterdir():
        model.unlink()
    write(root, {**NUMERIC, "verify": {"by": "expression", "expr": "5", "model": "bell"}})
    assert "there is no models/bell.xml: add it, there is no model yet" in told(root)["q1.verify.model"]


def test_one_question_with_many_faults_tells_them_all(root: Path) -> None:
    control = {"label": 3, "set": "x", "min": 0, "max": 1, "step": 0, "value": 1, "lable": "h"}
    write(root, {**PREDICT, "answer": 9, "points": -1, "optoins": [], "sim": {"model": "bell", "controls": [control]}})
    assert set(told(root)) == {
        "q1.answer", "q1.points", "q1.optoins", "q1.sim.model",
        "q1.sim.controls.0.label", "q1.sim.controls.0.step", "q1.sim.controls.0.lable",
    }  # fmt: skip


def test_remarks_are_taken_off_at_every_level(root: Path) -> None:
    sim = {**SIM, "x-note": 1, "controls": [{**SIM["controls"][0], "x-why": {"model": "none"}}]}
    write(root, {**PREDICT, "x-author": "me", "sim": sim})
    path = root / "quizzes" / "quiz.json"
    path.write_text(path.read_text().replace('"title"', '"x-": {"x-": null}, "title"', 1))
    assert load(root).question("quiz", "q1").kind == "predict"


def test_repeated_ids_and_keys(root: Path) -> None:
    write(root, MCQ, {**MCQ, "id": "q3"}, MCQ)
    assert told(root) == {"q3.id": "two have this id: give each its own"}
    (root / "quizzes" / "quiz.json").write_text(
        '{"id": "quiz", "title": "a", "title": "b", "questions": [{"kind": "open", "q": "a", "q": "b"}]}'
    )
    assert set(told(root)) == {"title", "q1.q"}


def test_two_files_of_one_id(root: Path) -> None:
    write(root, MCQ, name="twin")
    text = (root / "quizzes" / "twin.json").read_text().replace('"id": "twin"', '"id": "quiz"')
    (root / "quizzes" / "twin.json").write_text(text)
    assert [(fault.file, fault.key) for fault in faults(root)] == [("quizzes/twin.json", "id")]


@pytest.mark.parametrize(("number", "why"), [("NaN", "finite"), ("-Infinity", "finite"), ("1e999", "finite")])
def test_numbers_that_json_does_not_have(root: Path, number: str, why: str) -> None:
    write(root, NUMERIC)
    path = root / "quizzes" / "quiz.json"
    path.write_text(path.read_text().replace('"tol": 0.05', f'"tol": {number}'))
    assert why in told(root)["q1.tol"]


@pytest.mark.parametrize(
    ("content", "key"),
    [
        (b"", "line 1, column 1"),
        (b'{"id": "quiz", "title": "caf\xe9"}', "byte 28"),
        (b"[]", "whole file"),
        (b'{"questions": ' + b"[" * 5000 + b"]" * 5000 + b"}", "whole file"),
        (b'{"questions": ' + b"[" * 60 + b"]" * 60 + b"}", "whole file"),
        (b'{"answer": ' + b"9" * 5000 + b"}", "whole file"),
        (b'{"id": "' + b"x" * (1 << 20) + b'"}', "size"),
        (b'{"id": "quiz", "title": "t", "questions": {}}', "questions"),
        (b'{"title": "t"}', "id"),
    ],
)
def test_files_that_are_no_quiz(root: Path, content: bytes, key: str) -> None:
    (root / "quizzes" / "quiz.json").write_bytes(content)
    assert key in told(root)


def test_a_byte_order_mark_is_no_fault(root: Path) -> None:
    path = root / "quizzes" / "quiz.json"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load(root).quiz("quiz").title == "A quiz"


def test_a_quiz_outside_the_folder_is_not_followed(root: Path) -> None:
    outside = root.parent / "outside.json"
    (root / "quizzes" / "quiz.json").rename(outside)
    (root / "quizzes" / "quiz.json").symlink_to(outside)
    assert "out of the content folder" in told(root)["path"]


def test_what_editors_and_macos_leave_behind_is_no_content(root: Path) -> None:
    (root / "quizzes/.#quiz.json").symlink_to("someone@somewhere.1234")
    (root / "quizzes/._quiz.json").write_bytes(b"\0\5\x16\7")
    (root / "models/._ball.xml").write_bytes(b"\0\5\x16\7")
    library = load(root)
    assert (set(library.quizzes), set(library.models)) == ({"quiz"}, {"ball"})


def test_a_folder_without_quizzes(tmp_path: Path) -> None:
    assert [(fault.file, fault.key) for fault in faults(tmp_path)] == [("quizzes", "*.json")]


def test_a_model_that_does_not_compile_says_why(root: Path) -> None:
    (root / "models" / "bad.xml").write_text('<mujoco>\n<worldbody><geom sizee="1"/></worldbody></mujoco>')
    (fault,) = faults(root)
    assert fault.file == "models/bad.xml"
    assert "sizee" in fault.why and "line 2" in fault.why


OTHER_FILES = {
    "include": '<include file="part.xml"/>',
    "mesh 't'": '<asset><mesh name="t" file="t.stl"/></asset>',
    "texture": '<asset><texture type="cube" fileup="a.png"/></asset>',
    "hfield": '<asset><hfield file="a.png" size="1 1 1 1"/></asset>',
    "skin": '<deformable><skin file="a.skn"/></deformable>',
    "flexcomp 'f'": '<worldbody><flexcomp name="f" type="gmsh" file="a.msh"/></worldbody>',
}


@pytest.mark.parametrize("element", OTHER_FILES)
def test_a_model_stands_on_its_own(root: Path, monkeypatch: pytest.MonkeyPatch, element: str) -> None:
    monkeypatch.chdir(root / "models")
    xml = f"<mujoco>{OTHER_FILES[element]}</mujoco>"
    Path("part.xml").write_text(XML)
    Path("whole.xml").write_text(xml)
    (fault,) = faults(root)
    assert (fault.file, fault.key) == ("models/whole.xml", "model")
    assert f"<{element}> refers to" in fault.why
    Path("whole.xml").unlink()
    threshold = {"by": "threshold", "xml": xml}
    exercise = {"kind": "rk4", "cases": [{"id": "a", "xml": [xml]}]}
    labs = [{"id": "lab", "kind": "simlab", "xml": xml}]
    questions = [{**NUMERIC, "verify": threshold}, {**PREDICT, "sim": {"xml": xml}}, {**CODE, "check": exercise}]
    write(root, *questions, labs=labs)
    assert {key: f"<{element}> refers to" in why for key, why in told(root).items()} == dict.fromkeys(
        ("q1.verify.xml", "q2.sim.xml", "q3.check.cases.0.xml", "lab.xml"), True
    )


def test_an_empty_file_name_and_assets_written_out_are_no_other_file(root: Path) -> None:
    texture = '<texture name="grey" type="2d" builtin="flat" file="" width="4" height="4"/>'
    mesh = '<mesh name="t" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>'
    (root / "models/own.xml").write_text(f"<mujoco><asset>{texture}{mesh}</asset></mujoco>")
    assert "own" in load(root).models


def test_models_named_in_checks_and_labs(root: Path) -> None:
    code = {**CODE, "check": {"kind": "k", "cases": [{"model": "none"}], "x-model": 1}}
    labs = [{"id": "lab", "kind": "integrators", "model": "ball", "models": ["ball", "bell"]}]
    write(root, code, labs=labs)
    assert {"q1.check.cases.0.model", "lab.models.1"} <= set(told(root))


def code(starter: str) -> dict[str, Any]:
    return {"kind": "code", "q": "Do", "entry": "solve", "starter": starter, "check": {"kind": "any"}}


@pytest.mark.parametrize(
    ("starter", "why"),
    [
        ("../secret.py", "stay inside"),
        ("/etc/passwd.py", "stay inside"),
        ("starters/../../secret.py", "stay inside"),
        ("starters\\a.py", "stay inside"),
        ("starters/none.py", "is not a file"),
        ("starters", "must be a .py file"),
        ("starters/folder.py", "is not a file"),
        ("starters/link.py", "out of the content folder"),
        ("starters/loop.py", "leads back to itself"),
        ("starters/other.py", "does not define 'solve'"),
        ("starters/latin.py", "is not UTF-8"),
        ("starters/huge.py", "is larger than 256 KB"),
    ],
)
def test_broken_starters(root: Path, starter: str, why: str) -> None:
    starters = root / "starters"
    (root.parent / "secret.py").write_text("def solve(): ...")
    (starters / "folder.py").mkdir()
    (starters / "link.py").symlink_to(root.parent / "secret.py")
    (starters / "loop.py").symlink_to("loop.py")
    (starters / "other.py").write_text("def solver(): ...\nclass A:\n    def solve(self): ...")
    (starters / "latin.py").write_bytes(b"# \xe9")
    (starters / "huge.py").write_text("#" * (256 * 1024 + 1))
    write(root, code(starter))
    assert why in told(root)["q1.starter"]


@pytest.mark.parametrize(
    ("sim", "key"),
    [
        ({"setup": "data.qpos[0] = 1"}, "q1.sim.model"),
        ({"model": "ball", "xml": XML}, "q1.sim.model"),
        ({"model": "ball", "setup": "data.qpos[0 = 1"}, "q1.sim.setup"),
        ({"model": "ball", "key": "none"}, "q1.sim.key"),
        ({"xml": "<mujoco"}, "q1.sim.xml"),
    ],
)
def test_a_lab_is_tried_when_it_is_loaded(root: Path, sim: dict[str, Any], key: str) -> None:
    write(root, {**PREDICT, "sim": sim})
    assert list(told(root)) == [key]


def test_the_labs_of_a_lesson_are_tried_too(root: Path) -> None:
    simlab = {"id": "fall", "kind": "simlab", "model": "ball", "readouts": [{"label": "z", "expr": "data.qpos[2"}]}
    all_five = {"id": "five", "kind": "integrators", "model": "ball", "key": 3}
    write(root, MCQ, labs=[simlab, all_five])
    assert sorted(told(root)) == ["fall.readouts.0.expr", "five.key"]


def test_a_lab_with_a_model_that_does_not_compile_is_told_once(root: Path) -> None:
    (root / "models" / "ball.xml").write_text("<mujoco>")
    write(root, PREDICT)
    assert [fault.file for fault in faults(root)] == ["models/ball.xml"]


def test_a_checker_that_nobody_registered(root: Path) -> None:
    (root / "starters" / "s.py").write_text("def solve(): ...")
    write(root, code("starters/s.py"))
    assert list(told(root)) == ["q1.check.kind"]


def test_a_starter_that_is_not_python(root: Path) -> None:
    (root / "starters" / "s.py").write_text("x = 1\ndef solve(:\n")
    write(root, code("starters/s.py"))
    assert Fault("starters/s.py", "line 2", "not valid Python: invalid syntax") in faults(root)


def test_the_digest_moves_with_everything_a_verdict_depends_on(root: Path) -> None:
    write(root, MCQ)
    write(root, OPEN, name="other")

    def digests() -> tuple[str, str]:
        library = load(root)
        return library.digest("quiz"), library.digest("other")

    first = digests()
    assert digests() == first
    write(root, {**MCQ, "x-remark": 1})
    second = digests()
    assert second[0] != first[0] and second[1] == first[1]
    (root / "models" / "ball.xml").write_text(XML + "\n")
    third = digests()
    assert third[0] != second[0] and third[1] != second[1]


@pytest.mark.parametrize(
    ("question", "key"),
    [
        ({**MCQ, "q": "a $x$ and $y"}, "q1.q"),
        ({**MCQ, "options": ["$a", "b"]}, "q1.options.0"),
        ({**NUMERIC, "unit": "parsnips"}, "q1.unit"),
        ({**without(NUMERIC, "tol"), "answer": 0}, "q1.tol"),
        ({**NUMERIC, "tol": 6}, "q1.tol"),
    ],
)
def test_what_is_suspicious_is_a_warning(root: Path, question: Any, key: str) -> None:
    write(root, question)
    assert [(warning.file, warning.key) for warning in load(root).warnings] == [("quizzes/quiz.json", key)]


def test_a_dollar_with_a_backslash_is_a_dollar(root: Path) -> None:
    write(root, {**MCQ, "q": r"It costs \$5 for $n$ steps"})
    assert load(root).warnings == ()


@settings(max_examples=200)
@given(st.text(max_size=60) | st.text('{}[]":,0123456789eE.-NaN\n', max_size=60))
def test_any_text_is_json_or_a_fault(text: str) -> None:
    parsed = parse_json(text, "quizzes/a.json")
    if not isinstance(parsed, Fault):
        json.loads(text)


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ('{"q": {"a": 1}', "a { has no }: add it"),
        ('{"q": ["a", "b"', "a [ has no ]: add it"),
        ('[{"q": 1,\n{"q": 2}]', "a { has no }: add it"),
        ('[{"q": "}" ]', "a { has no }: add it, or this ] is one too many"),
        ('[{"q": 1}}, {"q": 2}]', "a [ has no ]: add it, or this } is one too many"),
        ('{"q": 1}}', "this } is one too many: remove it"),
        ("{“q”: 1}", "write straight quotes"),
        ('{"q": “a”}', "write straight quotes"),
        ('{"q": "a”}', "write straight quotes"),
        ('{"q": "a”, "b": 1}', "write straight quotes"),
        ('{"q”: 1, "b": 1}', "write straight quotes"),
        ('{"q": "a”,\n"b": 1}', "write straight quotes"),
    ],
)
def test_brackets_and_quotes_without_their_other_half_are_told_with_the_cure(text: str, cure: str) -> None:
    fault = parse_json(text, "quizzes/a.json")
    assert isinstance(fault, Fault) and f"({cure}" in fault.why


@pytest.mark.parametrize("text", ['{"q": "He said “no”" "b": 1}', '{"q": "“a”, then b" "c": 1}', '{"a" {', '{"q": }'])
def test_a_cure_is_told_only_where_it_is_one(text: str) -> None:
    fault = parse_json(text, "quizzes/a.json")
    assert isinstance(fault, Fault) and "(" not in fault.why


LESSON = json.loads((Path(__file__).parents[2] / "quizzes" / "1.3-check.json").read_text(encoding="utf-8"))
ANYTHING: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, 0, -1, 1.5, 10**30, "", "a", "$", "x" * 300, [], {}, [[]], [1, "a"], {"x-a": 1}]
)


def ways(value: Any, so_far: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The way to every value inside a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for step, inner in items:
        yield (*so_far, step)
        yield from ways(inner, (*so_far, step))


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(list(ways(LESSON))), ANYTHING)
def test_any_value_anywhere_in_the_lesson_is_right_or_a_fault_of_that_file(root: Path, way: Any, value: Any) -> None:
    quiz = copy.deepcopy(LESSON)
    place = quiz
    for step in way[:-1]:
        place = place[step]
    place[way[-1]] = value
    (root / "models" / "pendulum_servo.xml").write_text(XML)
    (root / "quizzes" / "quiz.json").write_text(json.dumps(quiz), encoding="utf-8")
    try:
        load(root)
    except ContentError as error:
        assert {fault.file for fault in error.faults} == {"quizzes/quiz.json"}


def test_a_question_without_starter(root: Path) -> None:
    library = load(root)
    assert library.starter(library.question("quiz", "q1")) is None
    question = ScriptQuestion.model_validate({**without(code(""), "starter"), "id": "q1"})
    assert library.starter(question) is None


def test_a_starter_is_handed_out_as_it_stands() -> None:
    question = ScriptQuestion.model_validate({**code("starters/s.py"), "id": "q1"})
    assert Library(Path(), {}, starters={"starters/s.py": "def solve(): ..."}).starter(question) == "def solve(): ..."


PART = """<mujoco><worldbody><body name="rod" pos="0 0 0.1234567891">
  <joint name="turn" axis="0 1 0" damping="0.0123456789"/><geom name="rod" size="0.1 0.3" type="capsule"/>
</body></worldbody></mujoco>"""
ATTACHING = """<mujoco><asset><model name="part" file="parts/part.xml"/></asset><worldbody>
  <attach model="part" body="rod" prefix="left-"/>
  <frame pos="1 0 0"><attach model="part" body="rod" prefix="right-"/></frame>
</worldbody></mujoco>"""


def test_a_model_that_attaches_another_is_one_text_bit_for_bit(root: Path) -> None:
    (root / "models/parts").mkdir()
    (root / "models/parts/part.xml").write_text(PART)
    (root / "models/two.xml").write_text(ATTACHING)
    written = load(root).model_xml("two")
    assert "parts/part.xml" not in written
    own, other = mujoco.MjModel.from_xml_string(written), mujoco.MjModel.from_xml_path(str(root / "models/two.xml"))
    assert own.body("right-rod").pos[2] == 0.1234567891
    assert own.joint("left-turn").damping == 0.0123456789
    for name in ("body_pos", "body_mass", "body_inertia", "geom_size", "dof_damping", "jnt_axis", "qpos0"):
        assert getattr(own, name).tobytes() == getattr(other, name).tobytes()


@pytest.mark.parametrize(
    ("part", "why"),
    [
        (None, "attaches 'parts/part.xml', which is not a file"),
        ("<mujoco", "attaches 'parts/part.xml': does not compile: not well-formed"),
        (ATTACHING, "attaches 'parts/part.xml' in 'parts/part.xml': no model may contain itself"),
        (PART.replace("<worldbody>", '<asset><mesh name="m" file="m.stl"/></asset><worldbody>'), "m.stl"),
        (PART.replace('name="rod" pos', 'name="other" pos'), "does not compile"),
        (
            '<mujoco><asset><model name="x" file="../../../etc/passwd"/></asset></mujoco>',
            "attaches '../../../etc/passwd'",
        ),
    ],
)
def test_what_cannot_be_attached_is_told(root: Path, part: str | None, why: str) -> None:
    (root / "models/parts").mkdir()
    if part is not None:
        (root / "models/parts/part.xml").write_text(part)
    (root / "models/two.xml").write_text(ATTACHING)
    (fault,) = faults(root)
    assert (fault.file, fault.key) == ("models/two.xml", "model")
    assert why in fault.why


def test_a_lab_of_an_unknown_kind_and_an_overlay_that_is_not_drawn_are_remarks(root: Path) -> None:
    odd = {"id": "odd", "kind": "simlabs", "model": "nowhere", "xml": '<mujoco><include file="x"/></mujoco>'}
    scene = {"id": "scene", "model": "ball", "overlays": {"frames": True, "auras": True}}
    write(root, MCQ, labs=[odd, scene])
    library = load(root)
    assert [lab.kind for lab in library.quiz("quiz").labs] == ["simlabs", "simlab"]
    assert [(w.key, w.why.split(":")[0]) for w in library.warnings] == [
        ("odd.kind", "there is no lab 'simlabs' (did you mean simlab?)"),
        ("scene.overlays", "auras"),
    ]


def test_one_quiz_alone_is_as_with_all_and_no_other_is_tried(root: Path) -> None:
    write(root, PREDICT, name="other")
    whole, alone = load(root), load(root, "quiz")
    assert (alone.quizzes, alone.digests) == ({"quiz": whole.quiz("quiz")}, {"quiz": whole.digest("quiz")})
    write(root, {**PREDICT, "sim": {**SIM, "setup": "data.nothing = 1"}}, name="other")
    assert load(root, "quiz").digests == alone.digests
    with pytest.raises(ContentError):
        load(root)
    write(root, without(MCQ, "answer"), name="other")
    with pytest.raises(ContentError):
        load(root, "quiz")


def test_an_element_that_the_model_does_not_have_is_a_fault(root: Path) -> None:
    lab = {"id": "lab", "model": "ball", "readouts": [{"label": "x", "expr": "data.qpos[70]"}]}
    verify = {"by": "outcome", "claims": ["data.qpos[7] > 0", "data.qpos[6] > 0"], "seconds": 0.1}
    number = {**NUMERIC, "verify": {"by": "expression", "expr": "model.body_mass[2]", "model": "ball"}}
    write(root, {**PREDICT, "verify": verify}, number, labs=[lab])
    assert told(root) == {
        "lab.readouts.0.expr": "line 1, column 1: there is no data.qpos[70]: data.qpos has 7 elements, from 0 to 6",
        "q1.verify.claims.0": "line 1, column 1: there is no data.qpos[7]: data.qpos has 7 elements, from 0 to 6",
        "q2.verify.expr": "line 1, column 1: there is no model.body_mass[2]: "
        "model.body_mass has 2 elements, from 0 to 1",
    }


@pytest.mark.parametrize("name", ["quizzes/other.jsn", "quizzes/1.2-x.json.txt", "models/other.mjcf", "models/a.XML"])
def test_a_file_with_another_ending_is_a_fault(root: Path, name: str) -> None:
    (root / name).write_text("{}", encoding="utf-8")
    [fault] = faults(root)
    assert (fault.file, fault.key) == (name, "ending")
    assert "rename it to" in fault.why


def test_other_files_beside_quizzes_and_models_are_no_fault(root: Path) -> None:
    for name in ("quizzes/README.md", "models/notes.txt", "quizzes/quiz.json~"):
        (root / name).write_text("", encoding="utf-8")
    assert load(root).quizzes


def test_equal_options_dates_in_words_and_misspelt_names_are_told_with_a_cure(root: Path) -> None:
    lab = {"id": "lab", "model": "bal", "readouts": [{"label": "x", "expr": "data.qops[0]"}]}
    write(root, {**MCQ, "options": ["a", "a "]}, labs=[lab], policy={"due": "19 October 2026"})
    by_key = told(root)
    assert by_key["q1.options"] == "'a ' is there twice: write each text once"
    assert by_key["policy.due"].startswith("must be a date and time with its offset, such as 2026-10-19T18:00+02:00")
    assert by_key["lab.model"].endswith("did you mean 'ball'?")
    write(root, labs=[{**lab, "model": "ball"}])
    assert told(root)["lab.readouts.0.expr"].endswith("data.qops cannot be read here: did you mean data.qpos?")


@pytest.mark.slow
@pytest.mark.parametrize("quiz", ["1.3-check", "1.3-exercises", "2.1-exercises", "4.1-exercises", "5.1-check"])
def test_a_quiz_that_is_loaded_for_one_question_is_the_same(quiz: str) -> None:
    """Its digest too, in which the texts that its exercises name take part."""
    whole = load(REPOSITORY, quiz, passed=PASSED)
    for question in (whole.quiz(quiz).questions[0], whole.quiz(quiz).questions[-1]):
        alone = load(REPOSITORY, quiz, question=question.id, passed=PASSED)
        assert alone.quizzes == whole.quizzes
        assert (alone.digest(quiz), alone.sources, alone.texts) == (whole.digest(quiz), whole.sources, whole.texts)
        assert (alone.warnings, alone.models, alone.starters) == ((), whole.models, whole.starters)


def test_the_lab_of_another_question_is_not_tried(root: Path) -> None:
    broken: dict[str, Any] = copy.deepcopy(PREDICT)
    broken["sim"]["controls"][0]["set"] = "model.opt.nothing"
    quiz = {"id": "a", "title": "A", "questions": [MCQ, broken]}
    (root / "quizzes" / "a.json").write_text(json.dumps(quiz))
    assert load(root, "a", question="q1").question("a", "q1").kind == "mcq"
    for question in ("q2", None):
        with pytest.raises(ContentError, match="nothing"):
            load(root, "a", question=question)


def test_a_kind_that_draws_nothing_is_told_of_draw_alone(root: Path) -> None:
    write(root, {**MCQ, "draw": {"v": [1, 2]}})
    assert list(told(root)) == ["q1.draw"]


def test_an_unknown_key_hides_no_fault_of_the_same_part(root: Path) -> None:
    faulty: Any = {"by": "expression", "model": "ball", "expr": "math.sqrt(data.qpos[0])"}
    sim = {**SIM, "controls": [{**SIM["controls"][0], "set": "model.opt.gravityy", "labl": ""}]}
    write(root, {**NUMERIC, "verify": {**faulty, "sed": 1}, "toll": 1}, {**PREDICT, "sim": sim})
    assert sorted(told(root)) == [
        "q1.toll", "q1.verify.expr", "q1.verify.sed", "q2.sim.controls.0.labl", "q2.sim.controls.0.set",
    ]  # fmt: skip


@pytest.mark.parametrize("criterion", [{}, {"criterion": "stable"}, {"criterion": "data.qpos[2] > 0"}])
def test_the_criterion_of_options_may_be_stability(root: Path, criterion: dict[str, str]) -> None:
    verify = {"by": "options", "settings": [{}, None], "seconds": 0.1, **criterion}
    write(root, {**PREDICT, "verify": verify})
    assert load(root).quizzes
