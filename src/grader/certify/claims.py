"""Decides whether a claim about the history of a run is true."""

from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from math import inf, isfinite
from typing import Any

from grader.domain.verify import Claim, When
from grader.experiments.regime import RegimeFailure, describe_reset
from grader.experiments.runs import LabRun, to_boolean, to_number
from grader.expressions import syntax

TIME_SLACK_S = 1e-9
"""Rounding of sums of timesteps."""


TRUTHS = ("end", "always", "ever", "times", "first")
"""When an expression is true or false; `max` and `min` are of its value."""


def to_claim(text: str | Claim, when: When) -> Claim:
    """Returns the claim that an expression is true at `when`."""
    return text if isinstance(text, Claim) else Claim(expr=text, when=when)


def check_claim(claim: Claim, run: LabRun, values: Sequence[Any]) -> tuple[bool, float | None]:
    """Whether the claim holds in a run in which its expression had these values, a value a frame.

    Also returns the number that was counted or measured: None where there is none, as for the first time of what never
    happened. Such a claim is false. Raises RegimeFailure where MuJoCo reset the state before the claim was decided,
    where the run ends before its window does, and where the expression is neither true nor false.
    """
    _check_window(claim, run)
    until = inf if claim.until is None else claim.until + TIME_SLACK_S
    reset = run.warnings[0].time_s if run.warnings else inf
    inside = [
        value
        for time, value in zip(run.times, values, strict=True)
        if claim.since - TIME_SLACK_S <= time <= until and time < reset
    ]
    if run.warnings and until >= reset and not _is_decided(claim, inside):
        raise RegimeFailure("no reset", describe_reset(run))
    if claim.when in TRUTHS:
        _check_truths(claim, inside)
    if not inside:
        return False, None
    if claim.when in ("end", "always", "ever"):
        truths = list(map(to_boolean, inside))
        return (truths[-1] if claim.when == "end" else all(truths) if claim.when == "always" else any(truths)), None
    measured = _measure(claim, run, inside)
    if measured is None or not isfinite(measured):
        return False, None
    low = -inf if claim.at_least is None else claim.at_least
    high = inf if claim.at_most is None else claim.at_most
    return low <= measured <= high, measured


def _check_window(claim: Claim, run: LabRun) -> None:
    """Raises RegimeFailure where the run was asked to end before the window of the claim does."""
    last = max(claim.since, claim.until or 0.0)
    if last > run.seconds + TIME_SLACK_S:
        why = f"a claim is about the run up to {last:g} s, and it lasts {run.seconds:g} s: write more `seconds`"
        raise RegimeFailure("window", why)


def _check_truths(claim: Claim, inside: Sequence[Any]) -> None:
    """Raises RegimeFailure where the expression assigns, or gives a text or a number other than a count: nearly all of
    these would be true."""
    with suppress(syntax.SyntaxRefused):
        if syntax.Source(claim.expr, "expression").tree().type in syntax.ASSIGNMENTS:
            raise RegimeFailure("truth value", f"{claim.expr!r} assigns: compare with == in its place")
    for value in inside:
        if isinstance(value, str) or (isinstance(value, float) and not value.is_integer()):
            shown = repr(value) if isinstance(value, str) else f"{value:.6g}"
            why = f"{claim.expr!r} gives {shown}, which is neither true nor false: compare it, as in `x > 0`"
            raise RegimeFailure("truth value", why)


def _is_decided(claim: Claim, inside: Sequence[Any]) -> bool:
    """Whether values up to a reset decide the claim, whatever the run would have been like after it."""
    if claim.when not in ("always", "ever", "first"):
        return False
    deciding = claim.when != "always"
    return any(to_boolean(value) is deciding for value in inside)


def _measure(claim: Claim, run: LabRun, inside: Sequence[Any]) -> float | None:
    if claim.when in ("max", "min"):
        return (max if claim.when == "max" else min)(map(to_number, inside))
    truths = list(map(to_boolean, inside))
    if claim.when == "times":
        return float(sum(now and not before for before, now in pairwise(truths)))
    times = [time for time in run.times if time >= claim.since - TIME_SLACK_S]
    return next((time for time, true in zip(times, truths, strict=False) if true), None)
