"""Mistakes in what a script returns, beside the timesteps that its trace says it ran."""

import re
from itertools import pairwise

from grader.exercises.kinds.threshold.judge import Bracket, NoLimit, Unreadable
from grader.exercises.kinds.threshold.seen import CLOSE, Seen

ROUNDED_TO = (2, 3)
"""Decimals of a second to which a rounded answer may be off by more than is allowed."""


def printed_only(seen: Seen) -> str | None:
    """The result is printed and not returned."""
    if not isinstance(seen.claim, NoLimit) or seen.trace.printed is None or not seen.search.runs:
        return None
    number = re.search(r"\d+\.\d+", seen.trace.printed)
    if seen.shown and number is None:
        return None
    what = f" ({number[0]})" if number else ""
    return f"Your function prints its result{what} and returns None. Return it: return h_stable, h_unstable."


def never_stepped(seen: Seen) -> str | None:
    """None was returned without a step."""
    if seen.search.total or seen.search.others or not isinstance(seen.claim, NoLimit):
        return None
    if seen.search.created:
        return (
            "Your function returned None without a single step: it makes an MjData, but mj_step is never called. Print "
            "how many steps your loop takes (a run's length divided by the timestep); mj_forward moves nothing."
        )
    return (
        "Your function returned None without a single step. Step the model with mujoco.mj_step (mj_forward moves "
        "nothing) at several timesteps before you answer."
    )


def odd_return(seen: Seen) -> str | None:
    """Something else than two numbers, one number or None was returned."""
    if not isinstance(seen.claim, Unreadable) or not (returned := seen.trace.returned):
        return None
    given = returned[0]
    if given.type in ("tuple", "list") and "NoneType" in given.items:
        return (
            f"Your function returns a {given.type} that holds None: where nothing is unstable return None alone, else "
            "two numbers, (h_stable, h_unstable)."
        )
    many = f" of {given.shape[0]} items" if given.type in ("tuple", "list") and given.shape else ""
    what = f"a value of type {given.type}{many}" if given.type else "something else"
    return f"Your function returns {what}: it must return (h_stable, h_unstable) in seconds, or None."


def places_in_a_list(seen: Seen) -> str | None:
    """Whole numbers where timesteps of a fraction of a second were run."""
    longest_s = seen.parameters.search_s[1]
    if not isinstance(seen.claim, Bracket) or not seen.search.runs:
        return None
    if any(end != int(end) for end in seen.claim.given) or max(run.timestep_s for run in seen.search.runs) > longest_s:
        return None
    given = f" ({' and '.join(f'{end:g}' for end in seen.claim.given)})" if seen.shown else ""
    return (
        f"Your answer{given} is of whole numbers, but your runs use timesteps of fractions of a second. Return the "
        "timesteps themselves, not their places in a list, nor the number of a run."
    )


def turned_round(seen: Seen) -> str | None:
    """The search goes on upwards from unstable timesteps."""
    runs = seen.search.runs
    pairs = [(one, other) for one, other in pairwise(runs) if one.raised and other.timestep_s != one.timestep_s]
    upwards = sum(other.timestep_s > one.timestep_s for one, other in pairs)
    if upwards < 3 or upwards < len(pairs) - 1 or not isinstance(seen.claim, Bracket):
        return None
    return (
        "After an unstable run your search goes on upwards, so that it ends at the upper end. Where the middle is "
        "unstable it is the new upper end, where it is stable the new lower end."
    )


def too_coarse(seen: Seen) -> str | None:
    """The last stable and the first unstable timestep lie far apart."""
    runs, allowed_s = seen.search.runs, seen.parameters.width_s
    if seen.search.total > len(runs) or not isinstance(seen.claim, Bracket):
        return None
    above = min((run.timestep_s for run in runs if run.raised), default=0.0)
    below = max((run.timestep_s for run in runs if not run.raised and run.timestep_s < above), default=0.0)
    ends = seen.claim.given
    if not below or above - below <= 1.5 * allowed_s or min(ends) < below or max(ends) > above:
        return None
    shown = f" ({1e3 * below:.4g} and {1e3 * above:.4g} ms)" if seen.shown else ""
    return (
        f"Your search is too coarse: its last stable and its first unstable timestep{shown} are more than "
        f"{1e3 * allowed_s:g} ms apart, and the limit lies anywhere between. Go on halving between the two."
    )


