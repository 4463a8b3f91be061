"""Judges exercises of every kind: what the jail reports, trial by trial, becomes a verdict."""

import builtins
import re
import types
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import mujoco
import numpy as np

from grader.domain.run import Job, RunReport, RunStatus
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import JailFault
from grader.exercises.crashes import explain_error
from grader.exercises.driving.playing import describe_stop
from grader.exercises.explaining.script import ParsedScript
from grader.exercises.findings import AnyJudged, build_findings, build_ids, build_titles, choose_message
from grader.exercises.judgement import list_counting
from grader.exercises.kind import JudgedTrial
from grader.exercises.running.authored import find_authored_sentence
from grader.exercises.running.diagnosing import describe_success, diagnose, find_plain, note_fault, tell_view
from grader.exercises.running.driver_faults import refuse_driver_faults
from grader.exercises.running.evidence import build_evidence
from grader.exercises.running.measuring import Run, limit_cpu
from grader.exercises.running.planning import Plan, load_kinds
from grader.exercises.running.trials import judge_trials
from grader.exercises.trace import LINES_MAX, NO_TRACE, read_traces
from grader.questions.kinds.script import ScriptQuestion

TRACES = {False: "traces", True: "hidden_traces"}
"""The names of the results that hold the traces of the visible and of the hidden trials."""

STEPPED = (
    "The function let MuJoCo take the step (mj_step or another integrator), which this exercise does not allow: take "
    "accelerations from mujoco.mj_forward, and write the step yourself."
)


ALL_TYPES = [kind.__name__ for kind in vars(types).values() if isinstance(kind, type)]
"""Names of Python's types that are no built-in names, such as `function`."""


def refuse_job(job: Job) -> RunReport:
    """Raises JailFault: there is no jail to run it in."""
    raise JailFault("no jail is set up: nothing can be measured")


def judge_exercise(
    question: ScriptQuestion, plan: Plan, report: RunReport, run: Run = refuse_job, source: str = ""
) -> Verdict:
    """Returns the verdict on a script; one that did not return gets the status of that name, with the reason. `run` is
    the jail's, for kinds that measure there; it raises JailFault. The text of the script, `source`, only explains.
    Raises PluginError where the kind's driver fails, and what the kind raises."""
    if report.stepped:
        return build_failure(question, Status.FORBIDDEN, STEPPED)
    refuse_driver_faults(question, plan, report, run)
    if report.status is not RunStatus.RETURNED:
        where = describe_stop(report.talked, build_titles(plan.parameters, plan.trials))
        return build_failure(question, Status(report.status.value), f"{explain_error(report.reason)}{where}")
    with np.errstate(all="ignore"):  # a student's numbers may be as large as a double can hold
        measurement = load_kinds()[question.check.kind].measurement
        limited = limit_cpu(run) if measurement is None else limit_cpu(run, measurement.cpu_s_all)
        return judge_results(question, plan, report, limited, ParsedScript(source))


def judge_results(question: ScriptQuestion, plan: Plan, report: RunReport, run: Run, script: ParsedScript) -> Verdict:
    """Returns the verdict on a script that returned."""
    kind = load_kinds()[question.check.kind]
    parts = {False: report.results, True: report.hidden_results}
    known = {False: None, True: list_known_words(kind.driver)}
    held = {hidden: read_traces(parts[hidden].get(name), known[hidden]) for hidden, name in TRACES.items()}
    traces = [held[trial.hidden].get(index, NO_TRACE) for index, trial in enumerate(plan.trials)]
    outcomes = judge_trials(kind, plan, report, run, len(script.source.splitlines()) or LINES_MAX)
    judged = settle(
        [
            JudgedTrial(trial, judgement, False, trace, script)
            for trial, (judgement, _), trace in zip(plan.trials, outcomes, traces, strict=True)
        ]
    )
    titles = build_titles(plan.parameters, plan.trials)
    findings = build_findings(question, build_ids(plan.parameters, plan.trials), titles, judged)
    ends = [end for _, end in outcomes]
    if ends[0] is not None and all(ends):
        visible = {choose_message(trial) for trial in judged if not trial.hidden}
        first = choose_message(judged[0])
        why = tell_view(first if len(visible) == 1 else f"{titles[0]}: {first}", script)
        return build_failure(question, ends[0], why, findings)
    whole = [trial for trial, end in zip(judged, ends, strict=True) if not end]
    sentences = [f"{title}: {choose_message(trial)}" for title, trial in zip(titles, judged, strict=True)]
    authored = partial(
        find_authored_sentence, kind, plan, [judgement for judgement, _ in outcomes], question.limits, run
    )
    told = list(zip(judged, sentences, strict=True))
    try:
        mistake, direction = diagnose(kind, plan.parameters, told, whole, run, find_authored=authored)
    except JailFault:
        raise
    except Exception as error:  # the sentence is lost, not the verdict
        note_fault(error, question.check.kind)
        mistake, direction = find_plain(told)
    verdict = verdict_of(
        findings,
        diagnosis=mistake.sentence if mistake else None,
        line=mistake.line if mistake else None,
        direction=direction,
        evidence=build_evidence(kind, plan.parameters, [trial for trial in whole if not trial.hidden]),
    )
    review = next((trial.judgement.review for trial in judged if trial.judgement.review), "")
    if review and verdict.status is not Status.INCORRECT:
        return verdict.model_copy(update={"status": Status.NEEDS_REVIEW, "diagnosis": review, "direction": review})
    if verdict.status is not Status.CORRECT:
        return verdict
    # The explanation names the right results, so it is shown with full marks only.
    return verdict.model_copy(
        update={"explain": question.explain, "remark": describe_success(kind, plan.parameters, judged)}
    )


@cache
def list_known_words(driver: str) -> frozenset[str]:
    """Returns the words that a driver's notes may hold without telling anything that only the script knows."""
    public = (*map(dir, (builtins, np, mujoco, mujoco.MjModel, mujoco.MjData, mujoco.MjOption)), ALL_TYPES)
    return frozenset().union(re.findall(r"\w+", driver), *public)


def build_failure(question: ScriptQuestion, status: Status, why: str, findings: tuple[Finding, ...] = ()) -> Verdict:
    """Returns a verdict without points."""
    return Verdict(status=status, points=0.0, max_points=question.points, findings=findings, diagnosis=why or None)


def settle(judged: Sequence[AnyJudged]) -> list[AnyJudged]:
    """Decides which trials count."""
    counting = list_counting({trial.id: trial.judgement for trial in judged})
    return [replace(trial, counts=trial.id in counting) for trial in judged]
