"""Checks, plans and judges exercises of every kind."""

import builtins
import json
import re
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.metadata import entry_points
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from grader.domain.misread import misread, without_remarks
from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import Fault, GraderError, JailFault, NotFound
from grader.exercises.crashes import explain_error
from grader.exercises.diagnosing import describe_success, diagnose
from grader.exercises.driving.embedding import CATCHING, DRIVER, SAVING, WATCH, compile_driver, save_models
from grader.exercises.driving.playing import Played, Talk, describe_stop, play_trials
from grader.exercises.explaining.script import Script
from grader.exercises.findings import AnyJudged, build_findings, build_titles, choose_message
from grader.exercises.judgement import list_counting
from grader.exercises.kind import Content, DrawnCase, JudgedTrial, Judgement, Kind, Results, TextOf, Trial
from grader.exercises.measuring import Run, Unmeasured, limit_cpu, measure
from grader.exercises.parameters import (
    Case,
    ExerciseParameters,
    WrongParameter,
    draw_number,
    list_ends,
    list_keys,
    write_numbers,
)
from grader.exercises.trace import NO_TRACE, is_line, read_traces
from grader.questions import ModelXml, Question
from grader.questions.kinds.script import ScriptQuestion
from grader.questions.registry import load_point

TRACES = {False: "traces", True: "hidden_traces"}
"""The names of the results that hold the traces of the visible and of the hidden trials."""

GROUP = "grader.exercise_kinds"
"""The entry-point group in which kinds of exercise are found."""

STEPPED = (
    "The function let MuJoCo take the step (mj_step or another integrator), which this exercise does not allow: take "
    "accelerations from mujoco.mj_forward, and write the step yourself."
)


ENDED = "The script ended before this case."

RAISED_CHARS_MAX = 1000


ALL_TYPES = [one.__name__ for one in vars(types).values() if isinstance(one, type)]
"""Names of Python's types that are no built-in names, such as `function`."""


def refuse_text(path: str) -> str:
    """Raises NotFound: there is no content folder to read from."""
    raise NotFound(f"{path} cannot be read: there is no content folder here")


def refuse_job(job: Job) -> RunReport:
    """Raises JailFault: there is no jail to run it in."""
    raise JailFault("no jail is set up: nothing can be measured")


AnyKind = Kind[Any, Any, Any]
AnyTrial = Trial[Any]


@cache
def load_kinds() -> Mapping[str, AnyKind]:
    """Returns every installed kind by its name. Raises GraderError if two claim one name, or one cannot be loaded."""
    kinds: dict[str, AnyKind] = {}
    for point in entry_points(group=GROUP):
        if point.name in kinds:
            raise GraderError(f"two installed packages provide the exercise kind {point.name!r}: uninstall one of them")
        kinds[point.name] = load_point(point, "exercise kind")
    return kinds


def list_codes() -> list[bytes]:
    """Returns the code that the jobs of installed kinds have in common: the jail may load it ahead."""
    parts = [code for kind in load_kinds().values() for code in compile_driver(kind.driver).values()]
    return list(dict.fromkeys([*parts, CATCHING]))


@dataclass(frozen=True)
class Plan:
    """The input of the jail for one exercise, and the trials for the judge. The driver, whose parts are `codes`, runs
    over the plain-JSON `inputs`, then over the `hidden_inputs`; `without_integrators` as in Job."""

    codes: Mapping[str, bytes]
    inputs: Mapping[str, Any]
    hidden_inputs: Mapping[str, Any]
    without_integrators: bool
    parameters: ExerciseParameters
    trials: tuple[AnyTrial, ...]
    talk: Talk | None = None

    def build_job(self, source: str, limits: Limits) -> Job:
        """Returns the job of the jail for a script."""
        watches, saves = "except" in source, SAVING in source
        return Job(
            source,
            f"{DRIVER}{WATCH}" if watches else DRIVER,
            {**self.inputs, "models": None} if saves else self.inputs,
            limits,
            without_integrators=self.without_integrators,
            hidden_inputs=self.hidden_inputs,
            codes={**self.codes, "catching": CATCHING} if watches else self.codes,
            talk=self.talk,
        )


