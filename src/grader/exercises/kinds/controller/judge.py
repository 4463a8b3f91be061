"""Judges the records of a case: each goal of a single episode, or the share of episodes that reach all goals."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from grader.exercises.judgement import Judgement, Part
from grader.exercises.kinds.controller.goals import FAILED, TITLES, bound_share, measure_goal, meets
from grader.exercises.kinds.controller.parameters import ControllerParameters, Goal, Problem
from grader.exercises.kinds.controller.simulating import Record, describe_fault

LOST = "The simulation blew up: MuJoCo warned, and the run ended there."

UNMET = "Counts only where the target is reached."

REACHING = ("rms", "error", "settling")
"""Goals that take a controller."""


@dataclass(frozen=True)
class Outcome:
    """The records of a case, and the goals that each did not reach."""

    records: Sequence[Record]
    failed: Sequence[frozenset[int]]


def judge_records(
    parameters: ControllerParameters, problem: Problem, records: Sequence[Record], *, hidden: bool
) -> Judgement[Outcome]:
    """Returns the judgement on a case. An exception loses its own episode alone."""
    measured = [[measure_goal(goal, record) for goal in parameters.goals] for record in records]
    failed = [find_failed(parameters.goals, values) for values in measured]
    outcome = Outcome(records, failed)
    faults = [record.fault for record in records if record.fault is not None]
    several = len(records) > 1
    if faults and len(faults) == len(records):
        message = f"{describe_fault(faults[0], hidden=hidden, several=several)}."
        return Judgement(False, message, outcome, crashed=True)
    if several:
        return judge_share(parameters, problem, outcome, hidden=hidden)
    (record,), (values,) = records, measured
    ids = name_parts(parameters.goals)
    parts = tuple(
        judge_goal(goal, id_, value, record, failed=i in failed[0])
        for i, (goal, id_, value) in enumerate(zip(parameters.goals, ids, values, strict=True))
    )
    wrong = sorted(
        (goal.goal not in REACHING, i) for i, goal in enumerate(parameters.goals) if not meets(goal, values[i])
    )
    first = parts[wrong[0][1]].message if wrong else "Every goal is reached."
    return Judgement(not failed[0], first, outcome, parts=parts)


def name_parts(goals: Sequence[Goal]) -> list[str]:
    """Returns an id for each goal: its name, with a number where it is there twice."""
    names = [goal.goal for goal in goals]
    return [f"{name}{names[: i + 1].count(name)}" if names.count(name) > 1 else name for i, name in enumerate(names)]


def find_failed(goals: Sequence[Goal], values: Sequence[float]) -> frozenset[int]:
    """Returns the places of the goals that were not reached. What a controller that does nothing reaches too, such as
    little effort, counts only where one of the goals of REACHING is reached, if there are any."""
    failed = frozenset(i for i, goal in enumerate(goals) if not meets(goal, values[i]))
    reaching = {i for i, goal in enumerate(goals) if goal.goal in REACHING}
    return frozenset(range(len(goals))) if reaching and reaching <= failed else failed


def judge_goal(goal: Goal, id_: str, value: float, record: Record, *, failed: bool) -> Part:
    """Returns the finding of one goal."""
    passed, title = not failed, goal.title or TITLES[goal.goal]
    message = "Reached." if passed else UNMET if meets(goal, value) else FAILED[goal.goal]
    if record.lost_at_s is not None:
        message = LOST
    allowed = 0.0 if goal.max is None else goal.max
    if isfinite(value):
        detail = f"Measured {value:.4g}; at most {allowed:.4g} is allowed."
    else:
        detail = "" if record.lost_at_s is None else f"It blew up at t = {record.lost_at_s:.4g} s."
    if goal.within is not None:
        detail = (
            f"It leaves [{goal.within.low:g}, {goal.within.high:g}] by {value:.4g}." if 0 < value < float("inf") else ""
        )
    measured = float(f"{value:.6g}") if isfinite(value) else None
    expected = list(goal.within) if goal.within is not None else allowed
    return Part(id_, title, passed, message, detail, measured, expected, goal.points)


def judge_share(
    parameters: ControllerParameters, problem: Problem, outcome: Outcome, *, hidden: bool
) -> Judgement[Outcome]:
    """Returns the judgement on several episodes."""
    n = len(outcome.records)
    successes = sum(not failed for failed in outcome.failed)
    low, high = bound_share(successes, n)
    passed = successes >= problem.case.share * n - 1e-9
    detail = f"{successes} of {n} episodes reach every goal (95 % interval: {100 * low:.0f} to {100 * high:.0f} %); "
    detail += f"{100 * problem.case.share:g} % must."
    if passed:
        message = "Enough episodes reach every goal."
    else:
        message = f"Too few episodes reach every goal. {explain_most(parameters, outcome, hidden=hidden)}"
    return Judgement(passed, message, outcome, detail, measured=successes / n, expected=problem.case.share)


def explain_most(parameters: ControllerParameters, outcome: Outcome, *, hidden: bool) -> str:
    """Returns what went wrong in most of the episodes that did not succeed."""
    wrong = [record for record, failed in zip(outcome.records, outcome.failed, strict=True) if failed]
    faults = [record.fault for record in wrong if record.fault is not None]
    if 2 * len(faults) >= len(wrong):
        return f"{describe_fault(faults[0], hidden=hidden, several=True)}."
    if 2 * sum(record.lost_at_s is not None for record in wrong) >= len(wrong):
        return LOST
    counts = Counter(goal for failed in outcome.failed for goal in failed)
    return FAILED[parameters.goals[counts.most_common(1)[0][0]].goal]
