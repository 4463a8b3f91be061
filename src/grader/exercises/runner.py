"""Checks, plans and judges exercises of every kind; the only place that hides hidden cases."""

import builtins
import json
import re
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import entry_points
from inspect import getsource
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from grader.domain.misread import misread, without_remarks
from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import Fault, GraderError, JailFault, NotFound
from grader.exercises import catching, harness, recorder
from grader.exercises.crashes import explain_error, explain_hidden_slip
from grader.exercises.embedding import embed_code
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

NUMBER = re.compile(r"(?<![A-Za-z_])\d[\d.]*(?:e[+-]?\d+)?")
NUMBERS_MAX, FIGURES_MAX = 12, 2
"""Numbers in the sentence of a mistake where the first wrong trial is hidden, and their significant figures."""

STEPPED = (
    "The function let MuJoCo take the step (mj_step or another integrator), which this exercise does not allow: take "
    "accelerations from mujoco.mj_forward, and write the step yourself."
)


RAISED_CHARS_MAX = 1000


ALL_TYPES = [one.__name__ for one in vars(types).values() if isinstance(one, type)]
"""Names of Python's types that are no built-in names, such as `function`."""


OTHER_MODEL = "The model there is another one: take sizes and addresses from the model that you are given."


def refuse_text(path: str) -> str:
    """Raises NotFound: there is no content folder to read from."""
    raise NotFound(f"{path} cannot be read: there is no content folder here")


def refuse_job(job: Job) -> RunReport:
    """Raises JailFault: there is no jail to run it in."""
    raise JailFault("no jail is set up: nothing can be measured")


AnyKind = Kind[Any, Any, Any]
AnyTrial = Trial[Any]
AnyJudged = JudgedTrial[Any, Any]


@cache
def load_kinds() -> Mapping[str, AnyKind]:
    """Returns every installed kind by its name. Raises GraderError if two claim one name, or one cannot be loaded."""
    kinds: dict[str, AnyKind] = {}
    for point in entry_points(group=GROUP):
        if point.name in kinds:
            raise GraderError(f"two installed packages provide the exercise kind {point.name!r}: uninstall one of them")
        kinds[point.name] = load_point(point, "exercise kind")
    return kinds


