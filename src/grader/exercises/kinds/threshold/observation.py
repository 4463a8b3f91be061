"""What a script claims of one trial, beside what its trace says that it did."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from grader.exercises.explaining.script import NO_SCRIPT, ParsedScript
from grader.exercises.kinds.threshold.judging.judge import Bracket, Claim, judge_claim
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.search_trace import SearchRun, SearchTrace
from grader.exercises.trace import Trace
from grader.numerics.stability.horizon import warns_within

CLOSE = 1e-6
"""Relative difference below which two timesteps are the same."""


@dataclass(frozen=True)
class Observation:
    """One wrong claim, with what its trial did. `may_tell_numbers`: they are those of a visible trial.
    `simulates_others`: the script made runs under another integrator."""

    parameters: ThresholdParameters
    cell: Cell
    claim: Claim
    search: SearchTrace
    trace: Trace
    may_tell_numbers: bool
    simulates_others: bool = False
    script: ParsedScript = NO_SCRIPT

    def describe_timestep(self, seconds: float) -> str:
        """Where a timestep is, for the student; no number of a hidden trial."""
        return f"At {1e3 * seconds:.4g} ms" if self.may_tell_numbers else "At a timestep of a hidden case"

    def format_number(self, number: float) -> str:
        """A number of a run, for the student; of a hidden trial to two figures, which the runner lets through."""
        return f"{number:.4g}" if self.may_tell_numbers else f"{number:.2g}"

    @property
    def stable_runs(self) -> list[SearchRun]:
        """The runs at timesteps that the claim calls stable, the largest first."""
        runs = self.search.runs
        if isinstance(self.claim, Bracket):
            runs = tuple(run for run in runs if run.timestep_s <= self.claim.low * (1 + CLOSE))
        return sorted(runs, key=lambda run: -run.timestep_s)

    @property
    def unstable_runs(self) -> list[SearchRun]:
        """The runs at timesteps that the claim calls unstable, the smallest first."""
        if not isinstance(self.claim, Bracket):
            return []
        runs = (run for run in self.search.runs if run.timestep_s >= self.claim.high * (1 - CLOSE))
        return sorted(runs, key=lambda run: run.timestep_s)

    @property
    def runs_before_falls(self) -> list[SearchRun]:
        """The runs after which the search went on at a smaller timestep: it took them for unstable."""
        return [run for run, other in pairwise(self.search.runs) if other.timestep_s < run.timestep_s * (1 - CLOSE)]

    @cached_property
    def last_bracket(self) -> Bracket | None:
        """The largest stable and the smallest unstable timestep of the runs; None where not all runs are known."""
        runs = self.search.runs
        above = min((run.timestep_s for run in runs if run.warnings), default=0.0)
        below = max((run.timestep_s for run in runs if not run.warnings and run.timestep_s < above), default=0.0)
        return Bracket(below, above) if below and self.search.total <= len(runs) else None

    @cached_property
    def right_bracket(self) -> Bracket | None:
        """The bracket that the runs end with, where the judge accepts it: then the search is right, and what was
        returned is not what it found."""
        bracket = self.last_bracket
        return bracket if bracket and judge_claim(self.parameters, self.cell, bracket).passed else None

    @cached_property
    def runs_end_as_ours(self) -> bool:
        """Whether every run warned, or did not, as one of the given model does: then no difference in model or start
        explains the answer. False where not all runs are known."""
        horizon_s, code = self.parameters.horizon_s, self.cell.integrator.code
        return 0 < self.search.total <= len(self.search.runs) and all(
            bool(run.warnings) == warns_within(self.cell.scene, run.timestep_s, horizon_s, integrator=code)
            for run in self.search.runs
        )


Rule = Callable[[Observation], str | None]
