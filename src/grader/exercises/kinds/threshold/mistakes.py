"""Names the mistake behind wrong claims: what the runs show, else the wrong way that gives the claims."""

from collections.abc import Mapping, Sequence
from math import ceil, log2

import mujoco

from grader.exercises.kind import JudgedTrial, Trial
from grader.exercises.kinds.threshold.judging.judge import (
    Bracket,
    Claim,
    NoLimit,
)
from grader.exercises.kinds.threshold.limits import find_span
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.range_mistakes import explain_coarse_search, explain_untried_ends
from grader.exercises.kinds.threshold.search import (
    CERTAIN_RULES,
    FALLBACK_RULES,
    NO_STEP_RULES,
    explain_searches,
)
from grader.exercises.kinds.threshold.search_trace import read_search
from grader.exercises.kinds.threshold.wrong_methods import FORMULAS, METHODS, ClaimContext, WrongMethod, read_servo
from grader.exercises.trace import Trace

SAME_EVERYWHERE = (
    "The function gave the same answer for every model, although their limits differ. Measure the model you were given."
)

CACHED_RESULTS = (
    "The function gave the same answer for every model, although their limits differ: in later calls it simulated "
    "nothing, and returned what an earlier call had found. Keep no results between calls, or keep them by model too."
)

SPARE_RUNS = 3
"""Simulations that a bisection may make beyond the fewest: looks at both ends, and one halving more."""

FOUND_EARLIER = (
    "Your answer holds a timestep that only an earlier call found unstable: in this call it, or a larger one, raised "
    "no warning. A list or dictionary outside of the function keeps what it found: make it new in every call."
)

IMPLICIT = frozenset({"implicit", "implicitfast"})
"""Integrators under which a servo's damping raises the limit of its spring."""


def name_the_mistake(parameters: ThresholdParameters, judged: Sequence[JudgedTrial[Cell, Claim]]) -> str | None:
    """Returns the sentence of the first method that explains every wrong claim, or None."""
    if is_same_for_all_models(judged):
        return CACHED_RESULTS if has_cached_results(judged) else SAME_EVERYWHERE
    first = {trial.problem.integrator: trial.problem for trial in reversed(judged)}
    claims = [
        (ClaimContext(parameters, trial.problem, first[trial.problem.integrator]), trial.judgement.outcome, trial)
        for trial in judged
    ]
    wrong = [claim for claim in claims if not claim[2].judgement.passed]
    seen = [trial for _, _, trial in wrong]
    if repeats_earlier_find(judged, seen):
        return FOUND_EARLIER

    def find_method(methods: Sequence[WrongMethod]) -> str | None:
        for method in methods:
            if method.of_numbers and not any(isinstance(claim, Bracket) for _, claim, _ in wrong):
                continue
            explained = claims if method.all_claims else wrong
            if wrong and all(method.matches(context, claim) for context, claim, _ in explained):
                return method.sentence.format(**list_particulars(parameters, judged))
        return None

    return (
        explain_searches(parameters, seen, CERTAIN_RULES, judged)
        or find_method(FORMULAS if not any(simulates_anything(trial) for trial in judged) else ())
        or explain_searches(parameters, seen, NO_STEP_RULES, judged)
        or find_method(METHODS)
        or explain_searches(parameters, seen, FALLBACK_RULES, judged)
        or explain_lucky_search(parameters, judged)
    )


def simulates_anything(judged: JudgedTrial[Cell, Claim]) -> bool:
    """Whether a trial made a step, or may have made one: by other functions, or without a readable trace."""
    search = read_search(judged.trace)
    return search is None or bool(search.total or search.other_functions)


def explain_lucky_search(parameters: ThresholdParameters, judged: Sequence[JudgedTrial[Cell, Claim]]) -> str | None:
    """Returns the sentence of too coarse a search, or of an end that was never run, where the visible answers are right
    all the same, by luck."""
    visible = [trial for trial in judged if not trial.hidden and not isinstance(trial.judgement.outcome, NoLimit)]
    return (
        explain_searches(parameters, visible, (explain_coarse_search, explain_untried_ends))
        if all(trial.judgement.passed for trial in visible)
        else None
    )


def describe_right_search(parameters: ThresholdParameters, visible: Sequence[Trace]) -> str:
    """Returns a sentence on how many simulations the visible searches of a right script took; empty if unknown."""
    totals = [search.total for trace in visible if (search := read_search(trace)) is not None and search.total]
    if not totals:
        return ""
    shortest_s, longest_s = parameters.search_s
    needed = 1 + ceil(log2((longest_s - shortest_s) / parameters.width_s))
    most = max(totals)
    if most <= needed + SPARE_RUNS:
        return f"You made at most {most} simulations a search, as few as a bisection needs."
    return f"You made up to {most} simulations a search; a bisection to {1e3 * parameters.width_s:g} ms needs {needed}."


