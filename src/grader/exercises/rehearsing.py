"""Finds every fault of an exercise's parameters: reads them, and rehearses the trials of every case."""

import ast
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import mujoco
from pydantic import ValidationError

from grader.domain.misread import explain_misread
from grader.domain.plugins import describe_error
from grader.errors import Fault, GraderError
from grader.exercises.kind import Content, TextOf
from grader.exercises.parameters import (
    Case,
    ExerciseParameters,
    WrongInCase,
    WrongParameter,
    WrongParameters,
    list_ends,
    list_keys,
    write_numbers,
)
from grader.exercises.running.planning import (
    SEED,
    AnyKind,
    AnyTrial,
    build_case_trials,
    load_kinds,
    read_model,
    read_parameters,
    refuse_text,
)
from grader.questions import ModelXml, Question
from grader.questions.kinds.script import ScriptQuestion

Rehearse = Callable[[Any, AnyTrial], None]
"""A method of a kind that gets the parameters and a trial, and raises ValueError."""


def check_exercise(question: Question, model_xml: ModelXml, where: str, text_of: TextOf = refuse_text) -> list[Fault]:
    """Returns every fault of an exercise's `check`, each once, none of other questions; `where` is the quiz file."""
    if not isinstance(question, ScriptQuestion):
        return []
    kind = load_kinds().get(question.check.kind)
    if kind is None:
        known = ", ".join(sorted(load_kinds()))
        why = f"no kind of exercise is called {question.check.kind!r}; use {known}, or install the package that has it"
        return [Fault(where, f"{question.id}.check.kind", why)]
    if question.takes not in kind.takes:
        why = f"an exercise of the kind {question.check.kind!r} takes {' or '.join(kind.takes)}, not {question.takes}"
        return [Fault(where, f"{question.id}.takes", why)]
    try:
        parameters = read_parameters(kind, question)
    except ValidationError as error:
        faults = explain_misread_parameters(kind, question, error)
    else:
        content = Content(question.entry, model_xml, text_of, question.takes, is_fixed=True)
        faults = find_wrong_parameters(kind, parameters, content)
    return [
        Fault(where, ".".join(filter(None, (question.id, "check", key))), why) for key, why in dict.fromkeys(faults)
    ]


def certify_exercise(
    question: ScriptQuestion, model_xml: ModelXml, where: str, text_of: TextOf = refuse_text
) -> list[Fault]:
    """Returns a fault for each case of an exercise without faults of which the kind is not certain."""
    kind = load_kinds()[question.check.kind]
    parameters, content = read_parameters(kind, question), Content(question.entry, model_xml, text_of, is_fixed=True)
    faults = []
    for index, case in enumerate(parameters.cases):
        try:
            rehearse_case(kind, parameters, content, index, kind.certify)
        except Exception as error:  # code of another package: anything may be raised
            key = f"{question.id}.check.{find_key(error, f'cases.{index}')}"
            faults.append(Fault(where, key, f"case {case.id}: {explain_refusal(kind, error)}"))
    return faults


def explain_misread_parameters(
    kind: AnyKind, question: ScriptQuestion, error: ValidationError
) -> Iterator[tuple[str, str]]:
    """Yields key and reason of every parameter that pydantic refused."""
    known = list_keys(kind.parameters)
    for place, why in explain_misread(error, question.check.parameters, lambda _: known):
        yield ".".join(map(str, place)), why


def find_wrong_parameters(kind: AnyKind, parameters: ExerciseParameters, content: Content) -> Iterator[tuple[str, str]]:
    """Rehearses the trials of every case; yields key and reason of every parameter that cannot work."""
    if not kind.runs_wrong_programs:
        yield from find_wrong_scripts(parameters, content)
    ids, trials = [case.id for case in parameters.cases], list[AnyTrial]()
    yield from find_wrong_cases(kind, parameters, content, trials)
    ids_of_trials = [trial.id for trial in trials] if len({*ids}) == len(ids) else []  # else the case is the fault
    if repeated := next((id_ for id_ in ids_of_trials if ids_of_trials.count(id_) > 1), None):
        yield "", f"the kind makes several trials with the id {repeated!r}: its build_trials must name each by its case"
    if {trial.case.id for trial in trials if trial.case} == {*ids}:
        try:
            for trial in kind.build_further_trials(parameters, trials):
                kind.rehearse(parameters, trial)
        except Exception as error:  # code of another package: anything may be raised
            yield getattr(error, "key", ""), explain_refusal(kind, error)


