"""Tells which case a running script is at, by the names of the results that have arrived."""

import re
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any

from grader.exercises.kind import Trial

Tell = Callable[[int, int], object]
"""Called with the number of the case in progress, from 1, and the number of cases."""

OF_TRIAL = re.compile(r"t(\d{1,4})_")
"""The beginning of a result's name, see harness.py."""


class Progress:
    """Follows one run of some trials: calls `tell` at its start, and whenever a visible case ends. The hidden cases are
    one step: a script that knows their numbers chooses when each ends, and could tell them so. The names are claims of
    the script's process, so the progress is for display only. It never goes back."""

    def __init__(self, trials: Sequence[Trial[Any]], tell: Tell) -> None:
        order = sorted(range(len(trials)), key=lambda index: trials[index].hidden)  # as the harness runs them
        cases = [list(group) for _, group in groupby(order, lambda index: trials[index].case)]
        self._ends = {group[-1]: number for number, group in enumerate(cases, 1) if not trials[group[-1]].hidden}
        self._cases, self._at, self._tell = len(cases), 1, tell
        tell(1, self._cases)

    def follow(self, name: str) -> None:
        """A result of this name has arrived: the last trial of a case submits its own when it ends."""
        found = OF_TRIAL.match(name)
        ended = self._ends.get(int(found[1]), 0) if found else 0
        if self._at <= ended < self._cases:
            self._at = ended + 1
            self._tell(self._at, self._cases)
