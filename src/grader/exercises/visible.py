"""Describes the visible trials of an exercise for the learner's own machine: their inputs, and how they are judged."""

from collections.abc import Mapping
from typing import Any

from grader.exercises.findings import build_titles
from grader.exercises.kind import TextOf
from grader.exercises.running.planning import SEED, load_kinds, plan_exercise, read_parameters, refuse_text
from grader.questions import ModelXml
from grader.questions.kinds.script import ScriptQuestion


def describe_exercise(
    question: ScriptQuestion, model_xml: ModelXml, text_of: TextOf = refuse_text, *, judged: bool = True
) -> Mapping[str, Any]:
    """Returns the visible trials as plain JSON, and how many points the hidden ones have. `problem` is what the kind's
    judge needs outside of the server; None where only the server judges, as in every trial unless `judged`."""
    kind = load_kinds()[question.check.kind]
    plan = plan_exercise(question, model_xml, SEED, text_of)
    scale = question.points / sum(trial.points for trial in plan.trials)
    titled = zip(plan.trials, build_titles(plan.parameters, plan.trials), strict=True)
    return {
        "kind": question.check.kind,
        "how": kind.how,
        "without_integrators": kind.without_integrators,
        "trials": [
            {
                "id": trial.id,
                "title": title,
                "points": round(trial.points * scale, 9),
                "entries": list(trial.entries or (question.entry,)),
                "inputs": kind.describe_inputs(trial),
                "problem": kind.describe_problem(question.reveal, plan.parameters, trial) if judged else None,
            }
            for trial, title in titled
            if not trial.hidden
        ],
        "hidden_points": round(sum(trial.points for trial in plan.trials if trial.hidden) * scale, 9),
    }


def list_visible_models(question: ScriptQuestion) -> set[str]:
    """Returns the names of the models in models/ that visible cases use."""
    parameters = read_parameters(load_kinds()[question.check.kind], question)
    visible = [case for case in parameters.cases if not case.hidden]
    named = {case.model or (None if case.xml is not None else parameters.model) for case in visible}
    return {name for name in named if name is not None}
