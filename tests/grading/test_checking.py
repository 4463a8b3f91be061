"""What `grader check` reports: verdicts that depend on the draw, and points for scripts that solve nothing."""

import json
import os
import shutil
from pathlib import Path
from typing import Any, NoReturn

import pytest

from grader.commands.grade import open_pipeline
from grader.domain.verdict import Status, Verdict
from grader.errors import Fault, NotFound
from grader.exercises import luck
from grader.exercises.running.lazy import ODD
from grader.grading.checking import ContentCheck, check_content
from grader.grading.references import ReferenceProgram, read_demand
from grader.grading.selection import Selection
from grader.library import Library, PassedChecks
from grader.questions.kinds.script import ScriptQuestion
from support.content import load_content

ROOT = Path(__file__).parents[2]
LESSON = Path(os.environ["GRADER_CONTENT"])
"""The content of one lesson: what is lazy at a controller takes a second each."""

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
    pipeline: Any = draws
    check = ContentCheck(Library(Path(), {}), Path(), lambda: pipeline, lambda text: None, count)
    check.grade_references([ReferenceProgram(FILE, "source", quiz, "limit", status, diagnosis)])
    report = check.report
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
    messages = faults(draws, 6)
    usual = "the verdict depends on the draw: partial (Your runs are too short.)"
    assert messages[0] == f"{usual} in 4 of 6 draws, as with --seed {draws.seeds[0]}"
    assert messages[1] == f"graded incorrect in 2 of 6 draws, as with --seed {draws.seeds[2]}"


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
        ({"quiz": "r"}, "graded not found (there is no quiz 'r'); rename the folder"),
    ],
)
def test_a_wrong_verdict_is_told_once(changes: dict[str, str], why: str) -> None:
    (message,) = faults(Draws(SHORT, SHORT), 1, **changes)
    assert message.startswith(why)


class Generous:
    """A pipeline that gives every script the same points, as if lazy answers were right somewhere."""

    def __init__(self, library: Library, points: float) -> None:
        self.library, self.points = library, points

    def grade(self, quiz: str, question: str, answer: Any, seed: int) -> Verdict:
        return Verdict(status=Status.PARTIAL, points=self.points, max_points=3)


class Broadcasting(Generous):
    """A pipeline that finds nothing to object to in empty arrays."""

    def grade(self, quiz: str, question: str, answer: Any, seed: int) -> Verdict:
        points = self.points if "np.zeros(0)" in answer["source"] else 0.0
        return Verdict(status=Status.PARTIAL, points=points, max_points=3)


