"""Pictures of judged episodes: the tracked sensor with its target, and the controls."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from grader.exercises.episodes.films import choose_episode, keep_film
from grader.exercises.episodes.goals import measure_goal, meets
from grader.exercises.episodes.judge import EpisodeOutcome
from grader.exercises.episodes.parameters import EpisodesParameters, Goal, Problem
from grader.exercises.episodes.simulating import Floats, Record
from grader.exercises.kind import JudgedTrial

POINTS_MAX = 300
CONTROLS_MAX = 4


def build_evidence(
    parameters: EpisodesParameters, visible: Sequence[JudgedTrial[Problem, EpisodeOutcome]]
) -> dict[str, Any]:
    """Returns charts for each visible case: of its first episode that did not succeed, else of its first. They show
    what the learner's own controller did, so that they are feedback and no solution. The `film` shows it moving."""
    charts = []
    for trial in visible:
        outcome = trial.judgement.outcome
        at = choose_episode(outcome)
        if len(outcome.records[at].time_s):
            title = f", episode {at + 1}" if len(outcome.records) > 1 else ""
            charts += draw_record(parameters, trial.id, outcome.records[at], title)
    return {"motions": charts} | keep_film(visible)


def draw_record(parameters: EpisodesParameters, case: str, record: Record, title: str) -> list[dict[str, Any]]:
    """Returns the charts of one episode: of the tracked sensor, of others that fail a goal, and of the controls."""
    every = max(1, -(-len(record.time_s) // POINTS_MAX))
    time = {"label": "time [s]", "log": False}

    def line(label: str, values: Floats) -> dict[str, Any]:
        return {
            "label": label,
            "x": round_all(record.time_s[::every]),
            "y": round_all(values[::every]),
            "points": False,
        }

    tracked = [line(parameters.track, record.tracked), line("target", record.target)]
    missed = list_missed(parameters, record)
    others = [name for name in record.sensors if name in missed and name != parameters.track]
    controls = [
        line("control" if record.applied.shape[1] == 1 else f"control {i}", record.applied[:, i])
        for i in range(min(record.applied.shape[1], CONTROLS_MAX))
    ]
    return [
        {
            "case": case, "title": f"{parameters.track} and target{title}", "x": time,
            "y": {"label": parameters.track, "log": False}, "series": tracked,
            "marks": build_limits(missed.get(parameters.track, ())),
        },
        *(
            {
                "case": case, "title": f"{name}{title}", "x": time, "y": {"label": name, "log": False},
                "series": [line(name, record.sensors[name])], "marks": build_limits(missed[name]),
            }
            for name in others
        ),
        {
            "case": case, "title": f"controls{title}", "x": time, "y": {"label": "control", "log": False},
            "series": controls, "marks": [],
        },
    ]  # fmt: skip


def list_missed(parameters: EpisodesParameters, record: Record) -> dict[str, list[Goal]]:
    """Returns the goals that an episode did not reach, by the sensor that they are about."""
    missed = dict[str, list[Goal]]()
    for goal in parameters.goals:
        if not meets(goal, measure_goal(goal, record)):
            missed.setdefault(goal.sensor or parameters.track, []).append(goal)
    return missed


def build_limits(goals: Sequence[Goal]) -> list[dict[str, Any]]:
    """Returns marks at the ends of the ranges within which a sensor must stay."""
    ranges = [(goal.within, f" from {goal.from_s:g} s" if goal.from_s else "") for goal in goals if goal.within]
    return [{"y": end, "label": f"limit {end:g}{since}"} for within, since in ranges for end in within]


def round_all(values: Floats) -> list[float]:
    """Returns numbers of five figures; one that is not finite, or beyond a picture, is left at its limit."""
    return [float(f"{value:.5g}") for value in np.nan_to_num(np.clip(values, -1e9, 1e9)).tolist()]
