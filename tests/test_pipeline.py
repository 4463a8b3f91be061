"""A submission through the pipeline, without the jail: what breaks on our side never costs the learner."""

from pathlib import Path

import pytest

from grader.domain.run import SOURCE_BYTES_MAX, Job, RunReport, RunStatus
from grader.domain.verdict import Status
from grader.errors import JailFault, NotFound, TooLarge, Unprocessable
from grader.library import Library, load
from grader.pipeline import JAIL_TRIES, Pipeline
from grader.sandbox.jail import Jail

ROOT = Path(__file__).parents[1]
SCRIPT = {"source": "def largest_stable_timestep(model, integrator):\n    return None\n"}


@pytest.fixture(scope="module")
def library() -> Library:
    return load(ROOT)


class BrokenJail:
    """Breaks `times` times, then reports a crash of the script."""

    def __init__(self, times: int) -> None:
        self.times, self.calls = times, 0

    def run(self, job: Job) -> RunReport:
        self.calls += 1
        if self.calls <= self.times:
            raise JailFault("broken")
        return RunReport(RunStatus.CRASHED, "ZeroDivisionError: division by zero", stdout="hello\n")


def test_a_jail_that_stays_broken_is_a_grader_fault(library: Library) -> None:
    jail = BrokenJail(times=99)
    verdict = Pipeline(library, jail.run).grade("1.3-exercises", "servo-threshold", SCRIPT)
    assert verdict.status is Status.GRADER_FAULT
    assert not verdict.status.uses_attempt
    assert jail.calls == JAIL_TRIES


def test_a_jail_that_broke_once_is_tried_again(library: Library) -> None:
    verdict = Pipeline(library, BrokenJail(times=1).run).grade("1.3-exercises", "servo-threshold", SCRIPT)
    assert verdict.status is Status.CRASHED
    assert verdict.stdout == "hello\n"
    assert "ZeroDivisionError" in (verdict.diagnosis or "")


def test_a_crash_of_our_own_code_is_a_grader_fault(library: Library) -> None:
    def run(job: Job) -> RunReport:
        raise ValueError("a bug of ours")

    assert Pipeline(library, run).grade("1.3-exercises", "servo-threshold", SCRIPT).status is Status.GRADER_FAULT


def test_a_byte_order_mark_is_no_mistake_of_the_students(library: Library) -> None:
    sources: list[str] = []

    def run(job: Job) -> RunReport:
        sources.append(job.source)
        return RunReport(RunStatus.CRASHED, "")

    Pipeline(library, run).grade("1.3-exercises", "servo-threshold", {"source": "\ufeffx = 1\n"})
    assert sources == ["x = 1\n"]


def test_every_verdict_says_what_it_was_judged_by(library: Library) -> None:
    verdict = Pipeline(library).grade("1.3-check", "q2", "5 ms")
    assert verdict.content_digest == library.digest("1.3-check")
    assert verdict.environment["mujoco"] == "3.14.0"
    assert len(verdict.submission_digest) == 64


@pytest.mark.parametrize(
    ("answer", "error"),
    [
        ({"source": "x" * (SOURCE_BYTES_MAX + 1)}, TooLarge),
        ({"source": "\ud800"}, Unprocessable),
        ({"source": 5}, Unprocessable),
        ("print()", Unprocessable),
    ],
)
def test_an_unusable_source_is_refused(library: Library, answer: object, error: type[Exception]) -> None:
    with pytest.raises(error):
        Pipeline(library).grade("1.3-exercises", "servo-threshold", answer)


def test_an_empty_script_uses_no_attempt(library: Library) -> None:
    verdict = Pipeline(library).grade("1.3-exercises", "servo-threshold", {"source": " \n"})
    assert verdict.status is Status.INVALID_ANSWER


def test_what_is_not_there(library: Library) -> None:
    with pytest.raises(NotFound):
        Pipeline(library).grade("1.3-check", "q99", 1)


def test_the_explanation_of_an_exercise_comes_with_full_marks_only(library: Library) -> None:
    folder = ROOT / "reference_solutions/1.3-exercises/servo-threshold"
    with Jail(ROOT / "models", workers=1) as jail:
        pipeline = Pipeline(library, jail.run)
        for name in ("correct__spectral_radius.py", "partial__forgets_kv.py"):
            source = (folder / name).read_text(encoding="utf-8")
            verdict = pipeline.grade("1.3-exercises", "servo-threshold", {"source": source})
            assert (verdict.explain is not None) == name.startswith("correct")
