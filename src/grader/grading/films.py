"""Films of a stored verdict: the judge's runs once more, of what the reader may see of the verdict and no more."""

from collections.abc import Mapping
from typing import Any

from grader.exercises import Film, Kind, load_kinds, plan_exercise
from grader.library import Library
from grader.questions.kinds.script import ScriptQuestion


def record_films(
    library: Library, at: tuple[str, str], seed: int, verdict: Mapping[str, Any], timestep_s: float | None = None
) -> list[Film]:
    """Returns the films of a verdict on a script, as plain JSON redacted for its reader; none where there is nothing to
    show. `library` is the content that it was graded with, `at` names quiz and question, and `seed` drew the cases.
    With `timestep_s` only the runs at this timestep [s], where the reader may see them. Raises NotFound."""
    exercise = library.question(*at)
    if not isinstance(exercise, ScriptQuestion) or not verdict.get("evidence"):
        return []
    kind = load_kinds()[exercise.check.kind]
    if type(kind).record_films is Kind.record_films:  # nothing is drawn for it in the process of the pages
        return []
    plan = plan_exercise(exercise, library.model_xml, seed, library.text)
    failed = {finding["id"] for finding in verdict.get("findings") or () if not finding["passed"]}
    visible = [trial for trial in plan.trials if not trial.hidden]
    return [*kind.record_films(plan.parameters, visible, verdict["evidence"], failed, timestep_s=timestep_s)]