def check_exercise(question: Question, model_xml: ModelXml, where: str, text_of: TextOf = refuse_text) -> list[Fault]:
    """Returns every fault of an exercise's `check`, each once, none of other questions; `where` is the quiz file."""
    if not isinstance(question, ScriptQuestion):
        return []
    kind = load_kinds().get(question.check.kind)
    if kind is None:
        known = ", ".join(sorted(load_kinds()))
        why = f"no kind of exercise is called {question.check.kind!r}; use {known}, or install the package that has it"
        return [Fault(where, f"{question.id}.check.kind", why)]
    try:
        parameters = read_parameters(kind, question)
    except ValidationError as error:
        found = explain_misread_parameters(kind, question, error)
    else:
        found = find_wrong_parameters(kind, parameters, Content(question.entry, model_xml, text_of))
    return [Fault(where, ".".join(filter(None, (question.id, "check", key))), why) for key, why in dict.fromkeys(found)]


def explain_misread_parameters(
    kind: AnyKind, question: ScriptQuestion, error: ValidationError
) -> Iterator[tuple[str, str]]:
    """Yields key and reason of every parameter that pydantic refused."""
    known = list_keys(kind.parameters)
    for place, why in misread(error, question.check.parameters, lambda _: known):
        yield ".".join(map(str, place)), why


def read_parameters(kind: AnyKind, question: ScriptQuestion) -> ExerciseParameters:
    """Returns the check's parameters. Raises pydantic.ValidationError."""
    text = json.dumps(without_remarks(question.check.parameters))
    parameters: ExerciseParameters = kind.parameters.model_validate_json(text, strict=True)
    return parameters


def find_wrong_parameters(kind: AnyKind, parameters: ExerciseParameters, content: Content) -> Iterator[tuple[str, str]]:
    """Rehearses the trials of every case; yields key and reason of every parameter that cannot work."""
    ids = [case.id for case in parameters.cases]
    trials: list[AnyTrial] = []
    for index, case in enumerate(parameters.cases):
        key = f"cases.{index}"
        if case.id in ids[:index]:
            yield f"{key}.id", f"{case.id} is used twice; give each case its own id"
        if unknown := list(find_unknown_numbers(parameters, case, key)):
            yield from unknown
            continue
        try:
            trials.extend(rehearse_case(kind, parameters, case, content, index))
        except (ValueError, KeyError, GraderError) as error:
            yield getattr(error, "key", key), str(error.args[0])
    if {trial.case.id for trial in trials if trial.case} == {*ids}:
        try:
            for trial in kind.build_further_trials(parameters, trials):
                kind.rehearse(parameters, trial)
        except (ValueError, KeyError) as error:
            yield getattr(error, "key", ""), str(error.args[0])


def rehearse_case(
    kind: AnyKind, parameters: ExerciseParameters, case: Case, content: Content, index: int
) -> Sequence[AnyTrial]:
    """Builds and rehearses the trials of a case at both ends of its ranges and for a draw; returns those of the last.
    Raises ValueError, KeyError or GraderError where a trial cannot be built or judged."""
    ends = [end for end in list_ends(case) if end != case]
    trials: Sequence[AnyTrial] = ()
    for one in (*ends, case):
        trials = build_case_trials(kind, parameters, one, content, [0, index])
        for trial in trials:
            kind.rehearse(parameters, trial)
    return trials


def find_unknown_numbers(parameters: ExerciseParameters, case: Case, key: str) -> Iterator[tuple[str, str]]:
    """Yields key and reason of every number that a case sets and `numbers` does not define."""
    known = ", ".join(parameters.numbers) or "none"
    for name in case.set.keys() - parameters.numbers.keys():
        yield f"{key}.set.{name}", f"no number has this name; `numbers` has {known}"


def plan_exercise(question: ScriptQuestion, model_xml: ModelXml, seed: int, text_of: TextOf = refuse_text) -> Plan:
    """Returns the inputs of the jail and the trials for the judge; `seed` draws the numbers of the cases."""
    kind = load_kinds()[question.check.kind]
    parameters = read_parameters(kind, question)
    content = Content(question.entry, model_xml, text_of)
    trials: list[AnyTrial] = []
    for index, case in enumerate(parameters.cases):
        trials.extend(build_case_trials(kind, parameters, case, content, [seed, index]))
    trials.extend(kind.build_further_trials(parameters, trials))
    inputs: dict[bool, list[dict[str, Any]]] = {False: [], True: []}
    for index, trial in enumerate(trials):
        entries = trial.entries or (question.entry,)
        one = {"index": index, "entries": entries, "hidden": trial.hidden, "inputs": trial.inputs}
        inputs[trial.hidden].append(one)
    models = save_models(kind, parameters, [trial for trial in trials if not trial.hidden])
    return Plan(
        codes=compile_driver(kind.driver),
        inputs={
            "trials": inputs[False],
            "more": bool(inputs[True]),
            "models": models,
            **({"plays": True} if kind.plays else {}),
        },
        hidden_inputs={"trials": inputs[True]} if inputs[True] else {},
        without_integrators=kind.without_integrators,
        parameters=parameters,
        trials=tuple(trials),
        talk=partial(play_trials, kind, parameters, trials) if kind.plays else None,
    )