@dataclass(frozen=True)
class Plan:
    """The input of the jail for one exercise, and the trials for the judge. `driver` runs over the plain-JSON `inputs`,
    then over the `hidden_inputs`; `without_integrators` as in Job."""

    driver: str
    inputs: Mapping[str, Any]
    hidden_inputs: Mapping[str, Any]
    without_integrators: bool
    parameters: ExerciseParameters
    trials: tuple[AnyTrial, ...]

    def build_job(self, source: str, limits: Limits) -> Job:
        """Returns the job of the jail for a script."""
        watch = f"watch_exceptions({embed_code(getsource(catching))})\n" if "except" in source else ""
        return Job(
            source,
            f"{self.driver}{watch}",
            self.inputs,
            limits,
            without_integrators=self.without_integrators,
            hidden_inputs=self.hidden_inputs,
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
    return Plan(
        driver=build_driver(kind),
        inputs={"trials": inputs[False], "more": bool(inputs[True])},
        hidden_inputs={"trials": inputs[True]} if inputs[True] else {},
        without_integrators=kind.without_integrators,
        parameters=parameters,
        trials=tuple(trials),
    )


def build_driver(kind: AnyKind) -> str:
    """Returns the driver of the jail: the harness, which loads the recorder and the kind's own driver."""
    harness_code, recorder_code, kind_code = map(embed_code, (getsource(harness), getsource(recorder), kind.driver))
    return f"import base64, marshal\nexec({harness_code})\nload({recorder_code}, {kind_code})\n"


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


def prepare_exercise(question: ScriptQuestion, plan: Plan) -> None:
    """Computes and caches what judging needs, whatever the script does: to be called while it runs."""
    kind = load_kinds()[question.check.kind]
    for trial in plan.trials:
        kind.prepare(plan.parameters, trial)


def judge_exercise(question: ScriptQuestion, plan: Plan, report: RunReport, run: Run = refuse_job) -> Verdict:
    """Returns the verdict on a script; one that did not return gets the status of that name, with the reason. `run` is
    the jail's, for kinds that measure there. Raises JailFault as it does."""
    if report.stepped:
        return build_failure(question, Status.FORBIDDEN, STEPPED)
    if report.status is not RunStatus.RETURNED:
        return build_failure(question, Status(report.status.value), explain_error(report.reason))
    with np.errstate(all="ignore"):  # a student's numbers may be as large as a double can hold
        return judge_results(question, plan, report, limit_cpu(run))


def judge_results(question: ScriptQuestion, plan: Plan, report: RunReport, run: Run) -> Verdict:
    """Returns the verdict on a script that returned."""
    kind = load_kinds()[question.check.kind]
    parts = {False: report.results, True: report.hidden_results}
    results = [select_results(parts[trial.hidden], index) for index, trial in enumerate(plan.trials)]
    known = {False: None, True: list_known_words(kind.driver)}
    held = {hidden: read_traces(parts[hidden].get(name), known[hidden]) for hidden, name in TRACES.items()}
    traces = [held[trial.hidden].get(index, NO_TRACE) for index, trial in enumerate(plan.trials)]
    found = [judge_trial(kind, plan, trial, part, run) for trial, part in zip(plan.trials, results, strict=True)]
    judged = settle(
        [
            JudgedTrial(trial, judgement, False, trace)
            for trial, (judgement, _), trace in zip(plan.trials, found, traces, strict=True)
        ]
    )
    titles = build_titles(plan)
    findings = build_findings(question, titles, judged)
    ends = [end for _, end in found]
    if ends[0] is not None and all(ends):
        return build_failure(question, ends[0], f"{titles[0]}: {choose_message(judged[0])}", findings)
    whole = [one for one, end in zip(judged, ends, strict=True) if not end]
    diagnosis, direction = diagnose(kind, plan, judged, whole)
    verdict = verdict_of(
        findings,
        diagnosis=diagnosis,
        direction=direction,
        evidence=kind.build_pictures(plan.parameters, [one for one in whole if not one.trial.hidden]),
    )
    review = next((one.judgement.review for one in judged if one.judgement.review), "")
    if review and verdict.status is not Status.INCORRECT:
        return verdict.model_copy(update={"status": Status.NEEDS_REVIEW, "diagnosis": review, "direction": review})
    # The explanation names the right results, so it is shown with full marks only.
    return verdict.model_copy(update={"explain": question.explain}) if verdict.status is Status.CORRECT else verdict


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


def tells_numbers(sentence: str) -> bool:
    """Whether a sentence may tell numbers of a hidden case: some with more than two figures, or many. A script that
    makes up its trace chooses the numbers that a mistake's sentence takes from there."""
    figures = [number.replace(".", "").strip("0") for number in NUMBER.findall(sentence)]
    return len(figures) > NUMBERS_MAX or any(len(one) > FIGURES_MAX for one in figures)


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


def build_titles(plan: Plan) -> list[str]:
    """Returns the title of each trial: that of its case, or a number if the case is hidden, and its own."""
    cases = plan.parameters.cases
    hidden = [case.id for case in cases if case.hidden]
    titles = {
        case.id: f"hidden case {hidden.index(case.id) + 1}" if case.hidden else case.title or case.id for case in cases
    }
    return [
        ", ".join(filter(None, (titles[trial.case.id] if trial.case else "", trial.title))) for trial in plan.trials
    ]


def build_findings(question: ScriptQuestion, titles: Sequence[str], judged: Sequence[AnyJudged]) -> tuple[Finding, ...]:
    """Returns one finding for each trial, and one that asks for a review if a judgement does."""
    scale = question.points / sum(one.trial.points for one in judged)
    findings = [build_finding(one, title, one.trial.points * scale) for title, one in zip(titles, judged, strict=True)]
    reviews = dict.fromkeys(one.judgement.review for one in judged if one.judgement.review)
    if reviews:
        message = " ".join(reviews)
        findings.append(
            Finding(
                id="doubt", title="for a person", passed=None, points=0.0, max_points=0.0, message=message,
                direction=message
            )
        )  # fmt: skip
    return tuple(findings)


def build_finding(judged: AnyJudged, title: str, points: float) -> Finding:
    """Returns the finding of a trial; of a hidden one neither detail nor measured nor expected values. The detail may
    say how far the result is off, so the direction leaves it out."""
    shown = judged.judgement if not judged.trial.hidden else Judgement(judged.judgement.passed, "", None)
    return Finding(
        id=judged.trial.id, title=title, passed=judged.counts, points=points if judged.counts else 0.0,
        max_points=points, message=" ".join(filter(None, (choose_message(judged), shown.detail))),
        direction=choose_message(judged), measured=shown.measured, expected=shown.expected
    )  # fmt: skip


def choose_message(judged: AnyJudged) -> str:
    """Returns the message of the finding: `unmet` where the trial passed but does not count."""
    judgement = judged.judgement
    return judgement.unmet if judgement.passed and not judged.counts else judgement.message


def diagnose(
    kind: AnyKind, plan: Plan, judged: Sequence[AnyJudged], whole: Sequence[AnyJudged]
) -> tuple[str | None, str | None]:
    """Returns the sentence of the mistake, else the hint of the first failed case, else the message of its finding. The
    second sentence replaces the first where only the direction of an error may be told. `whole` are the trials
    that did not raise. Details are left out, so that the diagnosis does not depend on the seed."""
    wrong = next((index for index, one in enumerate(judged) if not one.counts), None)
    if wrong is None:
        return None, None
    first = judged[wrong]
    message = f"{build_titles(plan)[wrong]}: {choose_message(first)}"
    if first not in whole:
        message = f"{message} {OTHER_MODEL}" if first.trial.hidden and kind.needs_model else message
        return message, message
    slip = explain_hidden_slip(
        [one.trace for one in whole if not one.counts and one.trial.hidden == first.trial.hidden]
    )
    if slip is not None:
        return slip, slip
    hint = first.trial.case.hint if first.trial.case else None
    mistake = kind.name_mistake(plan.parameters, whole)
    if first.trial.hidden and mistake and tells_numbers(mistake):
        mistake = None
    return mistake or hint or message, hint or message if kind.mistakes_tell_size or not mistake else mistake
