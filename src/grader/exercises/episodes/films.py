"""The film of judged episodes: what the learner's function did in the judge's own simulation, from the positions that
the evidence keeps."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from grader.exercises.episodes.judge import EpisodeOutcome
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import Record
from grader.exercises.film import Film, Panel, choose_rows
from grader.exercises.kind import JudgedTrial, Trial

FILMS_MAX = 4
"""Cases with a film."""
FIGURES = 6
"""Figures of the positions that are kept: more than can be seen."""


class RecordedRun(BaseModel):
    """Some positions of an episode, as the evidence has them: at which times [s], and why it ended early."""

    episode: int = Field(ge=0)
    time_s: list[float] = Field(min_length=1)
    qpos: list[list[float]]
    ended: str = ""


class CaseRuns(BaseModel):
    """The runs of one case, as the evidence has them."""

    case: str
    runs: list[RecordedRun] = Field(min_length=1)


class Films(BaseModel):
    """The cases with a film, as the evidence has them."""

    cases: list[CaseRuns]


def choose_episode(outcome: EpisodeOutcome) -> int:
    """Returns the place of the first episode that did not succeed, else of the first."""
    return next((place for place, failed in enumerate(outcome.failed) if failed), 0)


def keep_film(visible: Sequence[JudgedTrial[Problem, EpisodeOutcome]]) -> dict[str, Any]:
    """Returns `film`: the positions in the visible cases, those that failed first. Where some episodes of a
    case failed, one of them and one that succeeded. Nothing where nothing was simulated."""
    ordered = sorted(visible, key=lambda trial: not any(trial.judgement.outcome.failed))
    cases = [{"case": trial.id, "runs": keep_runs(trial.judgement.outcome)} for trial in ordered[:FILMS_MAX]]
    with_runs = [case for case in cases if case["runs"]]
    about = "The judge's own simulation, with the controls that yours gave."
    return {"film": {"title": "Your run", "about": about, "cases": with_runs}} if with_runs else {}


def keep_runs(outcome: EpisodeOutcome) -> list[dict[str, Any]]:
    """Returns the episode that is shown of a case; where it failed, beside the first that succeeded."""
    chosen = choose_episode(outcome)
    others = [place for place, failed in enumerate(outcome.failed) if not failed and place != chosen][:1]
    places = [index for index in (chosen, *others) if len(outcome.records[index].time_s)]
    return [keep_run(index, outcome.records[index]) for index in (places if outcome.failed[chosen] else places[:1])]


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
    return f"ends {at}" if record.is_over else ""


def record_films(trials: Sequence[Trial[Problem]], evidence: Mapping[str, Any]) -> Sequence[Film]:
    """Returns a film for each case that the evidence keeps; none of another model."""
    try:
        cases = Films.model_validate(evidence.get("film")).cases
    except ValidationError:
        return []
    problems = {trial.id: trial.problem for trial in trials}
    films = [build_film(problems[case.case], case) for case in cases if case.case in problems]
    return [film for film in films if film is not None]


def build_film(problem: Problem, case_runs: CaseRuns) -> Film | None:
    """Returns the film of a case; None where its runs are of another model."""
    if case_runs.runs[0].episode >= len(problem.episodes):
        return None
    scene, several = problem.episodes[case_runs.runs[0].episode].scene, len(problem.episodes) > 1
    panels = tuple(build_panel(run, is_one_of_several=several) for run in case_runs.runs)
    if any(panel.qpos.shape != (len(panel.times_s), scene.model.nq) for panel in panels):
        return None
    title = problem.case.title or f"case {case_runs.case}"
    title = title[0].upper() + title[1:]
    ends = [f"{panel.title} {panel.ended}" for panel in panels if panel.ended]
    end_s = max(float(panel.times_s[-1]) for panel in panels)
    return Film(case_runs.case, title, f"{title}: {'; '.join(ends) or 'simulated to its end'}.", scene, end_s, panels)


def build_panel(run: RecordedRun, *, is_one_of_several: bool) -> Panel:
    """Returns a run as a panel. Raises no error for rows of different lengths: their shape tells."""
    widths = {len(row) for row in run.qpos}
    qpos = np.array(run.qpos if len(widths) == 1 else [[]], dtype=np.float64)
    title = f"Episode {run.episode + 1}" if is_one_of_several else "Your run"
    return Panel(title, np.array(run.time_s), qpos, ended=run.ended)