def is_same_for_all_models(judged: Sequence[JudgedTrial[Cell, Claim]]) -> bool:
    """Whether the claims ignore the model: the same numbers for all models, right for some and wrong for others."""
    by_case: dict[str, dict[str, Claim]] = {}
    for trial in judged:
        by_case.setdefault(trial.problem.case, {})[trial.problem.integrator.name] = trial.judgement.outcome
    answers = list(by_case.values())
    passed = {trial.judgement.passed for trial in judged if isinstance(trial.judgement.outcome, Bracket)}
    return len(answers) > 1 and passed == {True, False} and all(answer == answers[0] for answer in answers)


def has_cached_results(judged: Sequence[JudgedTrial[Cell, Claim]]) -> bool:
    """Whether the first case was simulated, and no other one."""
    first, *others = dict.fromkeys(trial.problem.case for trial in judged)
    searches = [(trial.problem.case, read_search(trial.trace)) for trial in judged]
    if any(search is None or search.other_functions for _, search in searches):
        return False
    return {case for case, search in searches if search and search.total} == {first} and bool(others)


def repeats_earlier_find(judged: Sequence[JudgedTrial[Cell, Claim]], wrong: Sequence[JudgedTrial[Cell, Claim]]) -> bool:
    """Whether each wrong claim of the visible trials calls a timestep unstable that only an earlier call found so. In
    the call itself that timestep, or a larger one, raised no warning."""
    visible = [trial for trial in wrong if not trial.hidden]
    unstable: set[float] = set()
    explained = 0
    for trial in judged:
        search, claim = read_search(trial.trace), trial.judgement.outcome
        if search is None:
            return False
        if trial in visible and isinstance(claim, Bracket) and claim.high in unstable:
            explained += any(run.timestep_s >= claim.high and not run.warnings for run in search.runs)
        unstable |= {run.timestep_s for run in search.runs if run.warnings}
    return bool(visible) and explained == len(visible)


def list_particulars(parameters: ThresholdParameters, judged: Sequence[JudgedTrial[Cell, Claim]]) -> dict[str, str]:
    """Returns what a sentence may say: the exercise's public numbers, and those of its first visible model."""
    visible = next((read_servo(trial.problem) for trial in judged if not trial.hidden), None)
    wrong = {trial.problem.integrator.name for trial in judged if not trial.judgement.passed}
    moves = "lowers Euler's" if "Euler" in wrong or not wrong & IMPLICIT else f"raises {min(wrong & IMPLICIT)}'s"
    shift = (
        f": the servo's own damping {moves} limit by kv/kp = {1000 * visible.kv / visible.kp:.3g} ms" if visible else ""
    )
    model = judged[0].trial.problem.scene.model
    start = ", ".join(f"{joint} at {value:g} {find_unit(model, joint)}" for joint, value in parameters.start.items())
    return {
        "shift": shift,
        "start": start,
        "width": f"{1000 * parameters.width_s:g}",
        "longest": f"{1000 * parameters.search_s[1]:g}",
        "horizon": f"{parameters.horizon_s:g}",
    }


def find_unit(model: mujoco.MjModel, joint: str) -> str:
    """Returns the unit of a joint's coordinate."""
    return "m" if int(model.joint(joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE) else "rad"


def write_lazy_scripts(entry: str, parameters: ThresholdParameters, trials: Sequence[Trial[Cell]]) -> Mapping[str, str]:
    """Returns lazy scripts: for every model they give None, or the right answers of the first visible case."""
    scripts = {"None for every model": f"def {entry}(model, integrator):\n    return None\n"}
    visible = next((trial.problem.case for trial in trials if not trial.hidden), None)
    answers: dict[int, tuple[float, float] | None] = {}
    for cell in (trial.problem for trial in trials if trial.problem.case == visible):
        span = find_span(cell.scene, cell.integrator.code, parameters.search_s, parameters.horizon_s)
        answers[cell.integrator.code] = (
            None if span is None else (span[0] - parameters.width_s / 2, span[0] + parameters.width_s / 2)
        )
    if any(answers.values()):
        text = f"def {entry}(model, integrator):\n    return {answers!r}[integrator]\n"
        scripts["the visible model's limits for every model"] = text
    return scripts