def build_case_trials(
    kind: AnyKind, parameters: ExerciseParameters, case: Case, content: Content, seed: list[int]
) -> Sequence[AnyTrial]:
    """Returns the trials of one case, hidden with it, which share its points. Raises WrongParameter, ValueError,
    KeyError and GraderError."""
    rng = np.random.default_rng(seed)
    numbers = {name: draw_number(value, rng) for name, value in case.set.items()}
    written = read_model(parameters, case, content.model_xml)
    if not written and kind.needs_model:
        raise ValueError("give either `model` (a name in models/) or `xml` (MJCF text)")
    xml = write_numbers(written, parameters.numbers, numbers) if written else ""
    made = kind.build_trials(parameters, DrawnCase(case, numbers, xml, written, rng, content))
    shares = sum(trial.points for trial in made)
    return [replace(trial, case=case, hidden=case.hidden, points=case.points * trial.points / shares) for trial in made]


def read_model(parameters: ExerciseParameters, case: Case, model_xml: ModelXml) -> str:
    """Returns the MJCF text of a case's own model, or of the exercise's; empty if there is neither."""
    if case.model is not None and case.xml is not None:
        raise ValueError("give either `model` (a name in models/) or `xml` (MJCF text), not both")
    if case.xml is not None:
        return case.xml if isinstance(case.xml, str) else "\n".join(case.xml)
    if case.model is not None:
        return model_xml(case.model)
    if parameters.model is None:
        return ""
    try:
        return model_xml(parameters.model)
    except GraderError as error:
        raise WrongParameter("model", str(error)) from error


def save_hidden_models(question: ScriptQuestion, plan: Plan) -> dict[str, dict[str, str]]:
    """Returns what the job's hidden inputs may have beside the trials: their compiled models."""
    hidden = [trial for trial in plan.trials if trial.hidden]
    return {"models": save_models(load_kinds()[question.check.kind], plan.parameters, hidden)}


def prepare_exercise(question: ScriptQuestion, plan: Plan) -> None:
    """Computes and caches what judging needs, whatever the script does: to be called while it runs."""
    kind = load_kinds()[question.check.kind]
    for trial in plan.trials:
        kind.prepare(plan.parameters, trial)


def judge_exercise(
    question: ScriptQuestion, plan: Plan, report: RunReport, run: Run = refuse_job, source: str = ""
) -> Verdict:
    """Returns the verdict on a script; one that did not return gets the status of that name, with the reason. `run` is
    the jail's, for kinds that measure there; it raises JailFault. The text of the script, `source`, only explains."""
    if report.stepped:
        return build_failure(question, Status.FORBIDDEN, STEPPED)
    if report.status is not RunStatus.RETURNED:
        where = describe_stop(report.talked, build_titles(plan.parameters, plan.trials))
        return build_failure(question, Status(report.status.value), f"{explain_error(report.reason)}{where}")
    with np.errstate(all="ignore"):  # a student's numbers may be as large as a double can hold
        return judge_results(question, plan, report, limit_cpu(run), Script(source))


