"""Judges every trial of one run in the jail."""

import builtins
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grader.domain.run import RunReport
from grader.domain.verdict import Status
from grader.exercises.crashes import explain_error
from grader.exercises.driving.playing import Played
from grader.exercises.judgement import Judgement, Results
from grader.exercises.running.measuring import MeasuringFailure, Run, measure
from grader.exercises.running.planning import AnyKind, AnyTrial, Plan
from grader.exercises.trace import LINES_MAX, is_line
from grader.sandbox.cleaning import read_json

ENDED = "The script ended before this case."

RAISED_CHARS_MAX = 1000


class RaisedReader:
    """Reads what the script raised in the trials of one run. It is a claim of the script's process: only a line that
    the script has is told, and of hidden trials only what was claimed in the first one that raised, as each claim could
    tell a number of its trial."""

    def __init__(self, lines: int) -> None:
        self._lines = lines
        self._of_hidden: tuple[str, Any] | None = None

    def read(self, results: Results, trial: AnyTrial) -> Judgement[Any] | None:
        """Returns the judgement of a trial in which the script raised; None if it did not. Of a hidden trial the name
        of a built-in exception and a line are shown."""
        if "raised" not in results:
            return None
        try:
            crash = read_json(results["raised"].tobytes())
            what, line = str(crash["raised"])[:RAISED_CHARS_MAX], crash["line"]
        except (ValueError, KeyError, TypeError, RecursionError):
            what, line = "", None
        line = line if is_line(line) and line <= self._lines else None
        if trial.hidden:
            what = what if isinstance(vars(builtins).get(what), type) else ""
            self._of_hidden = self._of_hidden or (what, line)
            what, line = (what, line) if self._of_hidden == (what, line) else ("", None)
        place = "" if line is None else f", in line {line} of your script"
        return Judgement(False, f"{explain_error(what or 'An exception', place)}.", None)


def judge_trials(
    kind: AnyKind, plan: Plan, report: RunReport, run: Run, lines: int = LINES_MAX
) -> list[tuple[Judgement[Any], Status | None]]:
    """Returns the judgement on each trial of a script that returned; with a status if it ended before the kind could
    judge it. The script has so many `lines`. Raises JailFault."""
    raised = RaisedReader(lines)
    parts = {False: report.results, True: report.hidden_results}
    results = [select_results(parts[trial.hidden], index) for index, trial in enumerate(plan.trials)]
    records = report.talked.records if isinstance(report.talked, Played) else {}
    outcomes: list[tuple[Judgement[Any], Status | None]] = []
    for index, (trial, part) in enumerate(zip(plan.trials, results, strict=True)):
        claimed = raised.read(part, trial)
        if kind.plays:
            outcomes.append(judge_played(kind, plan, index, claimed, records))
        elif claimed is not None:
            outcomes.append((claimed, Status.CRASHED))
        else:
            outcomes.append(judge_trial(kind, plan, trial, part, run))
    return outcomes


def judge_trial(
    kind: AnyKind, plan: Plan, trial: AnyTrial, results: Results, run: Run
) -> tuple[Judgement[Any], Status | None]:
    """Returns the judgement on a trial; with a status if it ended before the kind could judge it."""
    if kind.measurement is not None:
        measured = measure(kind.measurement, trial, results, run)
        if isinstance(measured, MeasuringFailure):
            return Judgement(False, measured.why, None, measured.detail), measured.status
        results = measured
    judgement = require_judgement(kind.judge(plan.parameters, trial, results))
    return judgement, Status.CRASHED if judgement.crashed else None


def judge_played(
    kind: AnyKind, plan: Plan, index: int, raised: Judgement[Any] | None, records: Mapping[int, Any]
) -> tuple[Judgement[Any], Status | None]:
    """Returns the judgement on a trial of a kind that plays; with a status if it ended before it could be judged."""
    if index not in records:
        return raised or Judgement(False, ENDED, None), Status.CRASHED
    judgement = require_judgement(kind.judge(plan.parameters, plan.trials[index], records[index]))
    return judgement, Status.CRASHED if judgement.crashed else None


def require_judgement(judgement: Any) -> Judgement[Any]:
    """Returns what a kind's `judge` returned. Raises TypeError where that is no Judgement."""
    if not isinstance(judgement, Judgement):
        raise TypeError(f"judge must return a Judgement, not {judgement!r:.100}")
    return judgement


def select_results(results: Results, index: int) -> dict[str, NDArray[np.generic]]:
    """Returns the results of one trial under the driver's own names."""
    prefix = f"t{index}_"
    return {name.removeprefix(prefix): values for name, values in results.items() if name.startswith(prefix)}
