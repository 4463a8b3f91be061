"""The walk of one submission: read once, run in the jail, judged against our own simulation. `Pipeline.read` parses an
answer into a ParsedSubmission, which is then stored, queued and graded as it is. `Pipeline.judge` makes its Verdict."""

import hashlib
import hmac
import json
import platform
import secrets
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import structlog

from grader.domain.plugins import describe_error
from grader.domain.progress import ignore_progress
from grader.domain.run import Job, RunReport
from grader.domain.verdict import Status, Verdict
from grader.errors import InvalidAnswer, JailFault, ScriptStopped, TooLarge, Unprocessable
from grader.grading.posing import Poser
from grader.grading.spans import locate_diagnosis
from grader.library import Library
from grader.questions import Question, Quiz, grade_answer, kind_of, read_answer
from grader.questions.drawing import is_drawn
from grader.questions.kinds.script import ScriptQuestion

if TYPE_CHECKING:
    from grader.exercises import Tell

OUR_FAULT = "The grader itself failed; this is not your mistake, and it used up no attempt."

TOO_LARGE = "Your results take more memory to judge than there is: return arrays of the size that is asked for."

TEXT_BYTES_MAX = 64 * 1024
"""Longest answer to a question without a script, as JSON text [bytes]."""

LEVELS_MAX = 16
"""Deepest nesting of lists and objects in an answer; no kind of question needs more than one level."""

SEED_BITS = 53
"""Integers up to 2**53 are exact in every JSON reader. Source: RFC 8259, section 6."""

KEPT_CHARACTERS, KEPT_VERDICTS = 200, 2000
"""Verdicts on answers up to this length are kept, and all forgotten at this number: a few megabytes at most."""

JUDGED = {Status.CORRECT, Status.PARTIAL, Status.INCORRECT, Status.NEEDS_REVIEW}
"""The statuses of scripts whose results were judged; the others say how a script ended."""

ENVIRONMENT = {
    "mujoco": mujoco.__version__,
    "numpy": np.__version__,
    "python": platform.python_version(),
    "machine": f"{platform.system()} {platform.machine()}",
}

encode = json.JSONEncoder(sort_keys=True, separators=(",", ":")).encode
"""Made once: `json.dumps` makes an encoder for every call."""

log = structlog.get_logger()


@dataclass(frozen=True)
class ParsedSubmission:
    """One answer to one question of a quiz, read against the content of `content_digest`. `text` is the answer as
    canonical JSON in ASCII, `digest` the sha256 of it with the ids of quiz and question. An exercise has the `source`
    of its script or model, or the base64 of its file, and the `seed` that draws the hidden cases; or else `refusal`,
    why none can be read. A question whose numbers are drawn is that of the learner, with their key, and has the `seed`
    of them; `lost` is what was raised where that key cannot be derived."""

    quiz: Quiz
    question: Question
    content_digest: str
    answer: Any
    text: str
    digest: str
    source: str | None = None
    seed: int | None = None
    refusal: str | None = None
    lost: Exception | None = None

    @property
    def is_instant(self) -> bool:
        """Whether there is nothing to run, so that the verdict is made inside the request."""
        return self.source is None


@dataclass(frozen=True)
class ScriptOutput:
    """The output of a script, and the time of each part of its grading [ms]."""

    stdout: str = ""
    stderr: str = ""
    timing_ms: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Retries:
    """The schedule of retries after a fault of the grader: the number of tries, and the pauses between them. The worker
    follows it by putting a job back into the queue. A command has no queue, and waits in `Pipeline.judge_with_retries`.
    Nothing else tries again."""

    tries: int = 3
    pause_s: float = 2.0

    def pause_after(self, tried: int) -> float | None:
        """Returns the pause after `tried` failures [s], twice as long each time; None when no try is left."""
        return self.pause_s * 2 ** (tried - 1) if tried < self.tries else None


COMMAND_RETRIES = Retries(tries=2, pause_s=0.5)
"""The retries of commands: enough for a jail that broke once, and short if the fault remains."""


