"""The pipeline: reading, seeds, retries; a fault of ours never costs the learner an attempt."""

import hashlib
import json
import threading
from pathlib import Path

import pytest

from grader import exercises
from grader.domain.run import SOURCE_BYTES_MAX, Job, RunReport, RunStatus
from grader.domain.verdict import Status, Verdict
from grader.errors import JailFault, NotFound, TooLarge, Unprocessable
from grader.exercises import Plan, prepare_exercise
from grader.grading import pipeline
from grader.grading.pipeline import COMMAND_RETRIES, Pipeline, Retries, compute_digest, compute_seed, to_canonical_json
from grader.library import Library, load
from grader.numerics import scene
from grader.numerics.version import INSTALLED
from grader.questions import Question, grade_answer
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.content import load_content

ROOT = Path(__file__).parents[2]
SCRIPT = {"source": "def largest_stable_timestep(model, integrator):\n    return None\n"}


@pytest.fixture(scope="module")
def library() -> Library:
    return load_content()


class BrokenJail:
    """Breaks `times` times, then reports a crash of the script."""

    def __init__(self, times: int) -> None:
        self.times, self.calls = times, 0

    def run(self, job: Job) -> RunReport:
        self.calls += 1
        if self.calls <= self.times:
            raise JailFault("broken")
        return RunReport(
            RunStatus.CRASHED, "ZeroDivisionError: division by zero, in line 1 of your script", stdout="hello\n"
        )


def test_a_key_that_cannot_be_derived_for_a_learner_is_a_grader_fault(tmp_path: Path) -> None:
    """From the top of a circle, rounding decides to which side a pendulum falls."""
    xml = """<mujoco><worldbody><body><inertial pos="0 0 -0.5" mass="1" diaginertia="1e-4 1e-4 1e-4"/>
    <joint axis="0 1 0"/></body></worldbody></mujoco>"""
    verify = {"by": "measurement", "xml": xml, "setup": "data.qpos[0] = {a} > 1.1 && {a} < 3.9 ? Math.PI : 0",
              "expr": "Math.sin(data.qpos[0])", "seconds": 6}  # fmt: skip
    question = {"id": "q", "kind": "numeric", "q": "{a}", "draw": {"a": [1, 4]}, "answer": 0, "tol": 0.01}
    (tmp_path / "quizzes").mkdir()
    quiz = {"id": "a", "title": "A", "questions": [{**question, "verify": verify}]}
    (tmp_path / "quizzes" / "a.json").write_text(json.dumps(quiz))
    pipeline = Pipeline(load(tmp_path))
    for answer in (0, "no number"):
        verdict = pipeline.grade("a", "q", answer, seed=1)
        assert verdict.status is Status.GRADER_FAULT


def test_a_jail_that_stays_broken_is_a_grader_fault(library: Library) -> None:
    jail = BrokenJail(times=99)
    verdict = Pipeline(library, jail.run).grade("1.3-exercises", "servo-threshold", SCRIPT)
    assert verdict.status is Status.GRADER_FAULT
    assert not verdict.status.uses_attempt
    assert jail.calls == COMMAND_RETRIES.tries


def test_one_try_is_one_run_of_the_jail(library: Library) -> None:
    jail = BrokenJail(times=1)
    pipeline = Pipeline(library, jail.run)
    assert pipeline.judge(pipeline.read("1.3-exercises", "servo-threshold", SCRIPT)).status is Status.GRADER_FAULT
    assert jail.calls == 1


def test_pauses_double_until_the_last_try() -> None:
    retries = Retries(tries=3, pause_s=2.0)
    assert [retries.pause_after(tried) for tried in (1, 2, 3, 4)] == [2.0, 4.0, None, None]


def test_a_jail_that_broke_once_is_tried_again(library: Library) -> None:
    verdict = Pipeline(library, BrokenJail(times=1).run).grade("1.3-exercises", "servo-threshold", SCRIPT)
    assert verdict.status is Status.CRASHED
    assert verdict.stdout == "hello\n"
    assert "ZeroDivisionError" in (verdict.diagnosis or "")


def test_a_crash_of_our_own_code_is_a_grader_fault(library: Library) -> None:
    def run(job: Job) -> RunReport:
        raise ValueError("a bug of ours")

    assert Pipeline(library, run).grade("1.3-exercises", "servo-threshold", SCRIPT).status is Status.GRADER_FAULT


