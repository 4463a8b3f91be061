"""Films of judged claims: the judge's runs at the ends of the claimed brackets side by side, and around the limits
where the solution is shown."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ValidationError

from grader.domain.pages.pictures import build_reader
from grader.exercises.film import Film, Panel, choose_rows
from grader.exercises.kind import Trial
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.numerics.rollout import Rollout, simulate

ROWS_MAX = 2000
"""Most states that are kept of a run before its frames are chosen."""

AFTERWARDS = 1.6
"""How long a film goes on after the last run that ended early, in times of that run."""

SHORTEST_S = 0.2
"""The least length of a film [s]."""

BELOW, ABOVE = 0.99, 1.01
"""What is just below and just above a limit."""

Read = TypeVar("Read")


class ClaimRecord(BaseModel):
    """A claim as the evidence has it [ms]."""

    case: str
    claim_ms: tuple[float, float] | None
    said_none: bool


class TrialLimits(BaseModel):
    """The limits of a trial as the evidence has them [ms]."""

    case: str
    linear_ms: float | None
    within_ms: float | None


class Take(NamedTuple):
    """One run of a film: a trial at a timestep [s], and what this timestep is."""

    trial: Trial[Cell]
    timestep_s: float
    what: str


def record_films(
    parameters: ThresholdParameters, trials: Sequence[Trial[Cell]], evidence: Mapping[str, Any],
    failed: Collection[str],
) -> Iterator[Film]:  # fmt: skip
    """Yields the films of the first case with a failed trial, else of the first: at both ends of the claims, that which
    refutes one first, and, where the evidence has the limits, around these."""
    by_id = {trial.id: trial for trial in trials}
    shown = choose_case(by_id, evidence, failed)
    if not shown:
        return
    brackets = any(claim.claim_ms for claim in shown)
    ends = list[tuple[bool, Film]]()
    for end, name in enumerate(("lower end", "upper end") if brackets else ("longest timestep",)):
        takes = [take for claim in shown for take in take_claim(parameters, by_id[claim.case], claim, end)]
        title = f"At the {name} of {'your bracket' if brackets else 'the search'}"
        for film in shoot(parameters, name.replace(" ", "-"), title, takes):
            agrees = all(
                bool(panel.ended) == bool(end)
                for panel, take in zip(film.panels, takes, strict=True) if not take.what
            )  # fmt: skip
            ends.append((agrees, film))
    yield from (film for _, film in sorted(ends, key=lambda pair: pair[0]))
    limits = read_limits(evidence)
    known = [(by_id[claim.case], limits[claim.case]) for claim in shown if claim.case in limits]
    for name, is_above in (("below", False), ("above", True)):
        takes = [take_limit(parameters, trial, limit, is_above=is_above) for trial, limit in known]
        yield from shoot(parameters, name, f"Just {name} the limits", takes)


def record_timestep(
    parameters: ThresholdParameters, trials: Sequence[Trial[Cell]], evidence: Mapping[str, Any],
    failed: Collection[str], timestep_s: float,
) -> Iterator[Film]:  # fmt: skip
    """Yields the film of the same case at a timestep within the search, where the evidence has the limits."""
    by_id, limits = {trial.id: trial for trial in trials}, read_limits(evidence)
    shown = [claim for claim in choose_case(by_id, evidence, failed) if claim.case in limits]
    shortest, longest = parameters.search_s
    if shortest <= timestep_s <= longest:
        takes = [Take(by_id[claim.case], timestep_s, "") for claim in shown]
        yield from shoot(parameters, "chosen", f"At {1000 * timestep_s:.4g} ms", takes)


def choose_case(by_id: Collection[str], evidence: Mapping[str, Any], failed: Collection[str]) -> Sequence[ClaimRecord]:
    """Returns the claims of the first case with a failed trial, else of the first; none without claims."""
    claims = [claim for claim in read(evidence.get("claims"), ClaimRecord) if claim.case in by_id]
    cases = [list(some) for _, some in groupby(claims, key=lambda claim: claim.case.rpartition(".")[0])]
    return next((some for some in cases if any(claim.case in failed for claim in some)), cases[0] if cases else [])


def read_limits(evidence: Mapping[str, Any]) -> dict[str, TrialLimits]:
    """Returns the limits that the evidence has, by trial."""
    return {limit.case: limit for limit in read(evidence.get("limits"), TrialLimits)}


def read(values: Any, kind: type[Read]) -> list[Read]:
    """Returns a list of the evidence, which may be of an older version; empty if it is missing or of another shape."""
    try:
        validated: list[Read] = build_reader(list[kind]).validate_python(values or [])  # type: ignore[valid-type]
        return validated
    except ValidationError:
        return []


def take_claim(parameters: ThresholdParameters, trial: Trial[Cell], claim: ClaimRecord, end: int) -> Iterator[Take]:
    """Yields the run at one end of a claim, if it lies within the search. None claims that the longest timestep is
    stable."""
    shortest, longest = parameters.search_s
    if claim.claim_ms is None:
        if claim.said_none:
            yield Take(trial, longest, "you said None")
        return
    timestep_s = claim.claim_ms[end] / 1000
    if shortest <= timestep_s <= 2 * longest:
        yield Take(trial, timestep_s, "")


def take_limit(parameters: ThresholdParameters, trial: Trial[Cell], limit: TrialLimits, *, is_above: bool) -> Take:
    """Returns the run just below the linear limit, or just above that within the horizon; without a limit, the run at
    the longest timestep."""
    longest = parameters.search_s[1]
    if limit.linear_ms is None or limit.within_ms is None:
        return Take(trial, longest, "no limit")
    return Take(trial, (ABOVE * limit.within_ms if is_above else BELOW * limit.linear_ms) / 1000, "")


def shoot(parameters: ThresholdParameters, name: str, title: str, takes: Sequence[Take]) -> Iterator[Film]:
    """Yields the film of some runs; none without runs."""
    if not takes:
        return
    rollouts = [run(parameters, take) for take in takes]
    ends = [float(rollout.time[-1]) for rollout in rollouts if rollout.diverged_at_step is not None]
    end_s = min(parameters.horizon_s, max(AFTERWARDS * max(ends), SHORTEST_S)) if ends else parameters.horizon_s
    panels = tuple(build_panel(take, rollout, end_s) for take, rollout in zip(takes, rollouts, strict=True))
    caption = "; ".join(f"{panel.title}, {panel.detail}: {panel.ended or 'no warning'}" for panel in panels) + "."
    steps = sum(rollout.steps for rollout in rollouts)
    yield Film(name, title, caption, takes[0].trial.problem.scene, end_s, panels, steps=steps)


def run(parameters: ThresholdParameters, take: Take) -> Rollout:
    """Simulates as long as the judge does."""
    cell, steps = take.trial.problem, round(parameters.horizon_s / take.timestep_s)
    return simulate(
        cell.scene, steps=steps, timestep_s=take.timestep_s, integrator=cell.integrator.code,
        every=max(1, steps // ROWS_MAX),
    )  # fmt: skip


def build_panel(take: Take, rollout: Rollout, end_s: float) -> Panel:
    """Returns a run up to the end of the film."""
    there = int((rollout.time <= end_s + take.timestep_s / 2).sum())
    rows = choose_rows(max(1, there))
    name = take.trial.problem.integrator.name
    detail = ", ".join(filter(None, (f"{1000 * take.timestep_s:.4g} ms", take.what)))
    return Panel(
        name, rollout.time[rows], rollout.qpos[rows], detail=detail, integrator=name, ended=describe_end(rollout)
    )


def describe_end(rollout: Rollout) -> str:
    """Says which warning ended a run, and when; empty where none did."""
    if rollout.diverged_at_step is None:
        return ""
    kind = "stopped" if rollout.warning is None else rollout.warning.name.removeprefix("mjWARN_")
    return f"{kind} at {rollout.time[-1]:.3g} s"
