"""The numbers of verdicts on the axes of their limits: for the reference programs of every kind, and whatever a stored
verdict holds."""

import json
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.domain.axes import ClassAxis, Position, place_number
from grader.domain.run import RunReport
from grader.exercises import find_placing, judge_exercise, plan_exercise
from grader.grading.references import ReferenceProgram, find_references
from grader.library import Library, load
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.content import PASSED

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
Placed = dict[str, tuple[ClassAxis, Position | None]]


@cache
def load_content(folder: Path) -> tuple[Library, dict[str, ReferenceProgram]]:
    """A content folder, and its reference programs by their path below reference_solutions."""
    library = load(folder, passed=PASSED)
    programs = [reference for reference in find_references(folder) if isinstance(reference, ReferenceProgram)]
    return library, {program.file.removeprefix("reference_solutions/"): program for program in programs}


def read_exercise(library: Library, quiz: str, question: str) -> ScriptQuestion:
    exercise = library.question(quiz, question)
    assert isinstance(exercise, ScriptQuestion)
    return exercise


def judge(jail: Jail, folder: Path, file: str) -> tuple[dict[str, Any], Placed]:
    """The stored verdict on a reference program, and where it lies on the axes of its exercise."""
    library, programs = load_content(folder)
    program = programs[file]
    question = read_exercise(library, program.quiz, program.question)
    plan = plan_exercise(question, library.model_xml, 1, library.text)
    run: Callable[..., RunReport] = jail.run
    report = run(plan.build_job(program.source, question.limits))
    verdict = json.loads(judge_exercise(question, plan, report, run, program.source).model_dump_json())
    placed = list(find_placing(question)(verdict))
    assert len({axis.id for axis, _ in placed}) == len(placed)
    assert all(axis.title for axis, _ in placed)
    return verdict, {axis.id: (axis, position) for axis, position in placed}


LESSON, VALUES = ROOT, HERE / "values"
PROGRAMS = [
    (LESSON, "1.3-exercises/servo-threshold/correct__spectral_radius.py", "lesson.Euler", True),
    (LESSON, "1.3-exercises/servo-threshold/incorrect__returns_the_bound.py", "lesson.Euler", False),
    (LESSON, "1.3-exercises/rk4-step/correct__classical.py", "double-pendulum", True),
    (LESSON, "1.3-exercises/rk4-step/incorrect__heun.py", "double-pendulum", False),
    (LESSON, "1.3-exercises/rk4-step/incorrect__heun.py", "order", False),
    (VALUES, "motion/rotor-acceleration/correct__lagrange.py", "level", True),
    (VALUES, "motion/rotor-acceleration/partial__degrees.py", "level", False),
    (VALUES, "motion/pendulum-step/correct__numpy.py", "wheel", True),
    (VALUES, "motion/pendulum-step/partial__starts_late.py", "wheel", False),
    (LESSON, "2.1-exercises/swing/correct__crossings_between_frames.py", "given.period", True),
    (LESSON, "2.1-exercises/swing/partial__milliseconds.py", "given.period", False),
    (LESSON, "3.1-exercises/servo-arm/correct__computed_torque.py", "up.settling", True),
    (LESSON, "3.1-exercises/servo-arm/incorrect__no_gravity.py", "up.settling", False),
    (LESSON, "5.1-exercises/cart-pole-policy/correct__riccati.npz", "some", True),
    (LESSON, "5.1-exercises/cart-pole-policy/incorrect__sign.npz", "some", False),
    (LESSON, "4.1-exercises/arm/correct__as_the_author.xml", "goals", True),
    (LESSON, "4.1-exercises/arm/partial__no_damping.xml", "goals", False),
]


@pytest.fixture(scope="module")
def jail() -> Any:
    with Jail(ROOT / "models", workers=2) as jail:
        yield jail


@pytest.mark.jail
@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "file", "id_", "is_right"), PROGRAMS, ids=[f"{program[1]}-{program[2]}" for program in PROGRAMS]
)
def test_a_program_lies_on_the_side_of_the_limit_that_the_judge_says(
    jail: Jail, folder: Path, file: str, id_: str, is_right: bool
) -> None:
    verdict, placed = judge(jail, folder, file)
    assert id_ in placed, (sorted(placed), [finding["id"] for finding in verdict["findings"]])
    axis, position = placed[id_]
    assert axis.right is not None and axis.limit is not None
    assert position is not None and axis.accepts(position) is is_right
    if not position.is_none and not axis.is_limit:
        low, high = axis.right
        assert (low <= position.middle <= high) is is_right
    hidden = {finding["id"] for finding in verdict["findings"] if finding["title"].startswith("hidden case")}
    assert not hidden & placed.keys()  # what nobody is told stands on no axis
    passed = {finding["id"]: finding["passed"] for finding in verdict["findings"]}
    for other, (axis, position) in placed.items():
        if other in passed and position is not None and not axis.is_limit:
            assert axis.accepts(position) is passed[other], other