def judge_results(question: ScriptQuestion, plan: Plan, report: RunReport, run: Run, script: Script) -> Verdict:
    """Returns the verdict on a script that returned."""
    kind = load_kinds()[question.check.kind]
    parts = {False: report.results, True: report.hidden_results}
    results = [select_results(parts[trial.hidden], index) for index, trial in enumerate(plan.trials)]
    records = report.talked.records if isinstance(report.talked, Played) else {}
    known = {False: None, True: list_known_words(kind.driver)}
    held = {hidden: read_traces(parts[hidden].get(name), known[hidden]) for hidden, name in TRACES.items()}
    traces = [held[trial.hidden].get(index, NO_TRACE) for index, trial in enumerate(plan.trials)]
    found = [
        judge_trial(kind, plan, trial, part, run) if not kind.plays else judge_played(kind, plan, index, part, records)
        for index, (trial, part) in enumerate(zip(plan.trials, results, strict=True))
    ]
    judged = settle(
        [
            JudgedTrial(trial, judgement, False, trace, script)
            for trial, (judgement, _), trace in zip(plan.trials, found, traces, strict=True)
        ]
    )
    titles = build_titles(plan.parameters, plan.trials)
    findings = build_findings(question, titles, judged)
    ends = [end for _, end in found]
    if ends[0] is not None and all(ends):
        visible = {choose_message(one) for one in judged if not one.trial.hidden}
        first = choose_message(judged[0])
        return build_failure(question, ends[0], first if len(visible) == 1 else f"{titles[0]}: {first}", findings)
    whole = [one for one, end in zip(judged, ends, strict=True) if not end]
    said = [f"{title}: {choose_message(one)}" for title, one in zip(titles, judged, strict=True)]
    mistake, direction = diagnose(kind, plan.parameters, list(zip(judged, said, strict=True)), whole, run)
    verdict = verdict_of(
        findings,
        diagnosis=mistake.sentence if mistake else None,
        line=mistake.line if mistake else None,
        direction=direction,
        evidence=kind.build_pictures(plan.parameters, [one for one in whole if not one.trial.hidden]),
    )
    review = next((one.judgement.review for one in judged if one.judgement.review), "")
    if review and verdict.status is not Status.INCORRECT:
        return verdict.model_copy(update={"status": Status.NEEDS_REVIEW, "diagnosis": review, "direction": review})
    if verdict.status is not Status.CORRECT:
        return verdict
    # The explanation names the right results, so it is shown with full marks only.
    return verdict.model_copy(
        update={"explain": question.explain, "remark": describe_success(kind, plan.parameters, judged)}
    )


def judge_trial(
    kind: AnyKind, plan: Plan, trial: AnyTrial, results: Results, run: Run
) -> tuple[Judgement[Any], Status | None]:
    """Returns the judgement on a trial; with a status if it ended before the kind could judge it."""
    if (raised := read_raised(results, trial)) is not None:
        return raised, Status.CRASHED
    if kind.measurement is not None:
        measured = measure(kind.measurement, trial, results, run)
        if isinstance(measured, Unmeasured):
            return Judgement(False, measured.why, None, measured.detail), measured.status
        results = measured
    return kind.judge(plan.parameters, trial, results), None


def judge_played(
    kind: AnyKind, plan: Plan, index: int, results: Results, records: Mapping[int, Any]
) -> tuple[Judgement[Any], Status | None]:
    """Returns the judgement on a trial of a kind that plays; with a status if it ended before it could be judged."""
    trial = plan.trials[index]
    if index not in records:
        raised = read_raised(results, trial)
        return raised or Judgement(False, ENDED, None), Status.CRASHED
    judgement = kind.judge(plan.parameters, trial, records[index])
    return judgement, Status.CRASHED if judgement.crashed else None


@cache
def list_known_words(driver: str) -> frozenset[str]:
    """Returns the words that a driver's notes may hold without telling anything that only the script knows."""
    public = (*map(dir, (builtins, np, mujoco, mujoco.MjModel, mujoco.MjData, mujoco.MjOption)), ALL_TYPES)
    return frozenset().union(re.findall(r"\w+", driver), *public)


def build_failure(question: ScriptQuestion, status: Status, why: str, findings: tuple[Finding, ...] = ()) -> Verdict:
    """Returns a verdict without points."""
    return Verdict(status=status, points=0.0, max_points=question.points, findings=findings, diagnosis=why or None)


def select_results(results: Results, index: int) -> dict[str, NDArray[np.generic]]:
    """Returns the results of one trial under the driver's own names."""
    prefix = f"t{index}_"
    return {name.removeprefix(prefix): values for name, values in results.items() if name.startswith(prefix)}


def read_raised(results: Results, trial: AnyTrial) -> Judgement[Any] | None:
    """Returns the judgement of a trial in which the script raised; None if it did not. What the harness says is a
    claim: of a hidden trial only the name of a built-in exception and a line are shown."""
    if "raised" not in results:
        return None
    try:
        said = json.loads(results["raised"].tobytes())
        what, line = str(said["raised"])[:RAISED_CHARS_MAX], said["line"]
    except (ValueError, KeyError, TypeError, RecursionError):
        what, line = "", None
    if trial.hidden and not isinstance(vars(builtins).get(what), type):
        what = ""
    place = f", in line {line} of your script" if is_line(line) else ""
    return Judgement(False, f"{explain_error(what or 'An exception', place)}.", None)


def settle(judged: Sequence[AnyJudged]) -> list[AnyJudged]:
    """Decides which trials count."""
    counting = list_counting({one.trial.id: one.judgement for one in judged})
    return [replace(one, counts=one.trial.id in counting) for one in judged]