@pytest.mark.parametrize(
    ("report", "status"),
    [
        (RunReport(RunStatus.CRASHED, "NameError, in line 1 of your script"), Status.CRASHED),
        (RunReport(RunStatus.TIMED_OUT, "too slow"), Status.TIMED_OUT),
        (RunReport(RunStatus.RETURNED), Status.GRADER_FAULT),
    ],
)
def test_a_fault_in_preparing_hides_no_crash_of_the_script(
    report: RunReport, status: Status, library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    def prepare(*_: object) -> None:
        raise ValueError("a bug of the kind's")

    monkeypatch.setattr(exercises, "prepare_exercise", prepare)
    graded = Pipeline(library, lambda _: report)
    verdict = graded.judge(graded.read("1.3-exercises", "servo-threshold", SCRIPT))
    assert verdict.status is status


def test_models_are_compiled_while_the_script_runs(library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    """Planning compiles the visible one alone, and judging no further one. The hidden ones go to the jail with the
    hidden inputs, and no earlier."""
    counts, prepared = [compiled()], threading.Event()

    def prepare(question: ScriptQuestion, plan: Plan) -> None:
        prepare_exercise(question, plan)
        prepared.set()

    def run(job: Job) -> RunReport:
        visible, hidden = (
            {trial["inputs"]["model"] for trial in part["trials"]} for part in (job.inputs, job.hidden_inputs)
        )
        counts.append(compiled())
        assert not prepared.is_set()
        job.sent()
        assert prepared.wait(60)
        counts.append(compiled())
        assert {*job.inputs["models"]} == visible
        assert {*job.late_inputs()["models"]} == hidden
        assert len(hidden) == 6 and not visible & hidden
        return RunReport(RunStatus.RETURNED)

    monkeypatch.setattr(exercises, "prepare_exercise", prepare)
    verdict = Pipeline(library, run).grade("1.3-exercises", "servo-threshold", SCRIPT)
    before, planned, running = counts
    assert verdict.status is Status.INCORRECT
    assert planned <= before + 1
    assert compiled() == running >= planned + 6


def test_the_jail_compiles_hidden_models_where_that_fails_here(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    def save(*_: object) -> None:
        raise ValueError("a bug of the kind's")

    def run(job: Job) -> RunReport:
        assert job.late_inputs() == {}
        return RunReport(RunStatus.CRASHED, "it crashed, in line 1 of your script")

    monkeypatch.setattr(exercises, "save_hidden_models", save)
    verdict = Pipeline(library, run).grade("1.3-exercises", "servo-threshold", SCRIPT)
    assert (verdict.status, verdict.diagnosis) == (Status.CRASHED, "it crashed, in line 1 of your script")


def compiled() -> int:
    """How many models were compiled in this process."""
    return scene._compile.cache_info().misses


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
    assert verdict.environment["mujoco"] == INSTALLED
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
    parsed = Pipeline(library).read("1.3-exercises", "servo-threshold", {"source": " \n"})
    assert parsed.is_instant and parsed.seed is None
    verdict = Pipeline(library).grade("1.3-exercises", "servo-threshold", {"source": " \n"})
    assert verdict.status is Status.INVALID_ANSWER


@pytest.mark.parametrize(
    ("source", "told"),
    [
        (' {"cells": [], "metadata": {}, "nbformat": 4, "nbformat_minor": 5}', "This is a notebook: hand in its code"),
        ("PK\x03\x04\x00\x00", "This is no text: load the script itself"),
    ],
)
def test_what_is_no_script_uses_no_attempt(library: Library, source: str, told: str) -> None:
    verdict = Pipeline(library).grade("1.3-exercises", "servo-threshold", {"source": source})
    assert verdict.status is Status.INVALID_ANSWER
    assert told in (verdict.diagnosis or verdict.findings[0].message)


@pytest.mark.parametrize("source", ['{"cells": 1, "nbformat"', '{"cells": 1}', "{1, 2}", "{" * 5000])
def test_a_script_that_begins_with_a_brace_is_none_the_less_a_script(library: Library, source: str) -> None:
    assert Pipeline(library).read("1.3-exercises", "servo-threshold", {"source": source}).refusal is None


def test_an_unknown_question_is_not_found(library: Library) -> None:
    with pytest.raises(NotFound):
        Pipeline(library).grade("1.3-check", "q99", 1)


def test_the_explanation_of_an_exercise_comes_with_full_marks_only(library: Library) -> None:
    folder = ROOT / "reference_solutions/1.3-exercises/servo-threshold"
    with Jail(ROOT / "models", workers=1) as jail:
        pipeline = Pipeline(library, jail.run)
        for name in ("correct__spectral_radius.py", "incorrect__half_a_second.py"):
            source = (folder / name).read_text(encoding="utf-8")
            verdict = pipeline.grade("1.3-exercises", "servo-threshold", {"source": source})
            assert (verdict.explain is not None) == name.startswith("correct")


def test_a_submission_is_read_into_everything_that_is_stored(library: Library) -> None:
    parsed = Pipeline(library).read("1.3-check", "q2", "5\u00a0ms")
    assert parsed.text == '"5\\u00a0ms"'
    assert parsed.digest == hashlib.sha256(b'["1.3-check","q2","5\\u00a0ms"]').hexdigest()
    assert (parsed.question.id, parsed.is_instant, parsed.seed) == ("q2", True, None)


def test_equal_answers_have_one_canonical_text() -> None:
    assert (
        to_canonical_json({"b": [1, {}], "a": None})
        == to_canonical_json({"a": None, "b": [1, {}]})
        == '{"a":null,"b":[1,{}]}'
    )
    assert compute_digest("a", "b", "1") != compute_digest("a", "b", '"1"')


@pytest.mark.parametrize("answer", ["\ud800", {"source": "\ud800"}, {"\ud800": 1}, [["\udfff"]]])
def test_text_that_is_not_utf8_is_refused(library: Library, answer: object) -> None:
    with pytest.raises(Unprocessable, match="UTF-8"):
        Pipeline(library).read("1.3-check", "q2", answer)


def test_the_seed_depends_on_the_secret_and_on_the_submission(library: Library) -> None:
    ours, theirs = (Pipeline(library, secret=secret) for secret in (b"a" * 32, b"b" * 32))
    other = {"source": SCRIPT["source"] + "# another comment\n"}

    def seed(pipeline: Pipeline, answer: object) -> int | None:
        return pipeline.read("1.3-exercises", "servo-threshold", answer).seed

    assert seed(ours, SCRIPT) == seed(ours, SCRIPT)
    assert len({seed(ours, SCRIPT), seed(theirs, SCRIPT), seed(ours, other), seed(theirs, other)}) == 4
    assert "aaaa" not in repr(ours)


def test_without_the_installations_secret_seeds_are_random(library: Library) -> None:
    one, other = (Pipeline(library).read("1.3-exercises", "servo-threshold", SCRIPT).seed for _ in range(2))
    assert one != other


def test_a_recorded_seed_is_used_again(library: Library) -> None:
    assert Pipeline(library).read("1.3-exercises", "servo-threshold", SCRIPT, seed=7).seed == 7
    assert Pipeline(library).read("1.3-exercises", "servo-threshold", SCRIPT, seed=0).seed == 0


def test_ten_thousand_ground_comments_do_not_give_a_seed_away() -> None:
    """Of 10,000 ground comments none gets the seed that the digest alone would give, or the same as another one."""
    digests = [compute_digest("q", "e", f'"# {n}"') for n in range(10_000)]
    seeds = [compute_seed(b"k" * 32, digest) for digest in digests]
    assert len(set(seeds)) == len(seeds)
    assert not {int(digest[:8], 16) for digest in digests} & set(seeds)
    assert 2**52 < max(seeds) < 2**53
    assert float(max(seeds)) == max(seeds)


def test_the_same_short_answer_gets_the_verdict_that_was_made_before(
    library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    graded = []

    def grade(question: Question, answer: object) -> Verdict:
        graded.append(answer)
        return grade_answer(question, answer)

    monkeypatch.setattr(pipeline, "grade_answer", grade)
    monkeypatch.setattr(pipeline, "KEPT_VERDICTS", 2)
    grader = Pipeline(library)
    first = grader.grade("1.3-check", "q1", 1)
    assert grader.grade("1.3-check", "q1", 1) == first
    assert grader.grade("1.3-check", "q1", 0).status is not first.status
    assert grader.grade("1.3-check", "q1", True).status is Status.INVALID_ANSWER  # 1 and true are two answers
    assert graded == [1, 0, True]
    assert grader.grade("1.3-check", "q2", "5 ms").status is Status.CORRECT  # a third verdict: all others are forgotten
    assert grader.grade("1.3-check", "q1", 1).points == first.points
    assert graded == [1, 0, True, "5 ms", 1]
    for _ in range(2):
        grader.grade("1.3-check", "q2", "5 ms" + 200 * " ")
    assert graded[5:] == ["5 ms" + 200 * " "] * 2


def test_a_fault_of_ours_is_not_kept(library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    grader = Pipeline(library)
    with monkeypatch.context() as broken:
        broken.setattr(pipeline, "grade_answer", None)
        fault = grader.judge(grader.read("1.3-check", "q1", 1))
    assert fault.status is Status.GRADER_FAULT
    assert grader.grade("1.3-check", "q1", 1).status is not Status.GRADER_FAULT
