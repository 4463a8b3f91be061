"""What the episodes of a verdict achieved, goal by goal, beside what must be."""

from collections.abc import Iterator, Mapping
from math import ceil, inf
from typing import Any

from grader.domain.axes import ClassAxis, Placed, list_findings, place_number, read_number, read_passed, read_title
from grader.exercises.episodes.judge import name_parts
from grader.exercises.episodes.parameters import EpisodesCase, EpisodesParameters, Goal

UNITS = {"settling": "s", "energy": "J"}
ON_LOG = ("rms", "error", "effort", "energy", "chatter")
"""Goals whose measures differ by factors."""
OUT_OF_RANGE = "excess"
UNFINISHED, UNSETTLED = "did not finish", "never settled"
"""What has no number: an episode that blew up, raised or ended early, and one that reached its end."""


def place_episodes(parameters: EpisodesParameters, verdict: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields an axis for each goal of a case of one episode, and one for the share of a case of several."""
    findings = dict(list_findings(verdict))
    for case in parameters.cases:
        if case.hidden:
            continue
        if case.episodes > 1:
            yield from place_share(case, findings.get(case.id, {}))
            continue
        for goal, part in zip(parameters.goals, name_parts(parameters.goals), strict=True):
            id_ = f"{case.id}.{part}"
            finding = findings.get(id_)
            if finding is not None:
                position = place_number(read_number(finding.get("measured")), read_passed(finding))
                yield build_axis(goal, goal.sensor or parameters.track, id_, read_title(finding, id_)), position


def place_share(case: EpisodesCase, finding: Mapping[str, Any]) -> Iterator[Placed]:
    """Yields in how many episodes every goal was reached."""
    share = read_number(finding.get("measured"))
    if share is not None:
        needed = ceil(case.share * case.episodes - 1e-9)
        title = f"{read_title(finding, case.id)}: episodes in which every goal is reached"
        line = f"{needed} of {case.episodes} episodes"
        axis = ClassAxis(case.id, title, "episodes", (needed, inf), line=line, is_whole=True)
        yield axis, place_number(float(round(share * case.episodes)), read_passed(finding))


def build_axis(goal: Goal, sensor: str, id_: str, title: str) -> ClassAxis:
    """Returns the axis of a goal. What does not reach its end has no number."""
    if goal.within is not None:
        title = f"{title}, {sensor} from {goal.within.low:g} to {goal.within.high:g}"
    if goal.min is not None:
        right = (goal.min, inf)
    else:
        right = (0.0 if goal.goal in ON_LOG else -inf, 0.0 if goal.max is None else goal.max)
    return ClassAxis(
        id_, title, UNITS.get(goal.goal, ""), right, measure="" if goal.within is None else OUT_OF_RANGE,
        none=UNSETTLED if goal.goal == "settling" else UNFINISHED, is_log=goal.goal in ON_LOG
    )  # fmt: skip
