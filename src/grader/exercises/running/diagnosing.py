"""Chooses the sentence of a verdict: the mistake of a wrong script, a remark on a right one."""

import re
import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import structlog

from grader.errors import JailFault
from grader.exercises.crashes import explain_hidden_slip, explain_unrun
from grader.exercises.explaining.claims import CLAIMS, Evidence, correct_sentence
from grader.exercises.explaining.places import find_landmark
from grader.exercises.explaining.script import ParsedScript
from grader.exercises.explaining.values import find_appended_view
from grader.exercises.kind import JudgedTrial, Kind, Mistake
from grader.exercises.parameters import ExerciseParameters
from grader.exercises.running.measuring import Run

AnyKind = Kind[Any, Any, Any]
AnyJudged = JudgedTrial[Any, Any]

NUMBER = re.compile(r"(?<![A-Za-z_])\d[\d.]*(?:e[+-]?\d+)?")
NUMBERS_MAX, FIGURES_MAX = 12, 2
"""Numbers in the sentence of a mistake where the first wrong trial is hidden, and their significant figures."""

log = structlog.get_logger()

VIEW = "Line {line} appends data.{field} itself, which goes on changing: append a copy, data.{field}.copy()."
OTHER_MODEL = "The model there is another one: take sizes and addresses from the model that you are given."


def tells_numbers(sentence: str) -> bool:
    """Whether a sentence may tell numbers of a hidden case: some with more than two figures, or many. A script that
    makes up its trace chooses the numbers that a mistake's sentence takes from there."""
    figures = [number.replace(".", "").strip("0") for number in NUMBER.findall(sentence)]
    return len(figures) > NUMBERS_MAX or any(len(figure) > FIGURES_MAX for figure in figures)


def diagnose(
    kind: AnyKind,
    parameters: ExerciseParameters,
    judged: Sequence[tuple[AnyJudged, str]],
    whole: Sequence[AnyJudged],
    run: Run,
    *,
    find_authored: Callable[[], str | None] = lambda: None,
) -> tuple[Mistake | None, str | None]:
    """Returns the mistake that the author names, else the one that the kind recognises, else the hint of the first
    failed case, else its message. The sentence beside it replaces its own where only the direction of an error may be
    told. `judged` are all trials with their messages, `whole` those that did not raise. Details are left out, so that
    the diagnosis does not depend on the seed."""
    first, message = find_first(judged)
    if first is None:
        return None, None
    if first not in whole:
        if first.hidden and kind.needs_model:
            message = f"{message} {find_hint(first) or OTHER_MODEL}"
        message = tell_view(message, first.script)
        return Mistake(message), message
    alike = [trial.trace for trial in whole if not trial.counts and trial.hidden == first.hidden]
    slip = explain_hidden_slip(alike) or explain_unrun(alike, first.script)
    slip = slip and correct_sentence(slip, gather_evidence(whole))
    if slip is not None:
        return Mistake(slip), slip
    plain = choose_plain(first, message)
    if (sentence := find_authored()) is not None:
        return Mistake(sentence), plain
    named = kind.name_mistake(parameters, whole) or try_runs(kind, parameters, whole, run)
    mistake = Mistake(named) if isinstance(named, str) else named
    evidence = gather_evidence(whole)
    sentence = correct_sentence(mistake.sentence, evidence, (*CLAIMS, *kind.claims)) if mistake else None
    if mistake is None or sentence is None or (first.hidden and tells_numbers(sentence)):
        return Mistake(plain), plain
    line = mistake.line or find_landmark(sentence, evidence.script, kind.landmarks)
    mistake = replace(mistake, sentence=sentence, line=line)
    return mistake, plain if kind.mistakes_tell_size else mistake.sentence


def tell_view(message: str, script: ParsedScript) -> str:
    """Returns the message of an exception, with the line that appends a field of data itself, if there is one: what
    such a list holds is the same number again and again, in which nothing crosses and nothing moves."""
    view = find_appended_view(script)
    return message if view is None else f"{message} {VIEW.format(line=view[0], field=view[1])}"


def find_first(judged: Sequence[tuple[AnyJudged, str]]) -> tuple[AnyJudged | None, str]:
    """Returns the first trial that does not count, with its message; None where all do."""
    return next(((trial, sentence) for trial, sentence in judged if not trial.counts), (None, ""))


def choose_plain(first: AnyJudged, message: str) -> str:
    """Returns what is said of a trial whose mistake is not known: the hint of its case, else its message."""
    return find_hint(first) or message


def find_hint(first: AnyJudged) -> str | None:
    """Returns what the author says of a case that is the first to fail."""
    return first.trial.case.hint if first.trial.case else None


def find_plain(judged: Sequence[tuple[AnyJudged, str]]) -> tuple[Mistake | None, str | None]:
    """Returns what `diagnose` does where no mistake is looked for."""
    first, message = find_first(judged)
    plain = None if first is None else choose_plain(first, message)
    return (None, None) if plain is None else (Mistake(plain), plain)


def note_fault(error: Exception, kind: str) -> None:
    """Logs that the search for a mistake failed, without the message of the error, which may hold a learner's text."""
    at = traceback.extract_tb(error.__traceback__)[-1]
    log.error("no mistake could be looked for", kind=kind, error=type(error).__name__, file=at.filename, line=at.lineno)


def try_runs(
    kind: AnyKind, parameters: ExerciseParameters, whole: Sequence[AnyJudged], run: Run
) -> Mistake | str | None:
    """Returns the mistake that programs in the jail show; None where there is no jail."""
    try:
        return kind.name_mistake_by_runs(parameters, whole, run)
    except JailFault:
        return None


def gather_evidence(judged: Sequence[AnyJudged]) -> Evidence:
    """Returns what the claims of a sentence are held against."""
    traces = [trial.trace for trial in judged]
    return Evidence(judged[0].script, traces, [trial.trace for trial in judged if not trial.counts] or traces)


def describe_success(kind: AnyKind, parameters: ExerciseParameters, judged: Sequence[AnyJudged]) -> str:
    """Returns how many trials hold, and what the kind says of a right script."""
    hidden = sum(trial.hidden for trial in judged)
    cases = {1: "The case holds", 2: "Both cases hold"}.get(len(judged), f"All {len(judged)} cases hold")
    also = f", the {hidden} hidden ones too" if hidden > 1 else ", the hidden one too" if hidden else ""
    return f"{cases}{also}. {kind.describe_success(parameters, judged)}".rstrip()
