"""Mistakes in what a script returns, beside the timesteps that its trace says it ran."""

import re
from itertools import pairwise
from math import isfinite, isnan

from grader.exercises.kinds.threshold.judging.judge import Bracket, NoLimit, Unreadable
from grader.exercises.kinds.threshold.observation import CLOSE, Observation
from grader.exercises.trace import ReturnedValue

ROUNDED_DECIMALS = (2, 3)
"""Decimals of a second to which a rounded answer may be off by more than is allowed."""


def explain_printed_result(observed: Observation) -> str | None:
    """Returns the sentence where the result is printed and not returned."""
    if not isinstance(observed.claim, NoLimit) or observed.trace.printed_text is None or not observed.search.runs:
        return None
    number = re.search(r"\d+\.\d+", observed.trace.printed_text)
    if observed.may_tell_numbers and number is None:
        return None
    what = f" ({number[0]})" if number else ""
    return f"Your function prints its result{what} and returns None. Return it: return h_stable, h_unstable."


def explain_no_step(observed: Observation) -> str | None:
    """Returns the sentence where None was returned without a step."""
    if observed.search.total or observed.search.other_functions or not isinstance(observed.claim, NoLimit):
        return None
    name = observed.cell.integrator.name
    if observed.simulates_others:
        return (
            f"Under {name} your function returned None without a single step, although {name} has a limit here too. "
            "Run the same search under every integrator that you are given."
        )
    if observed.search.created:
        return (
            "Your function returned None without a single step: it makes an MjData, but mj_step is not called in this "
            "case. An answer must be measured: step the model (mj_forward moves nothing), and if you do so in a loop, "
            "print how many steps it takes."
        )
    return (
        "Your function returned None without a single step. Step the model with mujoco.mj_step (mj_forward moves "
        "nothing) at several timesteps before you answer."
    )


def explain_other_return(observed: Observation) -> str | None:
    """Returns the sentence where the runs end with a right bracket, and something else is returned."""
    bracket, claim = observed.right_bracket, observed.claim
    if bracket is None or isinstance(claim, Unreadable):
        return None
    evidence = ""
    if observed.may_tell_numbers:
        evidence = f": {1e3 * bracket.low:.4g} ms stayed stable, and at {1e3 * bracket.high:.4g} ms MuJoCo warned"
    if isinstance(claim, NoLimit):
        return f"Your search is right{evidence}; but your function returns None. Return its ends: return low, high."
    if claim.width < 0 or is_in_other_unit(claim, bracket):
        return None
    if claim.number is None and claim.width == 0:
        twice = f"{1e3 * claim.low:.4g} ms" if evidence else "one end"
        return f"Your search is right{evidence}; but you return {twice} twice. Return its two ends: return low, high."
    inside = bracket.low * (1 - CLOSE) <= min(claim.numbers) and max(claim.numbers) <= bracket.high * (1 + CLOSE)
    if inside:
        return None
    ends = " and ".join(f"{1e3 * end:.4g}" for end in claim.numbers)
    returned = f"you return {ends} ms{describe_factor(claim, bracket)}" if evidence else "you return something else"
    return f"Your search is right{evidence}; but {returned}. Return the two ends as the search has left them."


def is_in_other_unit(claim: Bracket, bracket: Bracket) -> bool:
    """Whether a claim holds an end of the bracket in milliseconds, or as a rate."""
    ends = (bracket.low, bracket.high, (bracket.low + bracket.high) / 2)
    others = [other for end in ends for other in (1e3 * end, 1 / end)]
    return any(abs(number - other) <= 1e-3 * other for number in claim.numbers for other in others)