def list_exercises() -> list[tuple[str, ScriptQuestion]]:
    """An exercise of every kind that places."""
    lesson, values = load_content(LESSON)[0], load_content(VALUES)[0]
    return [
        ("threshold", read_exercise(lesson, "1.3-exercises", "servo-threshold")),
        ("rk4", read_exercise(lesson, "1.3-exercises", "rk4-step")),
        ("values", read_exercise(values, "motion", "pendulum-step")),
        ("claims", read_exercise(lesson, "2.1-exercises", "energies")),
        ("controller", read_exercise(lesson, "3.1-exercises", "servo-arm")),
        ("policy", read_exercise(lesson, "5.1-exercises", "cart-pole-policy")),
        ("model", read_exercise(lesson, "4.1-exercises", "arm")),
    ]


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(("qpos", "case", "size")), inner),
    max_leaves=6,
)
IDS = ("lesson.Euler", "double-pendulum", "order", "given", "wheel", "up.rms", "up", "some", "lean", "parts.1", "goals")
NAMES = ("claims", "limits", "values", "residuals", "value", "differences", "order")
KEYS = ("case", "claim_ms", "said_none", "linear_ms", "result", "computed", "expected", "size")
findings = st.fixed_dictionaries(
    {"id": st.sampled_from(IDS)},
    optional={"title": json_values, "passed": json_values, "measured": json_values, "expected": json_values},
)
rows = st.dictionaries(st.sampled_from(KEYS), json_values | st.sampled_from((*IDS, "angle", "angles")))
evidence = st.dictionaries(st.sampled_from(NAMES), json_values | st.lists(rows, max_size=3))


@given(findings=st.lists(findings | json_values, max_size=4), evidence=st.none() | evidence)
def test_what_cannot_be_read_is_left_out(findings: list[Any], evidence: dict[str, Any] | None) -> None:
    for kind, question in list_exercises():
        for axis, position in find_placing(question)({"findings": findings, "evidence": evidence}):
            assert isinstance(axis.id, str), kind
            assert position is None or position.is_none or math.isfinite(position.middle)
        assert list(find_placing(question)({})) == []


def make_brackets(claim: object, *, said_none: bool = False, linear: object = 20.0) -> dict[str, Any]:
    limits = [{"case": "a.Euler", "linear_ms": linear, "within_ms": 20.1, "spring_ms": 22.4}]
    claims = [{"case": "a.Euler", "claim_ms": claim, "said_none": said_none}]
    return {"findings": [{"id": "a.Euler", "title": "kp, Euler"}], "evidence": {"claims": claims, "limits": limits}}


def place_bracket(verdict: dict[str, Any]) -> tuple[ClassAxis, Position | None]:
    [placed] = find_placing(dict(list_exercises())["threshold"])(verdict)
    return placed


def test_a_bracket_has_to_hold_the_limit() -> None:
    axis, position = place_bracket(make_brackets([19.9, 20.2]))
    assert (axis.title, axis.unit, axis.right, axis.marks[0][1]) == ("kp, Euler", "ms", (20.0, 20.1), 22.4)
    assert position == Position(19.9, 20.2) and axis.accepts(position) and axis.accepts(Position(20.05, 20.3))
    assert not axis.accepts(Position(22.1, 22.6)) and not axis.accepts(place_number(None))


def test_without_a_limit_none_is_right() -> None:
    axis, position = place_bracket(make_brackets(None, said_none=True, linear=None))
    assert axis.right is None and position is not None and position.is_none and axis.accepts(position)
    assert not axis.accepts(Position(20, 21))


@pytest.mark.parametrize("claim", ["x", [1], [1, None], [math.inf, 2], {"a": 1}, None, [True, False]])
def test_a_bracket_that_cannot_be_read_has_no_place(claim: object) -> None:
    assert place_bracket(make_brackets(claim))[1] is None
