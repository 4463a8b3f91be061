"""Tells which case a running script is at, by the names of the results that have arrived."""

import re
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any

from grader.domain.progress import TrialProgress
from grader.exercises.kind import Trial

Tell = Callable[[int, int, TrialProgress | None], object]
"""Called with the number of the case in progress, from 1, the number of cases, and how far a trial is that says so."""

OF_TRIAL = re.compile(r"t(\d{1,4})_")
"""The beginning of a result's name, see harness.py."""

WITHIN_TRIAL = re.compile(r"t(\d{1,4})_at_(\d{1,4})_of_(\d{1,4})_(episode|s)")
"""The name that a trial in progress tells, see playing.py."""


class Progress:
    """Follows one run of some trials: calls `tell` at its start, and whenever a visible case ends. The hidden cases are
    one step: a script that knows their numbers chooses when each ends, and could tell them so. The names are claims of
    the script's process, so the progress is for display only. It never goes back."""

    def __init__(self, trials: Sequence[Trial[Any]], tell: Tell) -> None:
        order = sorted(range(len(trials)), key=lambda index: trials[index].hidden)  # as the harness runs them
        cases = [list(group) for _, group in groupby(order, lambda index: trials[index].case)]
        self._ends = {group[-1]: number for number, group in enumerate(cases, 1) if not trials[group[-1]].hidden}
        self._cases, self._at, self._tell = len(cases), 1, tell
        self._case_of = {index: number for number, group in enumerate(cases, 1) for index in group}
        self._hidden = {index for index, trial in enumerate(trials) if trial.hidden}
        tell(1, self._cases, None)

    def follow(self, name: str) -> None:
        """A result of this name has arrived: the last trial of a case submits its own when it ends, and a trial that is
        played tells how far it is."""
        if within := WITHIN_TRIAL.fullmatch(name):
            self._follow_trial(int(within[1]), int(within[2]), int(within[3]), within[4])
            return
        match = OF_TRIAL.match(name)
        ended = self._ends.get(int(match[1]), 0) if match else 0
        if self._at <= ended < self._cases:
            self._at = ended + 1
            self._tell(self._at, self._cases, None)

    def _follow_trial(self, index: int, at: int, of: int, unit: str) -> None:
        """A trial of the case in progress is so far. Of a hidden one nothing is told, as above."""
        if self._case_of.get(index) == self._at and index not in self._hidden and at <= of:
            self._tell(self._at, self._cases, TrialProgress(at, of, "episode" if unit == "episode" else "s"))
