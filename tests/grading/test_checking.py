"""What `grader check` reports: verdicts that depend on the draw, and points for scripts that solve nothing."""

from pathlib import Path
from typing import Any

import pytest

from grader.domain.verdict import Status, Verdict
from grader.errors import NotFound
from grader.exercises.lazy import ODD
from grader.grading.checking import ReferenceProgram, Report, grade_lazy_answers, grade_references, read_demand
from grader.library import Library, load
from grader.questions.kinds.script import ScriptQuestion

ROOT = Path(__file__).parents[2]

FILE = "reference_solutions/q/limit/partial__too_short.py"


class Draws:
    """A pipeline whose verdict depends on the seed: every third is another."""

    def __init__(self, usual: tuple[Status, str | None], third: tuple[Status, str | None]) -> None:
        self.verdicts = (third, usual, usual)
        self.seeds: list[int] = []

    def grade(self, quiz: str, question: str, answer: Any, seed: int) -> Verdict:
        if quiz != "q":
            raise NotFound(f"there is no quiz {quiz!r}")
        self.seeds.append(seed)
        status, diagnosis = self.verdicts[len(self.seeds) % 3]
        return Verdict(status=status, points=0, max_points=1, diagnosis=diagnosis)


def faults(
    draws: Draws, count: int, diagnosis: str | None = None, status: str = "partial", quiz: str = "q"
) -> list[str]:
    report = Report()
    program = ReferenceProgram(FILE, "source", quiz, "limit", status, diagnosis)
    grade_references(draws, [program], report, lambda text: None, count)  # type: ignore[arg-type]
    assert {fault.file for fault in report.faults} <= {FILE}
    assert report.references[0]["file"] == FILE
    return [fault.why for fault in report.faults]


SHORT, LONG = (Status.PARTIAL, "Your runs are too short."), (Status.PARTIAL, "Your runs are too long.")


def test_one_status_and_one_diagnosis_under_every_draw_is_what_is_asked() -> None:
    draws = Draws(SHORT, SHORT)
    assert faults(draws, 6, "too short") == []
    assert len(set(draws.seeds)) == 6


def test_a_program_says_what_it_gets_from_a_version_of_mujoco_on() -> None:
    source = (
        "# diagnosis: Too short.\n# from MuJoCo 4.0.0: incorrect: Second order.\nx = 1\n# from MuJoCo 3.0.0: crashed"
    )
    assert read_demand(source, "partial", "3.14.0") == ("partial", "Too short.")
    for installed in ("4.0.0", "4.1.2", "10.0.0"):
        assert read_demand(source, "partial", installed) == ("incorrect", "Second order.")
    right = "# from MuJoCo 4.0.0: incorrect: Second order.\n# from MuJoCo 4.2.0: correct"
    assert read_demand(right, "correct", "3.14.0") == read_demand(right, "correct", "4.2.0") == ("correct", None)
    assert read_demand("x = 1", "correct", "4.0.0") == ("correct", None)


def test_another_status_in_some_draws_is_told_with_a_seed() -> None:
    draws = Draws(SHORT, (Status.INCORRECT, None))
    found = faults(draws, 6)
    usual = "the verdict depends on the draw: partial (Your runs are too short.)"
    assert found[0] == f"{usual} in 4 of 6 draws, as with --seed {draws.seeds[0]}"
    assert found[1] == f"graded incorrect in 2 of 6 draws, as with --seed {draws.seeds[2]}"


def test_another_diagnosis_in_some_draws_is_told() -> None:
    assert [why.partition(":")[0] for why in faults(Draws(SHORT, LONG), 3)] == ["the verdict depends on the draw"] * 2
    assert faults(Draws(SHORT, LONG), 3, "too short")[1].startswith(
        "diagnosis is 'Your runs are too long.', not 'too short' in 1 of 3 draws"
    )


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"status": "wrong"}, "the name must begin with a status: correct, partial"),
        ({"status": "correct"}, "graded partial (Your runs are too short.)"),
        ({"diagnosis": "one second"}, "diagnosis is 'Your runs are too short.', not 'one second'"),
        ({"quiz": "r"}, "graded not found (there is no quiz 'r')"),
    ],
)
def test_a_wrong_verdict_is_told_once(changes: dict[str, str], why: str) -> None:
    (found,) = faults(Draws(SHORT, SHORT), 1, **changes)
    assert found.startswith(why)


class Generous:
    """A pipeline that gives every script the same points, as if lazy answers were right somewhere."""

    def __init__(self, library: Library, points: float) -> None:
        self.library, self.points = library, points

    def grade(self, quiz: str, question: str, answer: Any) -> Verdict:
        return Verdict(status=Status.PARTIAL, points=self.points, max_points=3)


class Broadcasting(Generous):
    """A pipeline that finds nothing to object to in empty arrays."""

    def grade(self, quiz: str, question: str, answer: Any) -> Verdict:
        points = self.points if "np.zeros(0)" in answer["source"] else 0.0
        return Verdict(status=Status.PARTIAL, points=points, max_points=3)


@pytest.fixture(scope="module")
def lesson() -> Library:
    return load(ROOT)


@pytest.mark.parametrize(
    ("points", "refused"),
    [
        (0.0, []),
        (0.5, ["the starter"]),
        (1.0, ["the starter"]),  # a third of the points is the visible case's
        (1.2, ["the starter", "None for every model", "the visible model's limits for every model", *ODD]),
    ],
)
def test_a_script_that_does_not_solve_the_exercise_may_not_earn_what_solving_does(
    points: float, refused: list[str], lesson: Library
) -> None:
    servo = lesson.question("1.3-exercises", "servo-threshold")
    assert isinstance(servo, ScriptQuestion)
    pipeline: Any = Generous(lesson, points)
    found = list(grade_lazy_answers(pipeline, "1.3-exercises", servo, lambda text: None))
    assert [fault.why.partition(" earns ")[0] for fault in found] == refused
    assert all(fault.key == "servo-threshold.check" and "may earn" in fault.why for fault in found)


@pytest.mark.parametrize("id_", ["servo-threshold", "rk4-step", "rk4-free-joint"])
def test_no_kind_may_give_more_for_empty_arrays_than_for_none(id_: str, lesson: Library) -> None:
    question = lesson.question("1.3-exercises", id_)
    assert isinstance(question, ScriptQuestion)
    pipeline: Any = Broadcasting(lesson, 0.1)
    (found,) = grade_lazy_answers(pipeline, "1.3-exercises", question, lambda text: None)
    assert found.why.startswith("empty arrays earns 0.1 points, and may earn 0 at most")