@dataclass(frozen=True)
class Pipeline:
    """Grades against one snapshot of the content. `run` is the jail's; it may raise JailFault. `secret` keys the seeds
    of hidden cases, so that a submission does not give them away. A server passes the installation's secret; a command
    gets a random one, and so random seeds. With `names_faults` a verdict says what failed in the grader: for who writes
    a kind, never for learners."""

    library: Library
    run: Callable[[Job], RunReport] | None = None
    secret: bytes = field(default_factory=lambda: secrets.token_bytes(32), repr=False)
    names_faults: bool = False
    _kept: dict[tuple[str, int | None], Verdict] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Verdicts on instant answers, by their digest and the seed of drawn numbers: a whole class gives the same few."""
    _logged: set[str] = field(default_factory=set, init=False, repr=False, compare=False)
    """Faults that were logged: who writes a kind sees the traceback of each once, not with every script."""

    @cached_property
    def poser(self) -> Poser:
        """What poses questions with drawn numbers."""
        return Poser(self.library, self.secret)

    @cached_property
    def drawn(self) -> frozenset[tuple[str, str]]:
        """The questions with drawn numbers: reading an answer may take the simulations of a learner's own key."""
        every = ((quiz.id, question) for quiz in self.library.quizzes.values() for question in quiz.questions)
        return frozenset((quiz, question.id) for quiz, question in every if is_drawn(question))

    def read(
        self, quiz_id: str, question_id: str, answer: Any, seed: int | None = None, *, learner: str = ""
    ) -> ParsedSubmission:
        """Reads an answer; any JSON value. `seed` repeats the hidden cases, or the drawn numbers, of an earlier
        verdict; without it, a question with drawn numbers is that of the `learner`, or of nobody the one in the middle.
        Raises NotFound; TooLarge and Unprocessable for an answer that cannot be kept or a source that cannot be run."""
        quiz, question = self.library.find(quiz_id, question_id)
        text = to_canonical_json(answer)
        digest = compute_digest(quiz_id, question_id, text)
        parsed = ParsedSubmission(quiz, question, self.library.digests[quiz_id], answer, text, digest)
        if not isinstance(question, ScriptQuestion):
            if len(text) > TEXT_BYTES_MAX:
                raise TooLarge(f"The answer is too long; at most {TEXT_BYTES_MAX // 1024} KB are taken.")
            if (quiz_id, question_id) in self.drawn and (learner or seed is not None):
                seed = self.poser.seed_of(learner, quiz_id, question_id) if seed is None else seed
                try:
                    return replace(parsed, question=self.poser.pose(quiz_id, question_id, seed), seed=seed)
                except Exception as error:  # ours, which judging tells
                    return replace(parsed, seed=seed, lost=error)
            return parsed
        try:
            source = kind_of(question).read(question, answer)
        except InvalidAnswer as error:
            return replace(parsed, refusal=str(error))
        return replace(parsed, source=source, seed=compute_seed(self.secret, digest) if seed is None else seed)

    def read_and_grade(
        self, quiz_id: str, question_id: str, answer: Any, learner: str = ""
    ) -> tuple[ParsedSubmission, Verdict | None]:
        """Reads an answer, and judges it where that is instant. Raises as `read` does."""
        submission = self.read(quiz_id, question_id, answer, learner=learner)
        return submission, self.judge(submission) if submission.is_instant else None

    def describe(self, submission: ParsedSubmission) -> str:
        """Returns the answer as it is understood, for the learner to confirm. Raises InvalidAnswer with the reason."""
        if submission.refusal is not None:
            raise InvalidAnswer(submission.refusal)
        return read_answer(submission.question, submission.answer)

    def grade(self, quiz_id: str, question_id: str, answer: Any, seed: int | None = None) -> Verdict:
        """Reads and judges an answer, for commands. Raises as `read` does."""
        return self.judge_with_retries(self.read(quiz_id, question_id, answer, seed))

    def judge_with_retries(self, submission: ParsedSubmission) -> Verdict:
        """Judges, and tries again after a fault of the grader. Sleeps between the tries: for commands only."""
        tried = 1
        while True:
            verdict = self.judge(submission)
            pause_s = COMMAND_RETRIES.pause_after(tried) if verdict.status is Status.GRADER_FAULT else None
            if pause_s is None:
                return verdict
            time.sleep(pause_s)
            tried += 1

    def judge(self, submission: ParsedSubmission, tell: "Tell" = ignore_progress) -> Verdict:
        """Makes the verdict, in one try. A fault of the grader gives `grader_fault`, never a wrong answer. Raises
        ScriptStopped where the jail does. While a script runs, `tell` is called with the number of the case it is at,
        and the number of cases. An instant answer that was given before gets the verdict that was made then."""
        at = submission.digest, None if submission.source is not None else submission.seed
        if (earlier := self._kept.get(at)) is not None:
            return earlier
        verdict = self._judge(submission, tell)
        if submission.is_instant and len(submission.text) <= KEPT_CHARACTERS and verdict.status in JUDGED:
            if len(self._kept) >= KEPT_VERDICTS:
                self._kept.clear()
            self._kept[at] = verdict
        return verdict

    def _judge(self, submission: ParsedSubmission, tell: "Tell") -> Verdict:
        started = time.perf_counter()
        question = submission.question
        measured = ScriptOutput()
        try:
            if submission.lost is not None:
                raise submission.lost
            if submission.refusal is not None:
                verdict = build_ungraded(question, Status.INVALID_ANSWER, submission.refusal)
            elif isinstance(question, ScriptQuestion):
                assert submission.source is not None and submission.seed is not None
                verdict, measured = self._judge_script(question, submission.source, submission.seed, tell)
                verdict = locate_diagnosis(verdict, "" if question.form.is_file else submission.source)
            else:
                verdict = grade_answer(question, submission.answer)
                if submission.seed is not None:
                    drawn = self.poser.draws_of(submission.quiz.id, question.id, submission.seed)
                    verdict = verdict.model_copy(update={"evidence": {**verdict.evidence, "drawn": dict(drawn)}})
        except ScriptStopped:
            raise
        except Exception as error:
            why = describe_error(error, name_module(question)) if self.names_faults else OUR_FAULT
            if not self.names_faults or why not in self._logged:
                log.exception("grading failed", quiz=submission.quiz.id, question=question.id)
                self._logged.add(why)
            verdict = build_ungraded(question, Status.GRADER_FAULT, why)
        timing_ms = {**measured.timing_ms, "total": 1000 * (time.perf_counter() - started)}
        measured = replace(measured, timing_ms=timing_ms)
        return complete(verdict, submission.content_digest, submission.digest, measured)

    def fault(self, quiz_id: str, question_id: str, text: str) -> Verdict:
        """Makes the verdict on a stored answer that could not be graded; it uses no attempt. Raises NotFound."""
        verdict = build_ungraded(self.library.question(quiz_id, question_id), Status.GRADER_FAULT, OUR_FAULT)
        digest = compute_digest(quiz_id, question_id, text)
        return complete(verdict, self.library.digest(quiz_id), digest, ScriptOutput())

    def _judge_script(
        self, question: ScriptQuestion, source: str, seed: int, tell: "Tell"
    ) -> tuple[Verdict, ScriptOutput]:
        # Other answers are graded without them.
        from grader.exercises import Progress, judge_exercise, plan_exercise, prepare_exercise, save_hidden_models

        if self.run is None:
            raise JailFault("no jail is set up: scripts cannot be run")
        plan = plan_exercise(question, self.library.model_xml, seed, self.library.text)
        job = plan.build_job(source, question.limits)

        def save_models() -> Mapping[str, Any]:
            try:
                return models().result()
            except Exception:  # which preparing meets as well; the jail compiles them itself
                return {}

        def prepare() -> float:
            prepare_exercise(question, plan)
            return time.thread_time()  # all of it: the thread is new

        with ThreadPoolExecutor(1) as beside:
            # not before the script runs, which they would hold up
            models = cache(lambda: beside.submit(save_hidden_models, question, plan))
            begin = cache(lambda: (models(), beside.submit(prepare))[1])
            follow = Progress(plan.trials, tell).follow
            report = self.run(replace(job, sent=begin, heard=follow, late_inputs=save_models))
            prepared = begin()
        fault, started = prepared.exception(), time.thread_time()
        try:
            verdict = judge_exercise(question, plan, report, self.run, "" if question.form.is_file else source)
        except ScriptStopped as stopped:  # while what it made is measured: it has had its hidden inputs by then
            raise ScriptStopped(bool(plan.hidden_inputs)) from stopped
        except MemoryError:
            if fault is not None:
                raise
            verdict = build_ungraded(question, Status.OUT_OF_MEMORY, TOO_LARGE)
        judge_s = time.thread_time() - started
        if fault is None:
            judge_s += prepared.result()
        elif verdict.status in JUDGED:
            raise fault
        else:  # the script ended by itself, whatever there was to compare it with
            log.error("preparing failed", question=question.id, exc_info=fault)
        judge_ms = 1000 * judge_s
        timing_ms = {"script_cpu": 1000 * report.cpu_s, "script_wall": 1000 * report.wall_s, "judge_cpu": judge_ms}
        return verdict, ScriptOutput(report.stdout, report.stderr, timing_ms)


