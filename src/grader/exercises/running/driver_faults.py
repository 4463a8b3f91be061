"""Tells an exception of a kind's driver from one of the script. What a script's process says of it is a claim: where no
line of the script is named, a script of ours runs in its place, which does nothing but raise. What is raised then in no
line of it is the driver's."""

from collections.abc import Iterator

import structlog

from grader.domain.run import RunReport, RunStatus
from grader.errors import JailFault, PluginError
from grader.exercises.judgement import Results
from grader.exercises.running.measuring import Run
from grader.exercises.running.planning import Plan
from grader.exercises.running.trials import select_results
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.cleaning import read_json

OF_SCRIPTS = (
    "defines no function", "script called exit()", "holds a number that is not finite", ", in line ", "(line "
)  # fmt: skip
"""What is said of exceptions of which it is clear that they are the script's: they need no second run."""

log = structlog.get_logger()


def refuse_driver_faults(question: ScriptQuestion, plan: Plan, report: RunReport, run: Run) -> None:
    """Raises PluginError where the driver of the exercise's kind raises, whatever the script does."""
    claimed = [*list_unplaced(plan, report)]
    if question.takes != "python" or not claimed:
        return
    try:
        ours = run(plan.build_job(write_stand_in(question, plan), question.limits))
    except JailFault:
        return
    for what in list_unplaced(plan, ours):
        raise PluginError(f"the driver of the exercise kind {question.check.kind!r} raises {what}")
    log.info("a driver raises for what a script does", kind=question.check.kind, times=len(claimed))


def write_stand_in(question: ScriptQuestion, plan: Plan) -> str:
    """Returns a script whose functions raise."""
    names = dict.fromkeys(name for trial in plan.trials for name in trial.entries or (question.entry,))
    return "".join(f"def {name}(*arguments, **named):\n    raise NotImplementedError\n\n" for name in names)


def list_unplaced(plan: Plan, report: RunReport) -> Iterator[str]:
    """Yields what was raised in no line of the script: at its import, and in each trial."""
    if report.status is RunStatus.CRASHED:
        reasons = [report.reason]
    else:
        parts = {False: report.results, True: report.hidden_results}
        reasons = [read_unplaced(select_results(parts[trial.hidden], at)) for at, trial in enumerate(plan.trials)]
    yield from (what for what in reasons if what and not any(known in what for known in OF_SCRIPTS))


def read_unplaced(results: Results) -> str:
    """Returns the exception of a trial with its place in the driver; empty if there is none, or with a line of the
    script."""
    try:
        crash = read_json(results["raised"].tobytes())
        return "" if crash["line"] is not None else f"{crash['raised']}{crash.get('place', '')}"
    except (ValueError, KeyError, TypeError, RecursionError):
        return ""