def describe_factor(claim: Bracket, bracket: Bracket) -> str:
    """Returns by which simple factor a claim differs from what was found, to end a clause; empty if by none."""
    several = [(bracket.low,), (bracket.high,), ((bracket.low + bracket.high) / 2,)]
    for ends in several if claim.number is not None else [(bracket.low, bracket.high)]:
        factors = [number / end for number, end in zip(claim.numbers, ends, strict=True)]
        factor = round(factors[0], 2)
        if factor != 1 and all(abs(other - factor) <= CLOSE for other in factors):
            return f", {factor:g} times what it found"
    if claim.number is None and abs(claim.low - bracket.high) <= CLOSE * bracket.high:
        return ", the first of which is the one that warned"
    return ""


def explain_unreadable_result(observed: Observation) -> str | None:
    """Returns the sentence where something else than two numbers, one number or None was returned."""
    if not isinstance(observed.claim, Unreadable) or not (returned := observed.trace.returned_values):
        return None
    value = returned[0]
    if value.type in ("tuple", "list") and "NoneType" in value.items:
        return (
            f"Your function returns a {value.type} that holds None: where nothing is unstable return None alone, else "
            "two numbers, (h_stable, h_unstable)."
        )
    is_claim = value.type.startswith(("float", "int")) or value.shape in ((1,), (2,))
    if is_claim and (why := explain_items(value)):
        return why
    many = f" of {value.shape[0]} items" if value.type in ("tuple", "list") and value.shape else ""
    what = f"a value of type {value.type}{many}" if value.type else "something else"
    return f"Your function returns {what}: it must return (h_stable, h_unstable) in seconds, or None."


def explain_items(value: ReturnedValue) -> str | None:
    """Returns the sentence for one or two numbers of which one is none, or is not finite."""
    items = value.items or (value.type,) * len(value.numbers)
    holder = f" a {value.type} with" if value.items or value.shape else ""
    returns = f"Your function returns{holder}"
    for item, number in zip(items, value.numbers, strict=False):
        if isnan(number) and item and not item.startswith(("float", "ndarray")):
            return f"{returns} a value of type {item}: it must return two numbers in seconds, (h_stable, h_unstable)."
        if item.startswith(("float", "int")) and not isfinite(number):
            beyond = str(number) if item.startswith("float") else "a whole number too large for a float"
            what = "nan" if isnan(number) else beyond
            return (
                f"{returns} {what}: where nothing is unstable return None alone, else two numbers, (h_stable, "
                "h_unstable)."
            )
    return None


def explain_number_for_none(observed: Observation) -> str | None:
    """Returns the sentence of a number that is no timestep, such as -1, 0 or 999, where nothing is unstable."""
    claim = observed.claim
    if not isinstance(claim, Bracket) or any(number > 0 and number != int(number) for number in claim.numbers):
        return None
    longest = max((run.timestep_s for run in observed.search.runs), default=0.0)
    if longest < observed.parameters.search_s[1] * (1 - CLOSE) or any(run.warnings for run in observed.search.runs):
        return None
    if not observed.runs_end_as_ours:
        return None
    ends = ", ".join(f"{number:g}" for number in claim.numbers)
    what = ends if claim.number is not None else f"({ends})"
    return f"Return None where nothing is unstable, not {what if observed.may_tell_numbers else 'a number'}."


def explain_negative_number(observed: Observation) -> str | None:
    """Returns the sentence of a negative number."""
    claim = observed.claim
    if not isinstance(claim, Bracket) or max(claim.numbers) >= 0:
        return None
    return "Your answer is negative, which no timestep is: return (h_stable, h_unstable) in seconds, or None."


def explain_list_indices(observed: Observation) -> str | None:
    """Returns the sentence of whole numbers where timesteps of fractions of a second were run."""
    longest_s = observed.parameters.search_s[1]
    if not isinstance(observed.claim, Bracket) or not observed.search.runs:
        return None
    if (
        any(end != int(end) for end in observed.claim.numbers)
        or min(observed.claim.numbers) < 0
        or max(observed.claim.numbers) < 1
        or max(run.timestep_s for run in observed.search.runs) > longest_s
    ):
        return None
    ends = f" ({' and '.join(f'{end:g}' for end in observed.claim.numbers)})" if observed.may_tell_numbers else ""
    return (
        f"Your answer{ends} is of whole numbers, but your runs use timesteps of fractions of a second. Return the "
        "timesteps themselves, not their places in a list, nor the number of a run."
    )


