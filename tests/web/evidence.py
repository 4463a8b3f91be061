"""Real verdicts for the tests of pages: graded by our own pipeline from claims, without a jail."""

from functools import cache
from typing import Any

import numpy as np

from grader.domain.run import RunReport, RunStatus
from grader.exercises import judge_exercise, plan_exercise
from grader.questions.kinds.script import ScriptQuestion
from support.content import load_content

SPRING_MS = (22.05, 22.44)
"""Where a learner ends who forgets the damping."""

RIGHT_MS = {"Euler": (19.9, 20.1), "implicitfast": (24.9, 25.1), "discrete": None}


@cache
def threshold_verdict(kind: str) -> dict[str, Any]:
    """The verdict on a script that claims the spring's limit everywhere, or the right ones of the lesson's servo."""
    library = load_content()
    question = library.question("1.3-exercises", "servo-threshold")
    assert isinstance(question, ScriptQuestion)
    plan = plan_exercise(question, library.model_xml, 1)
    results: dict[bool, dict[str, Any]] = {False: {}, True: {}}
    for index, trial in enumerate(plan.trials):
        claim = SPRING_MS if kind == "spring" else RIGHT_MS[trial.id.rpartition(".")[2]]
        values = np.array([] if claim is None else [end / 1000 for end in claim])
        results[trial.hidden][f"t{index}_claim"] = values
    report = RunReport(RunStatus.RETURNED, results=results[False], hidden_results=results[True])
    verdict: dict[str, Any] = judge_exercise(question, plan, report).model_dump(mode="json")
    return verdict
