"""Asks a kind for the evidence of a verdict, and leaves out what no page can draw."""

from collections.abc import Sequence
from typing import Any

import structlog

from grader.domain.pages.pictures import find_wrong_pictures
from grader.exercises.findings import AnyJudged
from grader.exercises.parameters import ExerciseParameters
from grader.exercises.running.planning import AnyKind

FAULTS = "faults"
"""The key of the evidence under which a kind's faults stand."""

log = structlog.get_logger()


def build_evidence(kind: AnyKind, parameters: ExerciseParameters, visible: Sequence[AnyJudged]) -> dict[str, Any]:
    """Returns the pictures that a kind builds. What has a wrong shape is a fault of the kind and costs the learner the
    picture alone: it is left out, logged, and told under `faults`, which `grader check` reports."""
    evidence = kind.build_pictures(parameters, visible)
    wrong = dict(find_wrong_pictures(evidence))
    if not wrong:
        return evidence
    log.error("a kind builds pictures that no page can draw", kind=type(kind).__module__, why=[*wrong.values()])
    whole = {} if "" in wrong else {key: value for key, value in evidence.items() if key not in wrong}
    return {**whole, FAULTS: [*wrong.values()]}
