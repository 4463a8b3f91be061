"""Names the mistake that the runs of a script show.

The trace is a claim: what is said here explains a verdict and decides nothing.
"""

from collections.abc import Sequence
from itertools import pairwise

from mujoco import mjtWarning

from grader.exercises.kind import Judged
from grader.exercises.kinds.threshold.judge import Bracket, Claim, NoLimit
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.range_mistakes import (
    edge_of_search,
    ends_untried,
    never_stepped,
    nothing_simulated,
    odd_return,
    places_in_a_list,
    printed_only,
    rounded_ends,
    too_coarse,
    turned_round,
    value_and_uncertainty,
)
from grader.exercises.kinds.threshold.recorded import read_search
from grader.exercises.kinds.threshold.run_mistakes import (
    REPEATED,
    actuators_off,
    far_beyond,
    linearised,
    never_reset,
    one_timestep,
    other_integrator,
    other_model,
    other_start,
    other_target,
    reset_each_step,
    rolled_out,
    start_no_number,
    too_short,
)
from grader.exercises.kinds.threshold.seen import CLOSE, Rule, Seen

UNSTABLE = {int(getattr(mjtWarning, f"mjWARN_{name}")): name for name in ("BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")}
"""The kinds of warning that make a run unstable, by their places in data.warning."""


def overlooked(seen: Seen) -> str | None:
    """A run with a warning counts as stable."""
    missed = next((run for run in seen.called_stable if any(run.warned >> bit & 1 for bit in UNSTABLE)), None)
    if missed is None:
        return None
    kinds = " and ".join(name for bit, name in UNSTABLE.items() if missed.warned >> bit & 1)
    at, differs = seen.at(missed.timestep_s), seen.search.differs
    if seen.search.cleared:
        return (
            f"{at} MuJoCo raised {kinds}, and your answer calls that timestep stable. Your script resets the data "
            "after the run, which sets data.warning back to 0: read the numbers of BADQPOS, BADQVEL and BADQACC before."
        )
    if missed.model < len(differs) and "autoreset" in differs[missed.model]:
        return (
            f"{at} MuJoCo raised {kinds}, and your answer calls that timestep stable. You switched the automatic reset "
            "off, so that data.time never falls back: look at data.warning[...].number of BADQPOS, BADQVEL and BADQACC."
        )
    return (
        f"{at} MuJoCo raised {kinds} and reset the state, and your answer calls that "
        "timestep stable. After the steps, look at data.warning[...].number of BADQPOS, BADQVEL and BADQACC, or at "
        "data.time falling back."
    )


def of_none(rule: Rule) -> Rule:
    """Restricts a rule to the claim that nothing is unstable."""
    return lambda seen: rule(seen) if isinstance(seen.claim, NoLimit) else None


def own_criterion(seen: Seen) -> str | None:
    """A run without a warning counts as unstable."""
    calm = next((run for run in seen.called_unstable if not run.raised), None)
    if calm is None:
        return None
    horizon_s = seen.parameters.horizon_s
    early = calm.lasted_s < 0.9 * horizon_s and seen.shown
    when = f" within {calm.lasted_s:.2g} s, where you ended it" if early else f" within {horizon_s:g} s"
    return (
        f"{seen.at(calm.timestep_s)} your run raised no warning{when}, and you call it unstable. Here a run is "
        "unstable when MuJoCo raises a warning, not when the motion is large or inaccurate."
    )


def counters_stood(seen: Seen) -> str | None:
    """Warnings of an earlier run are counted again."""
    if not any(run.stood for run in seen.called_unstable):
        return None
    return (
        "Warnings of an earlier run still stood in data.warning when a run began, so that it counts as unstable. "
        "Call mujoco.mj_resetData before each run: it clears them."
    )


def never_lowered(seen: Seen) -> str | None:
    """Once a run was unstable, all smaller timesteps count as unstable, down to the shortest."""
    runs, parameters = seen.search.runs, seen.parameters
    first = next((index for index, run in enumerate(runs) if run.raised), len(runs))
    calm = [run for run in runs[first:] if not run.raised]
    if not isinstance(seen.claim, Bracket) or len(calm) < REPEATED or seen.search.total > len(runs):
        return None
    if any(run.lasted_s < 0.9 * parameters.horizon_s for run in calm):
        return None
    falls = all(after.timestep_s < before.timestep_s for before, after in pairwise(runs[first:]))
    if not falls or seen.claim.high > calm[-1].timestep_s * (1 + CLOSE):
        return None
    return (
        "After your first unstable run every later one counts as unstable, although MuJoCo raised no warning in most "
        "of them. What remembers a warning, a flag or a counter, must be set back at the start of each run."
    )


def wrong_way_round(seen: Sequence[Seen]) -> str | None:
    """Runs with a warning count as stable in some trials, and runs without one as unstable in all others."""
    nothing = [one for one in seen if isinstance(one.claim, NoLimit)]
    numbers = [one for one in seen if one not in nothing]
    if not nothing or not numbers or not all(one.search.runs for one in seen):
        return None
    if not all(run.raised for one in nothing for run in one.search.runs):
        return None
    if any(run.raised for one in numbers for run in one.search.runs) or not all(one.called_unstable for one in numbers):
        return None
    return (
        "Your test is the wrong way round: a run in which MuJoCo raised a warning counts as stable, and one without a "
        "warning as unstable. Turn the condition round that your function returns."
    )


CERTAIN: tuple[Rule, ...] = (
    printed_only,
    never_stepped,
    odd_return,
    far_beyond,
    reset_each_step,
    actuators_off,
    one_timestep,
    never_reset,
    other_integrator,
    start_no_number,
    other_start,
    other_target,
    too_short,
    rounded_ends,
    of_none(rolled_out),
    of_none(linearised),
    of_none(overlooked),
    of_none(edge_of_search),
)
"""What the runs show without doubt; the first that explains every wrong claim is told."""

FALLBACK: tuple[Rule, ...] = (
    value_and_uncertainty,
    places_in_a_list,
    turned_round,
    edge_of_search,
    too_coarse,
    overlooked,
    counters_stood,
    other_model,
    never_lowered,
    own_criterion,
    nothing_simulated,
    ends_untried,
)
"""What is told where no wrong method is recognised by its claims."""


def explain(parameters: ThresholdParameters, wrong: Sequence[Judged[Cell, Claim]], rules: Sequence[Rule]) -> str | None:
    """Returns the sentence of the first rule that explains every wrong claim of the visible trials.

    If all visible claims are right, it must explain those of the hidden trials, of whose runs only the first are known.
    """
    told = [one for one in wrong if not one.trial.hidden] or wrong
    seen = [
        Seen(parameters, one.trial.problem, one.judgement.outcome, search, one.trace, not one.trial.hidden)
        for one in told
        if (search := read_search(one.trace)) is not None
    ]
    if not seen or len(seen) < len(told):
        return None
    if (turned := wrong_way_round(seen)) is not None:
        return turned
    for rule in rules:
        sentences = [rule(one) for one in seen]
        if all(sentences):
            return sentences[0]
    return None
