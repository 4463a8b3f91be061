"""The geoms of both models, where the visible cases begin."""

from collections.abc import Sequence
from typing import Any

from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.model.judge import ModelOutcome
from grader.exercises.kinds.model.parameters import Problem

SCENES_MAX = 3


def build_scenes(visible: Sequence[JudgedTrial[Problem, ModelOutcome]]) -> dict[str, Any]:
    """Returns `models`, the geoms of the student's model, and `references`, those of the author's, of the first cases
    with another start. Failed cases come first."""
    chosen: list[JudgedTrial[Problem, ModelOutcome]] = []
    for judged in sorted(visible, key=lambda each: each.judgement.passed):
        outcome = judged.judgement.outcome
        if outcome.geoms and all(outcome.geoms != other.judgement.outcome.geoms for other in chosen):
            chosen.append(judged)
    chosen = chosen[:SCENES_MAX]
    return {
        "models": [{"case": trial.id, "geoms": [*trial.judgement.outcome.geoms]} for trial in chosen],
        "references": [{"case": trial.id, "geoms": [*trial.judgement.outcome.reference_geoms]} for trial in chosen],
    }
