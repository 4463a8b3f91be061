"""What a script claims of one trial, beside what its trace says that it did."""

from collections.abc import Callable
from dataclasses import dataclass

from grader.exercises.kinds.threshold.judging.judge import Bracket, Claim
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.search_trace import Run, Search
from grader.exercises.trace import Trace

CLOSE = 1e-6
"""Relative difference below which two timesteps are the same."""


@dataclass(frozen=True)
class Observation:
    """One wrong claim, with what its trial did. `shown` numbers may be told: those of a visible trial."""

    parameters: ThresholdParameters
    cell: Cell
    claim: Claim
    search: Search
    trace: Trace
    may_tell_numbers: bool

    def describe_timestep(self, seconds: float) -> str:
        """Where a timestep is, for the student; no number of a hidden trial."""
        return f"At {1e3 * seconds:.4g} ms" if self.may_tell_numbers else "At a timestep of a hidden case"

    def format_number(self, number: float) -> str:
        """A number of a run, for the student; of a hidden trial to two figures, which the runner lets through."""
        return f"{number:.4g}" if self.may_tell_numbers else f"{number:.2g}"

    @property
    def stable_runs(self) -> list[Run]:
        """The runs at timesteps that the claim calls stable, the largest first."""
        runs = self.search.runs
        if isinstance(self.claim, Bracket):
            runs = tuple(run for run in runs if run.timestep_s <= self.claim.low * (1 + CLOSE))
        return sorted(runs, key=lambda run: -run.timestep_s)

    @property
    def unstable_runs(self) -> list[Run]:
        """The runs at timesteps that the claim calls unstable, the smallest first."""
        if not isinstance(self.claim, Bracket):
            return []
        found = (run for run in self.search.runs if run.timestep_s >= self.claim.high * (1 - CLOSE))
        return sorted(found, key=lambda run: run.timestep_s)


Rule = Callable[[Observation], str | None]
