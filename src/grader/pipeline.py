"""One submission from answer to verdict: run it in the jail, simulate the same cases ourselves, grade."""

import hashlib
import json
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import structlog

from grader.domain.quiz import CodeQuestion, Question
from grader.domain.run import SOURCE_BYTES_MAX, Job, RunReport
from grader.domain.verdict import Status, Verdict
from grader.errors import InvalidAnswer, JailFault, TooLarge, Unprocessable
from grader.grading.answers import grade_answer, read_answer
from grader.grading.exercise import judge_exercise, plan_exercise
from grader.library import Library

JAIL_TRIES = 3
"""How often a job is run before a broken jail becomes a `grader_fault`."""

OUR_FAULT = "The grader itself failed; this is not your mistake, and it used up no attempt."

ENVIRONMENT = {
    "mujoco": mujoco.__version__,
    "numpy": np.__version__,
    "python": platform.python_version(),
    "machine": f"{platform.system()} {platform.machine()}",
}

log = structlog.get_logger()


@dataclass(frozen=True)
class Pipeline:
    """Grades against one snapshot of the content. `run` is the jail's: it may raise JailFault."""

    library: Library
    run: Callable[[Job], RunReport] | None = None

    def is_instant(self, question: Question) -> bool:
        """Everything but a script is graded inside the request."""
        return not isinstance(question, CodeQuestion)

    def read_answer(self, quiz_id: str, question_id: str, answer: Any) -> str:
        """What was understood of an answer, without grading it.

        Raises NotFound; InvalidAnswer, with a sentence for the student; TooLarge or Unprocessable for a source
        that cannot be taken.
        """
        question = self.library.question(quiz_id, question_id)
        if isinstance(question, CodeQuestion):
            source = read_source(answer)
            return f"a script of {len(source.splitlines())} lines"
        return read_answer(question, answer)

    def grade(self, quiz_id: str, question_id: str, answer: Any, seed: int | None = None) -> Verdict:
        """The verdict on one answer; what breaks on our side is a `grader_fault`, never a wrong answer.

        `seed` draws the hidden cases of an exercise; the default follows from the submission, so that a second run
        judges it by the same cases, and nobody's recorded results serve anybody else.
        Raises NotFound, TooLarge and Unprocessable.
        """
        question = self.library.question(quiz_id, question_id)
        digest = submission_digest(quiz_id, question_id, answer)
        started = time.perf_counter()
        if isinstance(question, CodeQuestion):
            verdict = self._grade_script(question, answer, seed_of(digest) if seed is None else seed)
        else:
            verdict = grade_answer(question, answer)
        total_ms = 1000 * (time.perf_counter() - started)
        timing = {"timing_ms": {**verdict.timing_ms, "total": round(total_ms, 3)}}
        return verdict.model_copy(update=timing | self._origin(quiz_id, digest))

    def fault(self, quiz_id: str, question_id: str, answer: Any) -> Verdict:
        """The verdict where we failed: it costs the learner nothing. Raises NotFound."""
        verdict = ungraded(self.library.question(quiz_id, question_id), Status.GRADER_FAULT, OUR_FAULT)
        return verdict.model_copy(update=self._origin(quiz_id, submission_digest(quiz_id, question_id, answer)))

    def _origin(self, quiz_id: str, digest: str) -> dict[str, Any]:
        """What a verdict was made with, and of what."""
        content = self.library.digest(quiz_id)
        return {"environment": ENVIRONMENT, "content_digest": content, "submission_digest": digest}

    def _grade_script(self, question: CodeQuestion, answer: Any, seed: int) -> Verdict:
        try:
            source = read_source(answer)
        except InvalidAnswer as error:
            return ungraded(question, Status.INVALID_ANSWER, str(error))
        try:
            plan = plan_exercise(question, self.library.model_xml, seed)
            report = self._run(Job(source, plan.driver, plan.inputs, question.limits))
            started = time.thread_time()
            verdict = judge_exercise(question, plan, report)
        except Exception:
            log.exception("grading failed", question=question.id)
            return ungraded(question, Status.GRADER_FAULT, OUR_FAULT)
        judged_ms = 1000 * (time.thread_time() - started)
        timing = {"script_cpu": 1000 * report.cpu_s, "script_wall": 1000 * report.wall_s, "judge_cpu": judged_ms}
        return verdict.model_copy(
            update={
                "stdout": report.stdout,
                "stderr": report.stderr,
                "timing_ms": {name: round(value, 3) for name, value in timing.items()},
            }
        )

    def _run(self, job: Job) -> RunReport:
        if self.run is None:
            raise JailFault("no jail is set up: scripts cannot be run")
        for tries_left in reversed(range(JAIL_TRIES)):
            try:
                return self.run(job)
            except JailFault:
                if not tries_left:
                    raise
                log.warning("the jail broke; trying again", tries_left=tries_left, exc_info=True)
        raise AssertionError("unreachable")


def read_source(answer: Any) -> str:
    """The script of a `{"source": ...}` answer. Raises InvalidAnswer, TooLarge, Unprocessable."""
    if not isinstance(answer, dict) or not isinstance(answer.get("source"), str) or set(answer) - {"source"}:
        raise Unprocessable('The answer to an exercise is {"source": "the text of your script"}.')
    source: str = answer["source"].removeprefix("\ufeff")  # editors put it there, and Python skips it in a file
    try:
        size = len(source.encode())
    except UnicodeEncodeError as error:
        raise Unprocessable("The script is not valid UTF-8 text.") from error
    if size > SOURCE_BYTES_MAX:
        raise TooLarge(f"The script is {size // 1024} KB long; at most {SOURCE_BYTES_MAX // 1024} KB are taken.")
    if not source.strip():
        raise InvalidAnswer("The script is empty.")
    return source


def ungraded(question: Question, status: Status, why: str) -> Verdict:
    """A verdict that costs the learner nothing."""
    return Verdict(status=status, points=0.0, max_points=question.points, diagnosis=why)


def seed_of(digest: str) -> int:
    """The seed that a submission is judged by; its digest is in the verdict, and so the seed is on record."""
    return int(digest[:8], 16)


def submission_digest(quiz_id: str, question_id: str, answer: Any) -> str:
    """sha256 over the canonical JSON of what was handed in."""
    canonical = json.dumps([quiz_id, question_id, answer], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode(errors="surrogatepass")).hexdigest()
