"""Recognises the mistakes that an author names: runs the wrong scripts in the jail, over the student's trials."""

from collections.abc import Iterator, Sequence
from typing import Any

from grader.domain.run import Limits, RunStatus
from grader.errors import JailFault
from grader.exercises.judgement import Judgement
from grader.exercises.kind import TextOf
from grader.exercises.running.measuring import Run
from grader.exercises.running.planning import AnyKind, Plan, load_kinds, read_parameters
from grader.exercises.running.trials import judge_trials
from grader.questions.kinds.script import ScriptQuestion


def find_authored_sentence(
    kind: AnyKind, plan: Plan, judgements: Sequence[Judgement[Any]], limits: Limits, run: Run
) -> str | None:
    """Returns the sentence of the first wrong script of the author's that does what the student's does in every trial;
    None if there is none, or no jail."""
    for source, sentence in plan.wrong_scripts:
        try:
            report = run(plan.build_job(source, limits))
            if report.status is not RunStatus.RETURNED or report.stepped:
                continue
            others = [judgement for judgement, _ in judge_trials(kind, plan, report, run)]
        except JailFault:
            return None
        if does_the_same(kind, plan, judgements, others):
            return sentence
    return None


def write_wrong_scripts(question: ScriptQuestion, text_of: TextOf) -> Iterator[tuple[str, str, str]]:
    """Yields path, text and sentence of a script with each mistake that the author names. Raises GraderError."""
    kind = load_kinds()[question.check.kind]
    parameters = read_parameters(kind, question)
    for index, mistake in enumerate(parameters.mistakes):
        yield mistake.program, kind.write_wrong_script(parameters, index, text_of), mistake.sentence


def does_the_same(
    kind: AnyKind, plan: Plan, judgements: Sequence[Judgement[Any]], others: Sequence[Judgement[Any]]
) -> bool:
    """Whether two scripts pass the same trials, and fail the others alike."""
    if any(judgement.passed != other.passed for judgement, other in zip(judgements, others, strict=True)):
        return False
    failed = [
        (trial, judgement, other)
        for trial, judgement, other in zip(plan.trials, judgements, others, strict=True)
        if not judgement.passed
    ]
    return bool(failed) and all(
        judgement.outcome is not None
        and other.outcome is not None
        and kind.is_alike(plan.parameters, trial, judgement, other)
        for trial, judgement, other in failed
    )