def rounded_ends(seen: Seen) -> str | None:
    """The answer holds the ends of the search, or their middle, rounded to steps as wide as what is asked for."""
    if not isinstance(seen.claim, Bracket) or seen.search.total > len(seen.search.runs):
        return None
    above = min((run.timestep_s for run in seen.search.runs if run.raised), default=0.0)
    below = max((run.timestep_s for run in seen.search.runs if not run.raised and run.timestep_s < above), default=0.0)
    found = (below, above) if seen.claim.number is None else ((below + above) / 2,)
    if not below or all(abs(one - end) <= CLOSE * end for one, end in zip(found, seen.claim.given, strict=True)):
        return None
    for decimals in ROUNDED_TO:
        if [round(one, decimals) for one in found] == seen.claim.given:
            return (
                f"Your answer is rounded to {decimals} decimals of a second, in steps of {1e3 * 10**-decimals:g} ms: "
                "the timesteps that you ran are finer. Return them as they are, and round only what you print."
            )
    return None


def value_and_uncertainty(seen: Seen) -> str | None:
    """A timestep and a number that is smaller than any timestep of a run."""
    if not isinstance(seen.claim, Bracket) or seen.claim.number is not None or not seen.search.runs:
        return None
    tried = [run.timestep_s for run in seen.search.runs]
    if not 0 <= seen.claim.high < min(*tried, seen.parameters.width_s) <= seen.claim.low <= max(tried):
        return None
    return (
        "Your second number is smaller than every timestep that you ran: it seems to be the uncertainty of the first. "
        "Return the two ends of the bracket, (h_stable, h_unstable)."
    )


def edge_of_search(seen: Seen) -> str | None:
    """The search does not reach as far as it should."""
    runs = seen.search.runs
    if len(runs) < (1 if isinstance(seen.claim, NoLimit) else 2):
        return None
    lowest, highest = (find(run.timestep_s for run in runs) for find in (min, max))
    shortest_s, longest_s = seen.parameters.search_s
    if seen.search.total > len(runs):
        return None
    top = highest < 0.95 * longest_s and not any(run.raised for run in runs if run.timestep_s == highest)
    if top and (isinstance(seen.claim, NoLimit) or (seen.called_stable and len(seen.called_unstable) < 2)):
        return (
            f"Your search ends at {seen.figures(1e3 * highest)} ms, where nothing is unstable yet. "
            f"Search up to {1e3 * longest_s:g} ms."
        )
    bottom = lowest > 1.05 * shortest_s and all(run.raised for run in runs if run.timestep_s == lowest)
    if bottom and isinstance(seen.claim, Bracket) and seen.claim.low <= lowest * (1 + CLOSE):
        return (
            f"Your search begins at {seen.figures(1e3 * lowest)} ms, which is unstable already. "
            f"Begin at {1e3 * shortest_s:g} ms."
        )
    return None


def nothing_simulated(seen: Seen) -> str | None:
    """Answers without a step, some of them numbers."""
    if seen.search.total or seen.search.others or isinstance(seen.claim, Unreadable):
        return None
    return (
        "Nothing was simulated: your answer comes from a formula or was written down. "
        "Step the model at several timesteps, and narrow the bracket down."
    )


def ends_untried(seen: Seen) -> str | None:
    """An end of the bracket at which nothing was run."""
    if not isinstance(seen.claim, Bracket) or seen.claim.number is not None or not seen.search.runs:
        return None
    only = seen.search.runs[0]
    if seen.search.total > len(seen.search.runs):
        return None
    if len(seen.search.runs) == 1 and only.last_timestep_s != only.timestep_s:
        return None
    tried = [run.timestep_s for run in seen.search.runs]
    for what, end in (("stable", seen.claim.low), ("unstable", seen.claim.high)):
        if not any(abs(h - end) <= 1e-3 * end for h in tried):
            if any(abs(1e3 * h - end) <= 1e-3 * end for h in tried):
                return (
                    f"The {what} end of your bracket is a thousand times one of your timesteps: it is in milliseconds. "
                    "Return both ends in seconds."
                )
            place = f"{1e3 * end:.4g} ms" if seen.shown else "a timestep"
            found = any(run.raised for run in seen.search.runs)
            more = (
                ". Return the last timesteps that you found stable and unstable."
                if found
                else f", and none of your runs was unstable. Run {1e3 * seen.parameters.search_s[1]:g} ms first, and "
                "return None where that is stable."
            )
            return f"You report {place} as {what}, but never ran it{more}"
    return None
