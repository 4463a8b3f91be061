"""Names the mistake that the runs of a script show. The trace is a claim, and decides nothing."""

from collections.abc import Sequence
from itertools import pairwise

from mujoco import mjtWarning

from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.threshold.bisections import explain_wrong_bisection
from grader.exercises.kinds.threshold.judging.judge import Bracket, Claim, NoLimit
from grader.exercises.kinds.threshold.observation import CLOSE, Observation, Rule
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.exercises.kinds.threshold.range_mistakes import (
    explain_coarse_search,
    explain_early_return,
    explain_list_indices,
    explain_narrow_search,
    explain_negative_number,
    explain_no_simulation,
    explain_no_step,
    explain_number_for_none,
    explain_other_return,
    explain_printed_result,
    explain_rounded_ends,
    explain_uncertainty,
    explain_unreadable_result,
    explain_untried_ends,
    explain_upward_search,
    explain_whole_range,
)
from grader.exercises.kinds.threshold.run_mistakes import (
    REPEATED_MIN,
    explain_actuators_off,
    explain_far_timesteps,
    explain_linearisation,
    explain_missing_reset,
    explain_nan_start,
    explain_other_integrator,
    explain_other_model,
    explain_other_start,
    explain_other_target,
    explain_reset_each_step,
    explain_rollout,
    explain_short_runs,
    explain_single_timestep,
)
from grader.exercises.kinds.threshold.script_facts import describe_test
from grader.exercises.kinds.threshold.search_trace import read_search

UNSTABLE = {int(getattr(mjtWarning, f"mjWARN_{name}")): name for name in ("BADQPOS", "BADQVEL", "BADQACC", "BADCTRL")}
"""The kinds of warning that make a run unstable, by their places in data.warning."""


def explain_overlooked_warning(observed: Observation) -> str | None:
    """Returns the sentence where a run with a warning counts as stable."""
    missed = next((run for run in observed.stable_runs if any(run.new_warnings >> bit & 1 for bit in UNSTABLE)), None)
    if missed is None:
        return None
    kinds = " and ".join(name for bit, name in UNSTABLE.items() if missed.new_warnings >> bit & 1)
    at, differs = observed.describe_timestep(missed.timestep_s), observed.search.differing_fields
    if observed.search.was_reset:
        return (
            f"{at} MuJoCo raised {kinds}, and your answer calls that timestep stable. Your script resets the data "
            "after the run, which sets data.warning back to 0: read the numbers of BADQPOS, BADQVEL and BADQACC before."
        )
    if missed.model < len(differs) and "autoreset" in differs[missed.model]:
        return (
            f"{at} MuJoCo raised {kinds}, and your answer calls that timestep stable. You switched the automatic reset "
            "off, so that data.time never falls back: look at data.warning[...].number of BADQPOS, BADQVEL and BADQACC."
        )
    test = describe_test(observed.script)
    return (
        f"{at} MuJoCo raised {kinds} and reset the state, and your answer calls that "
        f"timestep stable. {test}After the steps, look at data.warning[...].number of BADQPOS, BADQVEL and BADQACC, or "
        "at data.time falling back."
    )


def restrict_to_no_limit(rule: Rule) -> Rule:
    """Restricts a rule to the claim that nothing is unstable."""
    return lambda observed: rule(observed) if isinstance(observed.claim, NoLimit) else None


def explain_own_criterion(observed: Observation) -> str | None:
    """Returns the sentence where a run without a warning counts as unstable: it is the end of the answer that is called
    so, or the search went down from it."""
    fell, claim = observed.runs_before_falls, observed.claim
    calm = next(
        (
            run
            for run in observed.unstable_runs
            if not run.warnings and (run in fell or (isinstance(claim, Bracket) and run.timestep_s == claim.high))
        ),
        None,
    )
    if calm is None:
        return None
    horizon_s = observed.parameters.horizon_s
    early = calm.duration_s < 0.9 * horizon_s and observed.may_tell_numbers
    when = f" within {calm.duration_s:.2g} s, where you ended it" if early else f" within {horizon_s:g} s"
    return (
        f"{observed.describe_timestep(calm.timestep_s)} your run raised no warning{when}, and you call it unstable. "
        "Here a run is unstable when MuJoCo raises a warning, not when the motion is large or inaccurate."
    )


def explain_old_warnings(observed: Observation) -> str | None:
    """Returns the sentence where warnings of an earlier run are counted again."""
    if not any(run.old_warnings for run in observed.unstable_runs):
        return None
    return (
        "Warnings of an earlier run still stood in data.warning when a run began, so that it counts as unstable. "
        "Call mujoco.mj_resetData before each run: it clears them."
    )