def explain_upward_search(observed: Observation) -> str | None:
    """Returns the sentence where the search goes on upwards from unstable timesteps."""
    runs = observed.search.runs
    pairs = [(run, other) for run, other in pairwise(runs) if run.warnings and other.timestep_s != run.timestep_s]
    upwards = sum(other.timestep_s > run.timestep_s for run, other in pairs)
    if upwards < 3 or upwards < len(pairs) - 1 or not isinstance(observed.claim, Bracket):
        return None
    return (
        "After an unstable run your search goes on upwards, so that it ends at the upper end. Where the middle is "
        "unstable it is the new upper end, where it is stable the new lower end."
    )


def explain_coarse_search(observed: Observation) -> str | None:
    """Returns the sentence where the last stable and the first unstable timestep lie far apart."""
    bracket, allowed_s = observed.last_bracket, observed.parameters.width_s
    if bracket is None or not isinstance(observed.claim, Bracket) or bracket.width <= 1.5 * allowed_s:
        return None
    if min(observed.claim.numbers) < bracket.low or max(observed.claim.numbers) > bracket.high:
        return None
    shown = f" ({1e3 * bracket.low:.4g} and {1e3 * bracket.high:.4g} ms)" if observed.may_tell_numbers else ""
    return (
        f"Your search is too coarse: its last stable and its first unstable timestep{shown} are more than "
        f"{1e3 * allowed_s:g} ms apart, and the limit lies anywhere between. Go on halving between the two."
    )


def explain_whole_range(observed: Observation) -> str | None:
    """Returns the sentence where the ends of the search are returned, and nothing was tried between them."""
    ends, runs = observed.parameters.search_s, observed.search.runs
    if not isinstance(observed.claim, Bracket) or observed.claim.numbers != list(ends):
        return None
    inside = [run for run in runs if ends[0] * (1 + CLOSE) < run.timestep_s < ends[1] * (1 - CLOSE)]
    if inside or not runs or observed.search.total > len(runs):
        return None
    shortest, longest, width = (f"{1e3 * value:g}" for value in (*ends, observed.parameters.width_s))
    return (
        f"You return the whole range of the search, {shortest} and {longest} ms: no timestep between them was tried. "
        f"If a loop should halve it, look at its condition: {width} ms are {observed.parameters.width_s:g} s."
    )


def explain_early_return(observed: Observation) -> str | None:
    """Returns the sentence where a `return` within the loop ends the search, so that its bracket is too wide."""
    claim, runs = observed.claim, observed.search.runs
    if not isinstance(claim, Bracket) or claim.width <= observed.parameters.width_s or not observed.script.tree:
        return None
    middles = {f"{run.timestep_s:.9g}" for run in runs} - {f"{end:.9g}" for end in observed.parameters.search_s}
    if len(middles) != 1 or observed.search.total > len(runs) or not observed.script.returns_in_loops:
        return None
    return (
        "Your search tries one timestep between its ends, and returns: a `return` that stands inside the loop ends it "
        f"after one halving. Return after the loop, when the bracket is at most "
        f"{1e3 * observed.parameters.width_s:g} ms wide."
    )


def explain_rounded_ends(observed: Observation) -> str | None:
    """Returns the sentence where the answer holds the ends of the search, or their middle, rounded too coarsely."""
    bracket = observed.last_bracket
    if not isinstance(observed.claim, Bracket) or bracket is None:
        return None
    ends = (bracket.low, bracket.high) if observed.claim.number is None else ((bracket.low + bracket.high) / 2,)
    if all(abs(value - end) <= CLOSE * end for value, end in zip(ends, observed.claim.numbers, strict=True)):
        return None
    for decimals in ROUNDED_DECIMALS:
        if [round(value, decimals) for value in ends] == observed.claim.numbers:
            return (
                f"Your answer is rounded to {decimals} decimals of a second, in steps of {1e3 * 10**-decimals:g} ms: "
                "the timesteps that you ran are finer. Return them as they are, and round only what you print."
            )
    return None