def name_module(question: Question) -> str:
    """Returns the module of the kind that judges a question."""
    if not isinstance(question, ScriptQuestion):
        return type(kind_of(question)).__module__
    from grader.exercises import load_kinds

    return type(load_kinds()[question.check.kind]).__module__


def to_canonical_json(answer: Any) -> str:
    """Returns the answer as canonical JSON text in ASCII. Raises Unprocessable for text that is not UTF-8, and for
    lists and objects nested more than LEVELS_MAX deep."""
    _check_text(answer, LEVELS_MAX)
    return encode(answer)


def _check_text(value: Any, levels: int) -> None:
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError as error:
            raise Unprocessable("The answer is not valid UTF-8 text.") from error
    elif isinstance(value, dict | list):
        if not levels:
            raise Unprocessable("The answer is nested too deep.")
        for item in (*value, *value.values()) if isinstance(value, dict) else value:
            _check_text(item, levels - 1)


def build_ungraded(question: Question, status: Status, why: str) -> Verdict:
    """Returns a verdict without points that uses no attempt."""
    return Verdict(status=status, points=0.0, max_points=question.points, diagnosis=why)


def complete(verdict: Verdict, content_digest: str, digest: str, measured: ScriptOutput) -> Verdict:
    """Completes a verdict with the script's output, times, environment and digests."""
    return verdict.model_copy(
        update={
            "stdout": measured.stdout,
            "stderr": measured.stderr,
            "timing_ms": {name: round(value, 3) for name, value in measured.timing_ms.items()},
            "environment": ENVIRONMENT,
            "content_digest": content_digest,
            "submission_digest": digest,
        }
    )


def compute_digest(quiz_id: str, question_id: str, text: str) -> str:
    """sha256 of the canonical JSON `[quiz, question, answer]`; `text` is the answer's canonical JSON."""
    return hashlib.sha256(f"{encode_ids(quiz_id, question_id)},{text}]".encode()).hexdigest()


@lru_cache(maxsize=1024)
def encode_ids(quiz_id: str, question_id: str) -> str:
    """Returns how the canonical JSON `[quiz, question, answer]` begins."""
    return encode([quiz_id, question_id]).removesuffix("]")


def compute_seed(secret: bytes, digest: str) -> int:
    """Returns the seed of a submission: the first 53 bits of HMAC-SHA256(secret, digest). The same submission gets the
    same hidden cases again. Without the secret a comment cannot be varied until the cases suit the script."""
    return int.from_bytes(hmac.digest(secret, digest.encode(), "sha256")[:8], "big") >> (64 - SEED_BITS)