def explain_sticky_flag(observed: Observation) -> str | None:
    """Returns the sentence where all timesteps after the first unstable one count as unstable."""
    runs, parameters = observed.search.runs, observed.parameters
    first = next((index for index, run in enumerate(runs) if run.warnings), len(runs))
    calm = [run for run in runs[first:] if not run.warnings]
    if not isinstance(observed.claim, Bracket) or len(calm) < REPEATED_MIN or observed.search.total > len(runs):
        return None
    if any(run.duration_s < 0.9 * parameters.horizon_s for run in calm):
        return None
    falls = all(after.timestep_s < before.timestep_s for before, after in pairwise(runs[first:]))
    if not falls or observed.claim.high > calm[-1].timestep_s * (1 + CLOSE):
        return None
    return (
        "After your first unstable run every later one counts as unstable, although MuJoCo raised no warning in most "
        "of them. What remembers a warning, a flag or a counter, must be set back at the start of each run."
    )


def explain_inverted_test(observed: Sequence[Observation]) -> str | None:
    """Returns the sentence where runs with a warning count as stable, and in other trials those without as unstable."""
    nothing = [observation for observation in observed if isinstance(observation.claim, NoLimit)]
    numbers = [observation for observation in observed if observation not in nothing]
    if not nothing or not numbers or not all(observation.search.runs for observation in observed):
        return None
    if not all(run.warnings for observation in nothing for run in observation.search.runs):
        return None
    if any(run.warnings for claimed in numbers for run in claimed.search.runs) or not all(
        claimed.unstable_runs for claimed in numbers
    ):
        return None
    if all(len(observation.search.runs) == 1 for observation in nothing) and not any(map(calls_calm_middle, numbers)):
        return (
            "Where the first run is unstable your function returns None, and where it is stable it searches on: turn "
            "the condition round on which it returns None."
        )
    return (
        "Your test is the wrong way round: a run in which MuJoCo raised a warning counts as stable, and one without a "
        "warning as unstable. Turn the condition round that your function returns."
    )


def calls_calm_middle(observed: Observation) -> bool:
    """Whether a timestep below the longest one is called unstable, as by a bisection that takes calm runs for such."""
    return any(run.timestep_s < observed.parameters.search_s[1] * (1 - CLOSE) for run in observed.unstable_runs)


CERTAIN_RULES: tuple[Rule, ...] = (
    explain_whole_range, explain_early_return, explain_printed_result, explain_unreadable_result, explain_rounded_ends,
    explain_uncertainty, explain_number_for_none, explain_list_indices, explain_other_return, explain_far_timesteps,
    explain_reset_each_step,
    explain_actuators_off, explain_single_timestep, explain_missing_reset, explain_other_integrator, explain_nan_start,
    explain_other_start, explain_other_target, explain_short_runs, explain_wrong_bisection,
    restrict_to_no_limit(explain_rollout), restrict_to_no_limit(explain_linearisation),
    restrict_to_no_limit(explain_other_model), restrict_to_no_limit(explain_overlooked_warning),
    restrict_to_no_limit(explain_narrow_search),
)  # fmt: skip
"""What the runs show without doubt; the first that explains every wrong claim is the diagnosis."""

NO_STEP_RULES: tuple[Rule, ...] = (explain_no_step,)
"""Looked at when no formula gives the claims."""

FALLBACK_RULES: tuple[Rule, ...] = (
    explain_upward_search, explain_narrow_search, explain_coarse_search,
    explain_overlooked_warning, explain_old_warnings, explain_other_model, explain_sticky_flag, explain_own_criterion,
    explain_no_simulation, explain_negative_number, explain_untried_ends,
)  # fmt: skip
"""Diagnoses where no wrong method is recognised by its claims."""


def explain_searches(
    parameters: ThresholdParameters,
    wrong: Sequence[JudgedTrial[Cell, Claim]],
    rules: Sequence[Rule],
    judged: Sequence[JudgedTrial[Cell, Claim]] = (),
) -> str | None:
    """Returns the sentence of the first rule that explains every wrong claim of the visible trials. If all visible
    claims are right, it must explain those of the hidden trials, of whose runs only the first are known. `judged` are
    all trials."""
    shown = [trial for trial in wrong if not trial.hidden] or wrong
    simulates = any((search := read_search(trial.trace)) is not None and search.total for trial in judged)
    observed = [
        Observation(
            parameters=parameters,
            cell=trial.problem,
            claim=trial.judgement.outcome,
            search=search,
            trace=trial.trace,
            may_tell_numbers=not trial.hidden,
            simulates_others=simulates,
            script=trial.script,
        )
        for trial in shown
        if (search := read_search(trial.trace)) is not None
    ]
    if not observed or len(observed) < len(shown):
        return None
    if (turned := explain_inverted_test(observed)) is not None:
        return turned
    for rule in rules:
        sentences = [rule(observation) for observation in observed]
        if all(sentences):
            return sentences[0]
    return None
