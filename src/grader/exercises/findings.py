"""Makes the findings of judged trials: one each, or one for each part; the only place that hides hidden cases."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from grader.domain.verdict import Finding
from grader.exercises.kind import JudgedTrial, Judgement, Trial
from grader.exercises.parameters import ExerciseParameters, name_cases
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.cleaning import make_showable, replace_hidden

AnyJudged = JudgedTrial[Any, Any]


def build_titles(parameters: ExerciseParameters, trials: Sequence[Trial[Any]]) -> list[str]:
    """Returns the title of each trial: that of its case, or a number if the case is hidden, and its own."""
    cases = parameters.cases
    hidden = [case.id for case in cases if case.hidden]
    titles = {
        case.id: f"hidden case {hidden.index(case.id) + 1}" if case.hidden else case.title or case.id for case in cases
    }
    return [", ".join(filter(None, (titles[trial.case.id] if trial.case else "", trial.title))) for trial in trials]


def build_ids(parameters: ExerciseParameters, trials: Sequence[Trial[Any]]) -> list[str]:
    """Returns the id of each trial's finding: its own, with the name of its case in place of the case's id."""
    names = name_cases(parameters.cases)
    return [
        names[trial.case.id] + trial.id.removeprefix(trial.case.id)
        if trial.case is not None and trial.id.startswith(trial.case.id)
        else trial.id
        for trial in trials
    ]


def build_findings(
    question: ScriptQuestion, ids: Sequence[str], titles: Sequence[str], judged: Sequence[AnyJudged]
) -> tuple[Finding, ...]:
    """Returns one finding for each trial, and one that asks for a review if a judgement does."""
    scale = question.points / sum(trial.trial.points for trial in judged)
    findings = [
        finding
        for id_, title, trial in zip(ids, titles, judged, strict=True)
        for finding in build_trial_findings(trial, id_, title, trial.trial.points * scale)
    ]
    reviews = dict.fromkeys(trial.judgement.review for trial in judged if trial.judgement.review)
    if reviews:
        message = " ".join(reviews)
        findings.append(
            Finding(
                id="doubt", title="for a person", passed=None, points=0.0, max_points=0.0, message=message,
                direction=message
            )
        )  # fmt: skip
    return tuple(findings)


def build_trial_findings(judged: AnyJudged, id_: str, title: str, points: float) -> Iterator[Finding]:
    """Yields the finding of a trial, or one for each of its parts."""
    parts = judged.judgement.parts
    if not parts:
        yield build_finding(judged, id_, title, points)
    shares = sum(part.points for part in parts)
    for part in parts:
        alone = Judgement(
            part.passed, part.message, None, part.detail, part.measured, part.expected, unmet=judged.judgement.unmet
        )
        counts = part.passed and (judged.counts or not judged.judgement.passed)
        one = replace(judged, judgement=alone, counts=counts)
        yield build_finding(one, f"{id_}.{part.id}", f"{title}: {part.title}", points * part.points / shares)


def build_finding(judged: AnyJudged, id_: str, title: str, points: float) -> Finding:
    """Returns the finding of a trial; of a hidden one neither detail nor measured nor expected values. The detail may
    say how far the result is off, so the direction leaves it out. Some hold what the script's process says of a value,
    so that all are cleaned."""
    shown = judged.judgement if not judged.hidden else Judgement(judged.judgement.passed, "", None)
    return Finding(
        id=id_, title=title, passed=judged.counts, points=points if judged.counts else 0.0,
        max_points=points, message=" ".join(filter(None, (choose_message(judged), show_line(shown.detail)))),
        direction=choose_message(judged), measured=make_showable(shown.measured, show_line), expected=shown.expected
    )  # fmt: skip


def choose_message(judged: AnyJudged) -> str:
    """Returns the message of the finding: `unmet` where the trial passed but does not count."""
    judgement = judged.judgement
    return show_line(judgement.unmet if judgement.passed and not judged.counts else judgement.message)


def show_line(text: str) -> str:
    """Returns a text on one line, with nothing in it that cannot be shown."""
    return replace_hidden(text).replace("\n", " ")
