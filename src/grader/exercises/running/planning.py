"""Finds the installed kinds, and plans an exercise: its trials with drawn numbers, and the job of the jail."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np

from grader.domain.axes import Placed
from grader.domain.misread import drop_remarks
from grader.domain.plugins import find_points, load_point
from grader.domain.run import Job, Limits
from grader.errors import GraderError, NotFound, PluginError
from grader.exercises.driving.embedding import CATCHING, DRIVER, SAVING, WATCH, compile_driver, save_models
from grader.exercises.driving.playing import Talk, play_trials
from grader.exercises.kind import Content, DrawnCase, Kind, TextOf, Trial
from grader.exercises.parameters import (
    Case,
    ExerciseParameters,
    WrongParameter,
    draw_number,
    write_numbers,
)
from grader.exercises.running.lacks import list_lacks
from grader.questions import ModelXml, Question, write_module
from grader.questions.kinds.script import ScriptQuestion

GROUP = "grader.exercise_kinds"
"""The entry-point group in which kinds of exercise are found."""

SEED = 0
"""Draws the numbers when content is loaded, and those of visible cases for the learner's own machine. A submission has
a seed of its own, so these are another draw."""

AnyKind = Kind[Any, Any, Any]
AnyTrial = Trial[Any]


def refuse_text(path: str) -> str:
    """Raises NotFound: there is no content folder to read from."""
    raise NotFound(f"{path} cannot be read: there is no content folder here")


@cache
def load_kinds() -> Mapping[str, AnyKind]:
    """Returns every installed kind by its name. Raises PluginError if two claim one name, or if one cannot be loaded or
    is not whole."""
    kinds: dict[str, AnyKind] = {}
    for point in find_points(GROUP):
        if point.name in kinds:
            raise PluginError(f"two installed packages provide the exercise kind {point.name!r}: uninstall one of them")
        kinds[point.name] = load_kind(point)
    return kinds


def load_kind(point: EntryPoint) -> AnyKind:
    """Makes the kind of an entry point. Raises PluginError."""
    kind: AnyKind = load_point(point, "exercise kind")
    if point.module.startswith("grader."):  # ours are whole, by a test: reading their drivers takes 30 ms
        return kind
    if faults := "; ".join(list_lacks(kind)):
        raise PluginError(f"the exercise kind {point.name!r} ({point.value}) is not whole: {faults}")
    return kind


def list_codes() -> list[bytes]:
    """Returns the code that the jobs of installed kinds have in common: the jail may load it ahead."""
    parts = [code for kind in load_kinds().values() for code in compile_driver(kind.driver).values()]
    return list(dict.fromkeys([*parts, CATCHING]))


@dataclass(frozen=True)
class Plan:
    """The input of the jail for one exercise, and the trials for the judge. The driver, whose parts are `codes`, runs
    over the plain-JSON `inputs`, then over the `hidden_inputs`; `without_integrators` as in Job. `wrong_scripts` are
    the author's, each with the sentence for a student whose script does the same. `write_module` makes the module that
    the jail imports of an answer."""

    codes: Mapping[str, bytes]
    inputs: Mapping[str, Any]
    hidden_inputs: Mapping[str, Any]
    without_integrators: bool
    parameters: ExerciseParameters
    trials: tuple[AnyTrial, ...]
    talk: Talk | None = None
    wrong_scripts: tuple[tuple[str, str], ...] = ()
    write_module: Callable[[str], str] = str

    def build_job(self, text: str, limits: Limits) -> Job:
        """Returns the job of the jail for the text of an answer."""
        source = self.write_module(text)
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


def read_parameters(kind: AnyKind, question: ScriptQuestion) -> ExerciseParameters:
    """Returns the check's parameters. Raises pydantic.ValidationError."""
    text = json.dumps(drop_remarks(question.check.parameters))
    parameters: ExerciseParameters = kind.parameters.model_validate_json(text, strict=True)
    return parameters


def find_placing(question: Question) -> Callable[[Mapping[str, Any]], Iterable[Placed]]:
    """Returns what places stored verdicts on the axes of an exercise, as its kind does."""
    assert isinstance(question, ScriptQuestion)
    kind = load_kinds()[question.check.kind]
    return partial(kind.place_on_axes, read_parameters(kind, question))


def plan_exercise(question: ScriptQuestion, model_xml: ModelXml, seed: int, text_of: TextOf = refuse_text) -> Plan:
    """Returns the inputs of the jail and the trials for the judge; `seed` draws the numbers of the cases."""
    kind = load_kinds()[question.check.kind]
    parameters = read_parameters(kind, question)
    content = Content(question.entry, model_xml, text_of, question.takes, is_fixed=seed == SEED)
    trials: list[AnyTrial] = []
    for index, case in enumerate(parameters.cases):
        trials.extend(build_case_trials(kind, parameters, case, content, [seed, index]))
    trials.extend(kind.build_further_trials(parameters, trials))
    inputs: dict[bool, list[dict[str, Any]]] = {False: [], True: []}
    for index, trial in enumerate(trials):
        entries = trial.entries or (question.entry,)
        entry = {"index": index, "entries": entries, "hidden": trial.hidden, "inputs": trial.inputs}
        inputs[trial.hidden].append(entry)
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
        wrong_scripts=() if kind.runs_wrong_programs else read_wrong_scripts(parameters, text_of),
        write_module=partial(write_module, question.takes, question.entry),
    )


def read_wrong_scripts(parameters: ExerciseParameters, text_of: TextOf) -> tuple[tuple[str, str], ...]:
    """Returns the text of each wrong script, with its sentence. Raises GraderError."""
    return tuple((text_of(mistake.program), mistake.sentence) for mistake in parameters.mistakes)


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
    trials = kind.build_trials(parameters, DrawnCase(case, numbers, xml, written, rng, content))
    if not trials:
        raise ValueError("the kind makes no trial of this case: its build_trials must return one at least")
    shares = sum(trial.points for trial in trials)
    return [
        replace(trial, case=case, hidden=case.hidden, points=case.points * trial.points / shares) for trial in trials
    ]


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
