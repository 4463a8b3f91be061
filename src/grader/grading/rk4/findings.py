"""The findings of a judged step, in sentences."""

from math import isfinite

from grader.domain.verdict import Finding
from grader.grading.rk4.outcomes import MUJOCO_ORDER, OrderOutcome, Outcome
from grader.grading.rk4.truth import ORDER


def case_finding(outcome: Outcome, points: float) -> Finding:
    """One case's outcome, without the numbers of the case."""
    return Finding(
        id=outcome.case.id,
        title=outcome.title,
        passed=outcome.right,
        points=points if outcome.right else 0.0,
        max_points=points,
        message=case_message(outcome),
        measured={name: shown(value) for name, value in outcome.difference.largest.items()},
        expected=f"at most {outcome.case.tolerance:g} from MuJoCo's RK4"
        + (", or as near to the truth as a fourth-order method" if outcome.may_converge else ""),
    )


def case_message(outcome: Outcome) -> str:
    """One sentence."""
    if not len(outcome.student):
        return "The first step left the state not finite."
    if not outcome.keeps_time:
        return "data.time is not where it should be: advance it by model.opt.timestep in every step."
    if outcome.agrees:
        return f"Agrees with MuJoCo's RK4 to {outcome.difference.worst:.1e}{to_truth(outcome)}."
    if outcome.is_near_truth:
        return (
            f"Not MuJoCo's method (differs by {outcome.difference.worst:.1e}) but nearer to the truth: its error is "
            f"{outcome.error:.1e}, that of a fourth-order method."
        )
    if not outcome.difference.complete:
        return f"After step {len(outcome.student)} the state is no longer finite."
    return f"Departs from MuJoCo's RK4 at step {outcome.first_departure}, and by {outcome.difference.worst:.1e} in all."


def to_truth(outcome: Outcome) -> str:
    """The error against the truth of a visible case where both count."""
    if not outcome.may_converge or outcome.case.hidden:
        return ""
    return f"; both are {outcome.error:.1e} from the truth"


def order_finding(order: OrderOutcome, first: Outcome, points: float) -> Finding:
    """Fourth order, or the order of MuJoCo's own method where the student's agrees with it on the `first` case."""
    as_mujoco = first.agrees and first.may_converge and order.is_about(MUJOCO_ORDER)
    passed = order.is_fourth or as_mujoco
    return Finding(
        id="order",
        title="observed order",
        passed=passed,
        points=points if passed else 0.0,
        max_points=points,
        message=order_message(order, as_mujoco),
        measured=None if order.slope is None else round(order.slope, 3),
        expected=f"4 within {order.check.tolerance:g}, or errors as small as those of a fourth-order method",
    )


def order_message(order: OrderOutcome, as_mujoco: bool) -> str:
    """One sentence."""
    if order.ignores_timestep:
        return (
            "After as many steps the state is the same at every timestep: use model.opt.timestep, not a fixed number."
        )
    if order.slope is not None:
        return f"The error shrinks with order {order.slope:.2f}{order_remark(order, order.slope, as_mujoco)}."
    if order.is_fourth:
        return "Too near to the exact motion for an order to be measured: nearer than a fourth-order method must be."
    why = "it is round-off at some timesteps, large at others" if order.finite else "some run did not stay finite"
    return f"The error against the exact motion shows no order: {why}."


def order_remark(order: OrderOutcome, slope: float, as_mujoco: bool) -> str:
    """What a slope means."""
    if order.is_fourth:
        return ": fourth order" if order.is_about(ORDER) else ": with errors this small, as good as fourth order"
    if as_mujoco:
        return ", as that of MuJoCo 3.14.0's own RK4 does on rotations; a method of fourth order there is right too"
    if slope > ORDER:
        return ", but only because it is far too large at the largest timesteps"
    return "; a fourth-order method has 4"


def refused_finding(refused: str) -> Finding:
    """What the guard refused, for an instructor to look at."""
    return Finding(
        id="guard",
        title="ways round",
        passed=None,
        points=0.0,
        max_points=0.0,
        message=f"The script tried what this exercise does not allow ({refused}): an instructor will look at it.",
    )


def shown(value: float) -> float | None:
    """A difference to three figures; None where the run ended early (JSON has no infinity)."""
    return float(f"{value:.3g}") if isfinite(value) else None
