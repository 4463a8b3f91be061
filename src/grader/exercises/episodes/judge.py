"""Judges the records of a case: each goal of a single episode, or the share of episodes that reach all goals."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from grader.exercises.episodes.goals import FAILED, FAILED_SENSOR, TITLES, bound_success, measure_goal, meets
from grader.exercises.episodes.parameters import EpisodesParameters, Goal, Problem
from grader.exercises.episodes.simulating import Record, describe_fault, list_constant_laws, simulate_law
from grader.exercises.judgement import Judgement, Part
from grader.numerics.shares import bound_share

LOST = "The simulation blew up: MuJoCo warned, and the run ended there."

OVER = "The episode ended before its time, by the rule of the exercise."

UNMET = "Counts only where the target is reached."

EPISODES_OF_LUCK = 5

REACHING = ("rms", "error", "settling", "return")
"""Goals that take a controller."""


@dataclass(frozen=True)
class EpisodeOutcome:
    """The records of a case, and the goals that each did not reach."""

    records: Sequence[Record]
    failed: Sequence[frozenset[int]]

    def list_failed(self) -> list[Record]:
        """Returns the records of the episodes that reached not every goal, without those that raised."""
        return [
            record
            for record, failed in zip(self.records, self.failed, strict=True)
            if failed and record.fault is None and len(record.time_s)
        ]


def judge_records(
    parameters: EpisodesParameters, problem: Problem, records: Sequence[Record], *, hidden: bool
) -> Judgement[EpisodeOutcome]:
    """Returns the judgement on a case. An exception loses its own episode alone."""
    measured = [[measure_goal(goal, record) for goal in parameters.goals] for record in records]
    failed = [find_failed(parameters.goals, values) for values in measured]
    outcome = EpisodeOutcome(records, failed)
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
    passed, title = not failed, goal.title or name_goal(goal)
    message = "Reached." if passed else UNMET if meets(goal, value) else describe_failure(goal)
    if record.lost_at_s is not None:
        message = LOST
    elif record.is_over and not isfinite(value):
        message = OVER
    allowed = (0.0 if goal.max is None else goal.max) if goal.min is None else goal.min
    if isfinite(value):
        limit = f"at most {allowed:.4g} is allowed" if goal.min is None else f"at least {allowed:.4g} is needed"
        detail = f"Measured {value:.4g}; {limit}."
    else:
        detail = "" if record.lost_at_s is None else f"It blew up at t = {record.lost_at_s:.4g} s."
    if goal.within is not None:
        since = f"From {goal.from_s:g} s on it" if goal.from_s else "It"
        range_ = f"[{goal.within.low:g}, {goal.within.high:g}]"
        detail = f"{since} leaves {range_} by {value:.4g}." if 0 < value < float("inf") else ""
    measured = float(f"{value:.6g}") if isfinite(value) else None
    expected = list(goal.within) if goal.within is not None else allowed
    return Part(id_, title, passed, message, detail, measured, expected, goal.points)


def name_goal(goal: Goal) -> str:
    """Returns what a goal without a title is called, with its own sensor where it has one."""
    return f"{TITLES[goal.goal]} of {goal.sensor}" if goal.sensor else TITLES[goal.goal]


def describe_failure(goal: Goal) -> str:
    """Returns what is wrong where a goal is not reached, with its own sensor where it has one."""
    return FAILED[goal.goal] if goal.sensor is None else FAILED_SENSOR[goal.goal].format(goal.sensor)


def judge_share(
    parameters: EpisodesParameters, problem: Problem, outcome: EpisodeOutcome, *, hidden: bool
) -> Judgement[EpisodeOutcome]:
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


def explain_most(parameters: EpisodesParameters, outcome: EpisodeOutcome, *, hidden: bool) -> str:
    """Returns what went wrong in most of the episodes that did not succeed."""
    wrong = [record for record, failed in zip(outcome.records, outcome.failed, strict=True) if failed]
    faults = [record.fault for record in wrong if record.fault is not None]
    if 2 * len(faults) >= len(wrong):
        return f"{describe_fault(faults[0], hidden=hidden, several=True)}."
    if 2 * sum(record.lost_at_s is not None for record in wrong) >= len(wrong):
        return LOST
    if 2 * sum(record.is_over for record in wrong) > len(wrong):
        return OVER
    counts = Counter(goal for failed in outcome.failed for goal in failed)
    return describe_failure(parameters.goals[counts.most_common(1)[0][0]])


def bound_luck(parameters: EpisodesParameters, problem: Problem) -> float:
    """Returns a bound of the chance that a law which looks at nothing succeeds in the share of episodes that must: 0 if
    none succeeds in any of those that are simulated."""
    most, episodes = 0.0, len(problem.episodes)
    simulated = min(EPISODES_OF_LUCK, episodes)
    for _, law in list_constant_laws(problem, has_target=parameters.has_target):
        records = [simulate_law(parameters, problem, index, law, problem.periods) for index in range(simulated)]
        passed = sum(all(meets(goal, measure_goal(goal, record)) for goal in parameters.goals) for record in records)
        if passed:
            most = max(most, bound_success(passed, simulated, episodes, problem.case.share))
    return most