def find_wrong_cases(
    kind: AnyKind, parameters: ExerciseParameters, content: Content, trials: list[AnyTrial]
) -> Iterator[tuple[str, str]]:
    """Adds the trials of every case to `trials`; yields key and reason of what is wrong with a case."""
    ids = [case.id for case in parameters.cases]
    refused: dict[tuple[str, str], dict[str, str]] = {}
    for index, case in enumerate(parameters.cases):
        key = f"cases.{index}"
        if case.id in ids[:index]:
            yield f"{key}.id", f"{case.id} is used twice; give each case its own id"
        if unknown := list(find_unknown_numbers(parameters, case, key)):
            yield from unknown
            continue
        try:
            trials.extend(rehearse_case(kind, parameters, content, index, kind.rehearse))
        except Exception as error:  # code of another package: anything may be raised
            end = find_end(kind, parameters, content, index)
            for fault in list_faults(kind, parameters, content, index, error=error):
                refused.setdefault(fault, {})[case.id] = end
    yield from name_cases(refused, ids)


def find_key(error: Exception, case: str) -> str:
    """Returns the key of what an error is about, below `check`; `case` is that of the case."""
    return f"{case}.{error.key_in_case}" if isinstance(error, WrongInCase) else str(getattr(error, "key", case))


def list_faults(
    kind: AnyKind, parameters: ExerciseParameters, content: Content, index: int, *, error: Exception
) -> list[tuple[str, str]]:
    """Returns key and reason of what an error of a case is about."""
    key = f"cases.{index}"
    if wrong := find_wrong_number(parameters, parameters.cases[index], content, key):
        return [wrong]
    errors = error.errors if isinstance(error, WrongParameters) else [error]
    return [(find_key(each, key), explain_refusal(kind, each)) for each in errors]


