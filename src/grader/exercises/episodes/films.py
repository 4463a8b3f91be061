"""The film of judged episodes: what the learner's function did in the judge's own simulation, from the positions that
the evidence keeps."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from grader.exercises.episodes.judge import Outcome
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Record
from grader.exercises.film import Film, Panel, choose_rows
from grader.exercises.kind import JudgedTrial, Trial

FIGURES = 6
"""Figures of the positions that are kept: more than can be seen."""


class Run(BaseModel):
    """Some positions of an episode, as the evidence has them: at which times [s], and why it ended early."""

    episode: int = Field(ge=0)
    time_s: list[float] = Field(min_length=1)
    qpos: list[list[float]]
    ended: str = ""


class Kept(BaseModel):
    """The runs of one case, as the evidence has them."""

    case: str
    runs: list[Run] = Field(min_length=1)


def choose_episode(outcome: Outcome) -> int:
    """Returns the place of the first episode that did not succeed, else of the first."""
    return next((place for place, failed in enumerate(outcome.failed) if failed), 0)


def keep_film(visible: Sequence[JudgedTrial[Problem, Outcome]]) -> dict[str, Any]:
    """Returns `film`: the positions in the first visible case that failed, else in the first. Where some of its
    episodes failed, one of them and one that succeeded. Nothing where nothing was simulated."""
    wrong = [one for one in visible if any(one.judgement.outcome.failed)]
    for one in [*wrong, *visible][:1]:
        outcome = one.judgement.outcome
        chosen = choose_episode(outcome)
        others = [place for place, failed in enumerate(outcome.failed) if not failed and place != chosen][:1]
        places = [chosen, *(others if outcome.failed[chosen] else ())]
        runs = [keep_run(place, outcome.records[place]) for place in places if len(outcome.records[place].time_s)]
        if runs:
            about = "The judge's own simulation, with the controls of your script."
            return {"film": {"title": "Your run", "about": about, "case": one.trial.id, "runs": runs}}
    return {}


def keep_run(place: int, record: Record) -> dict[str, Any]:
    """Returns the positions of an episode, at as many times as a film has frames."""
    rows = choose_rows(len(record.time_s))
    rows = rows[np.isfinite(record.qpos[rows]).all(axis=1)]
    return {
        "episode": place,
        "time_s": [float(f"{time:.{FIGURES}g}") for time in record.time_s[rows].tolist()],
        "qpos": [[float(f"{value:.{FIGURES}g}") for value in row] for row in record.qpos[rows].tolist()],
        "ended": describe_end(record),
    }


def describe_end(record: Record) -> str:
    """Says why an episode ended before its time; empty where it did not."""
    at = f"at {record.time_s[-1]:.3g} s"
    if record.fault is not None:
        return f"{record.fault.what.partition(':')[0]} {at}"
    if record.lost_at_s is not None:
        return f"blew up {at}"
    return f"over {at}" if record.is_over else ""


def record_films(trials: Sequence[Trial[Problem]], evidence: Mapping[str, Any]) -> Sequence[Film]:
    """Returns the film of the runs that the evidence keeps; none where they are of another model."""
    try:
        kept = Kept.model_validate(evidence.get("film"))
    except ValidationError:
        return []
    problem = next((trial.problem for trial in trials if trial.id == kept.case), None)
    if problem is None or kept.runs[0].episode >= len(problem.episodes):
        return []
    scene = problem.episodes[kept.runs[0].episode].scene
    panels = [build_panel(kept.case, one, is_one_of_several=len(problem.episodes) > 1) for one in kept.runs]
    if any(panel.qpos.shape != (len(panel.times_s), scene.model.nq) for panel in panels):
        return []
    end_s = max(float(panel.times_s[-1]) for panel in panels)
    caption = "; ".join(f"{one.title}, {one.detail}: {one.ended or 'to its end'}" for one in panels) + "."
    return [Film("run", "Your run", caption, scene, end_s, tuple(panels))]


def build_panel(case: str, run: Run, *, is_one_of_several: bool) -> Panel:
    """Returns a run as a panel. Raises no error for rows of different lengths: their shape tells."""
    widths = {len(row) for row in run.qpos}
    qpos = np.array(run.qpos if len(widths) == 1 else [[]], dtype=np.float64)
    detail = f"episode {run.episode + 1}" if is_one_of_several else f"case {case}"
    return Panel("Your run", np.array(run.time_s), qpos, detail=detail, ended=run.ended)