def test_an_unchanged_folder_needs_no_jail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The reports are the same, also the lines of progress."""
    monkeypatch.setattr(luck, "DRAWS", 10)  # which bound the chance loosely
    program = tmp_path / "reference_solutions/1.3-exercises/servo-threshold/correct__spectral_radius.py"
    program.parent.mkdir(parents=True)
    program.write_bytes((ROOT / program.relative_to(tmp_path)).read_bytes())
    for name in ("quizzes", "models"):
        shutil.copytree(LESSON / name, tmp_path / name)
    file = tmp_path / "quizzes" / "1.3-exercises.json"
    quiz = json.loads(file.read_text())
    quiz["questions"] = [question for question in quiz["questions"] if question["id"] == "servo-threshold"]
    quiz["questions"][0]["check"]["luck"] = 0.9
    file.write_text(json.dumps(quiz))
    checks = PassedChecks(tmp_path / "cache")
    first: list[str] = []
    again: list[str] = []
    cold = check_content(tmp_path, open_pipeline, first.append, passed=checks)
    warm = check_content(tmp_path, lambda _: pytest.fail("a jail is started"), again.append, passed=checks)
    assert cold.to_json()["ok"]
    assert (cold.to_json(), first) == (warm.to_json(), again)
    program.write_text("# not as before\n" + program.read_text())
    with pytest.raises(LookupError, match="it starts"):
        check_content(tmp_path, refuse, again.append, passed=checks)


def refuse(_library: Library) -> NoReturn:
    raise LookupError("it starts")


def find_lazy_faults(pipeline: Any, question: ScriptQuestion) -> list[Fault]:
    check = ContentCheck(pipeline.library, ROOT, lambda: pipeline, lambda text: None)
    check.grade_lazy_answers("1.3-exercises", question)
    return check.report.faults


@pytest.fixture(scope="module")
def lesson() -> Library:
    return load_content()


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
    lazy_faults = find_lazy_faults(pipeline, servo)
    subjects = [name if name == "the starter" else f"the answer {name!r}" for name in refused]
    assert [fault.why.partition(" earns ")[0] for fault in lazy_faults] == subjects
    assert all(fault.key == "servo-threshold.check" and "may earn" in fault.why for fault in lazy_faults)


@pytest.mark.parametrize("id_", ["servo-threshold", "rk4-step", "rk4-free-joint"])
def test_no_kind_may_give_more_for_empty_arrays_than_for_none(id_: str, lesson: Library) -> None:
    question = lesson.question("1.3-exercises", id_)
    assert isinstance(question, ScriptQuestion)
    pipeline: Any = Broadcasting(lesson, 0.1)
    (fault,) = find_lazy_faults(pipeline, question)
    assert fault.why.startswith("the answer 'empty arrays' earns 0.1 points, and may earn 0 at most")


def test_one_question_alone_is_checked_and_says_what_it_does(tmp_path: Path) -> None:
    for name in ("quizzes", "models"):
        shutil.copytree(LESSON / name, tmp_path / name)
    done: list[str] = []
    report = check_content(
        tmp_path, refuse, lambda _: None, only=Selection("1.3-check", "q2"), doing=done.append
    )  # no jail is needed
    assert [certificate["question"] for certificate in report.certificates] == ["q2"]
    assert (report.faults, report.warnings, report.references) == ([], [], [])
    assert "certifying the key of 1.3-check q2" in done
    absent = check_content(tmp_path, refuse, lambda _: None, only=Selection.parse("1.3-check/q9"))
    assert [str(fault) for fault in absent.faults] == ["--only: q9: is not there: take one of q1, q2, q3, q4"]


HALF = """
def largest_stable_timestep(model, integrator):
    return {share} * model.body_mass[model.jnt_bodyid[0]] / model.actuator_gainprm[0, 0]
"""


def test_each_mistake_of_the_authors_is_told_its_own_sentence_or_is_a_fault(tmp_path: Path) -> None:
    for name in ("quizzes", "models"):
        shutil.copytree(LESSON / name, tmp_path / name)
    (tmp_path / "programs").mkdir()
    for name, source in (("one", HALF.format(share=1)), ("same", HALF.format(share=1.0))):
        (tmp_path / f"programs/{name}.py").write_text(source)
    file = tmp_path / "quizzes" / "1.3-exercises.json"
    quiz = json.loads(file.read_text())
    quiz["questions"] = [question for question in quiz["questions"] if question["id"] == "servo-threshold"]
    sentences = {"one": "It is no stiffness.", "same": "It is the same."}
    mistakes = [{"program": f"programs/{name}.py", "sentence": said} for name, said in sentences.items()]
    quiz["questions"][0]["check"] |= {"mistakes": mistakes[:1], "luck": 1}  # nothing is drawn to bound it
    file.write_text(json.dumps(quiz))
    checks, only = PassedChecks(tmp_path / "cache"), Selection("1.3-exercises", "servo-threshold")
    said: list[str] = []
    assert check_content(tmp_path, open_pipeline, said.append, passed=checks, only=only).to_json()["ok"]
    assert any("programs/one.py is incorrect: It is no stiffness." in line for line in said)
    again = check_content(tmp_path, lambda _: pytest.fail("a jail is started"), said.append, passed=checks, only=only)
    assert again.to_json()["ok"]
    (tmp_path / "programs/one.py").write_text(HALF.format(share=2))
    with pytest.raises(LookupError, match="it starts"):
        check_content(tmp_path, refuse, said.append, passed=checks, only=only)
    (tmp_path / "programs/one.py").write_text(HALF.format(share=1))
    quiz["questions"][0]["check"]["mistakes"] = mistakes
    file.write_text(json.dumps(quiz))
    [fault] = check_content(tmp_path, open_pipeline, said.append, passed=checks, only=only).faults
    assert fault.key == "servo-threshold.check.mistakes.1.program"
    assert "told 'It is no stiffness.', not its own sentence" in fault.why