def name_cases(refused: Mapping[tuple[str, str], Mapping[str, str]], ids: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yields key and reason of what is refused, by the ids of cases and the ends of their ranges. The cases are named
    where the key does not, and only some of them are refused or at one end only."""
    for (key, why), places in refused.items():
        is_everywhere = {*ids} == {*places} and not any(places.values())
        if key.startswith("cases.") or is_everywhere:
            yield key, why
        else:
            yield key, f"case {' and case '.join(f'{id_}{end}' for id_, end in places.items())}: {why}"


def find_end(kind: AnyKind, parameters: ExerciseParameters, content: Content, index: int) -> str:
    """Returns at which end of its ranges a refused case is refused, with the numbers that are set there; empty where it
    has no ranges, or is refused at both."""
    case = parameters.cases[index]
    ends = list_ends(case)
    if len(ends) == 1:
        return ""
    wrong = [which for which, end in zip(("lower", "upper"), ends, strict=True)
             if not can_be_rehearsed(kind, parameters, content, index, end)]  # fmt: skip
    if len(wrong) != 1:
        return "" if wrong else ", between the ends of its ranges"
    drawn = ends[wrong[0] == "upper"].set
    numbers = ", ".join(f"{name} = {value:g}" for name, value in drawn.items() if case.set[name] != value)
    return f", at the {wrong[0]} end of its ranges{f' ({numbers})' if numbers else ''}"


def can_be_rehearsed(
    kind: AnyKind, parameters: ExerciseParameters, content: Content, index: int, drawn: Case
) -> bool:  # fmt: skip
    """Whether a case with these numbers passes what `rehearse_drawn` tries."""
    try:
        rehearse_drawn(kind, parameters, content, index, drawn, rehearse=kind.rehearse)
    except Exception:  # code of another package: anything may be raised
        return False
    return True


def find_wrong_number(parameters: ExerciseParameters, case: Case, content: Content, key: str) -> tuple[str, str] | None:
    """Returns key and reason of the number with which a model does not compile that does as it is written; None if
    there is none."""
    try:
        written = read_model(parameters, case, content.model_xml)
        mujoco.MjModel.from_xml_string(written)
    except (ValueError, mujoco.FatalError, GraderError):
        return None
    for end in list_ends(case):
        for name, value in end.set.items():
            assert not isinstance(value, tuple)
            try:
                mujoco.MjModel.from_xml_string(write_numbers(written, parameters.numbers, {name: value}))
            except WrongParameter:
                return None
            except (ValueError, mujoco.FatalError) as error:
                at = f"numbers.{name}.attribute" if "attribute" in str(error) else f"{key}.set.{name}"
                return at, f"with {name} = {value:g} the model cannot be compiled: {' '.join(str(error).split())}"
    return None


def explain_refusal(kind: AnyKind, error: Exception) -> str:
    """Returns why a kind cannot use what an author wrote, or where it fails itself."""
    if isinstance(error, ValueError | KeyError | GraderError) and error.args:
        return str(error.args[0])
    return f"the kind fails: {describe_error(error, type(kind).__module__)}"


def find_wrong_scripts(parameters: ExerciseParameters, content: Content) -> Iterator[tuple[str, str]]:
    """Yields key and reason of every script of `mistakes` that cannot be read, or does not define the entry."""
    for index, mistake in enumerate(parameters.mistakes):
        key = f"mistakes.{index}.program"
        if content.takes == "npz":
            yield key, "an exercise that takes a file has no programs with mistakes: remove it"
            continue
        try:
            text = content.text_of(mistake.program)
            defined = list_defined(text) if content.takes == "python" else {content.entry}
        except GraderError as error:
            yield key, str(error)
        except SyntaxError as error:
            yield key, f"{mistake.program}: line {error.lineno}: {error.msg}"
        else:
            if content.entry not in defined:
                yield key, f"{mistake.program} defines no function {content.entry}: write it like a student's script"


def list_defined(source: str) -> set[str]:
    """Returns the names of the functions that a script defines. Raises SyntaxError."""
    try:
        return {part.name for part in ast.parse(source).body if isinstance(part, ast.FunctionDef)}
    except (ValueError, RecursionError) as error:
        raise SyntaxError(str(error)) from error


def rehearse_case(
    kind: AnyKind, parameters: ExerciseParameters, content: Content, index: int, rehearse: Rehearse
) -> Sequence[AnyTrial]:
    """Builds the trials of a case at both ends of its ranges and for a draw, and calls `rehearse` with each; returns
    those of the last. Raises ValueError, KeyError or GraderError where a trial cannot be built or judged."""
    case = parameters.cases[index]
    ends = [end for end in list_ends(case) if end != case]
    trials: Sequence[AnyTrial] = ()
    for drawn in (*ends, case):
        trials = rehearse_drawn(kind, parameters, content, index, drawn, rehearse=rehearse)
    return trials


def rehearse_drawn(
    kind: AnyKind, parameters: ExerciseParameters, content: Content, index: int, drawn: Case, *, rehearse: Rehearse
) -> Sequence[AnyTrial]:
    """Builds the trials of a case, whose ranges may be numbers, and calls `rehearse` with each; returns them. Raises as
    `rehearse_case` does."""
    trials = build_case_trials(kind, parameters, drawn, content, [SEED, index])
    for trial in trials:
        check_inputs(trial)
        rehearse(parameters, trial)
    return trials


def check_inputs(trial: AnyTrial) -> None:
    """Raises ValueError for a trial whose inputs cannot be sent to the jail."""
    for name, inputs in (("inputs", trial.inputs), ("measured", trial.measured)):
        try:
            json.dumps(inputs, allow_nan=False)
        except (TypeError, ValueError) as error:
            raise ValueError(f"the kind makes a trial whose `{name}` are no plain JSON: {error}") from error


def find_unknown_numbers(parameters: ExerciseParameters, case: Case, key: str) -> Iterator[tuple[str, str]]:
    """Yields key and reason of every number that a case sets and `numbers` does not define."""
    known = ", ".join(parameters.numbers) or "none"
    for name in case.set.keys() - parameters.numbers.keys():
        yield f"{key}.set.{name}", f"no number has this name; `numbers` has {known}"