def explain_uncertainty(observed: Observation) -> str | None:
    """Returns the sentence of a timestep with a number that is smaller than any timestep of a run."""
    if not isinstance(observed.claim, Bracket) or observed.claim.number is not None or not observed.search.runs:
        return None
    tried = [run.timestep_s for run in observed.search.runs]
    if not 0 < observed.claim.high < min(*tried, observed.parameters.width_s) <= observed.claim.low <= max(tried):
        return None
    return (
        "Your second number is smaller than every timestep that you ran: it seems to be the uncertainty of the first. "
        "Return the two ends of the bracket, (h_stable, h_unstable)."
    )


def explain_narrow_search(observed: Observation) -> str | None:
    """Returns the sentence where the search does not reach as far as it should."""
    runs = observed.search.runs
    if len(runs) < (1 if isinstance(observed.claim, NoLimit) else 2):
        return None
    lowest, highest = (find(run.timestep_s for run in runs) for find in (min, max))
    shortest_s, longest_s = observed.parameters.search_s
    if observed.search.total > len(runs):
        return None
    top = highest < 0.95 * longest_s and not any(run.warnings for run in runs if run.timestep_s == highest)
    if top and (isinstance(observed.claim, NoLimit) or (observed.stable_runs and len(observed.unstable_runs) < 2)):
        return (
            f"Your search ends at {observed.format_number(1e3 * highest)} ms, where nothing is unstable yet. "
            f"Search up to {1e3 * longest_s:g} ms."
        )
    bottom = lowest > 1.05 * shortest_s and all(run.warnings for run in runs if run.timestep_s == lowest)
    if bottom and isinstance(observed.claim, Bracket) and observed.claim.low <= lowest * (1 + CLOSE):
        return (
            f"The smallest timestep of your search is {observed.format_number(1e3 * lowest)} ms, which is unstable "
            f"already. Search from {1e3 * shortest_s:g} ms."
        )
    return None


def explain_no_simulation(observed: Observation) -> str | None:
    """Returns the sentence of answers without a step, some of them numbers."""
    if observed.search.total or observed.search.other_functions or isinstance(observed.claim, Unreadable):
        return None
    return (
        "Nothing was simulated: your answer comes from a formula or was written down. "
        "Step the model at several timesteps, and narrow the bracket down."
    )


def explain_untried_ends(observed: Observation) -> str | None:
    """Returns the sentence of an end of the bracket at which nothing was run."""
    if not isinstance(observed.claim, Bracket) or observed.claim.number is not None or not observed.search.runs:
        return None
    only = observed.search.runs[0]
    if observed.search.total > len(observed.search.runs):
        return None
    if len(observed.search.runs) == 1 and only.last_timestep_s != only.timestep_s:
        return None
    tried = [run.timestep_s for run in observed.search.runs]
    for what, end in (("stable", observed.claim.low), ("unstable", observed.claim.high)):
        if not any(abs(h - end) <= 1e-3 * end for h in tried):
            if any(abs(1e3 * h - end) <= 1e-3 * end for h in tried):
                return (
                    f"The {what} end of your bracket is a thousand times one of your timesteps: it is in milliseconds. "
                    "Return both ends in seconds."
                )
            place = f"{1e3 * end:.4g} ms" if observed.may_tell_numbers else "a timestep"
            longest_ms = 1e3 * observed.parameters.search_s[1]
            more = (
                ". Return the last timesteps that you found stable and unstable."
                if any(run.warnings for run in observed.search.runs)
                else f", and none of your runs was unstable. Run {longest_ms:g} ms first, and return None where that "
                "is stable."
            )
            return f"You report {place} as {what}, but never ran it{more}"
    return None
