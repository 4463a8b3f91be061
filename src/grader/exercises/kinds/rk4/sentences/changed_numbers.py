"""Says what a step does to its numbers beside the formula: it rounds them, cuts them off, adds to its slopes, or
multiplies by h too often."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from grader.exercises.kinds.rk4.combinations import Combination, Term, format_coefficient
from grader.exercises.kinds.rk4.sentences.states import CUT_ATOL, moves_with
from grader.exercises.kinds.rk4.sentences.tableaus import STAGES, join_words, spell_number
from grader.exercises.kinds.rk4.step_trace import Rows, Step
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Reading

Combinations = Sequence[Combination | None]

CONSTANT_RTOL = 1e-10
"""Round-off of an acceleration that is read off a change of velocity, relative to the largest acceleration."""

CUTS_MIN = 2
"""The fewest velocities of equal size that count as cut off."""

SHARE_ATOL = 1e-12
"""Round-off of a change of velocity that is a share of another, relative to the velocity."""

EXACT, INEXACT = 1e-9, 1e-3
"""Relative errors of a timestep: round-off, and the largest of two roundings to 16 bits."""

ROUNDED = 1e-10
"""Relative error of a slope in 64 bits at most."""

WHOLE = 2
"""The stage, counted from the second, that lies a whole step from the start."""

NOISE = 1e-15
"""Round-off of a change that is read off a state, relative to the largest number of that."""

ROUNDED_SUMS = ((1, 2, (1, 0, 0, 0)), (STAGES, 6, (1, 2, 2, 1)), (STAGES, 1, CLASSICAL[-1]))
"""Rows of a step: what h is divided by there, and the sum of slopes that it multiplies."""

DECIMALS = range(3, 13)
"""Decimals to which a state may be rounded."""


def explain_inexact_timestep(reading: Reading) -> str | None:
    """Returns the sentence of a classical step whose h is not model.opt.timestep, or nearly: it has lost digits."""
    steps = [step for step in reading.steps if step.calls == STAGES]
    shares = [read_shares(step) for step in steps]
    if not steps or any(row is None for row in shares):
        return None
    timesteps = np.array([step.timestep_s for step in steps])
    off = np.array(shares) - 1
    largest = float(np.abs(off).max())
    if not EXACT < largest <= INEXACT:
        return None
    wrong = np.flatnonzero(np.any(np.abs(off) > EXACT, axis=0)).tolist()
    if len(wrong) < off.shape[1]:
        stages = [str(row + 2) for row in wrong if row + 2 <= STAGES]
        places = [f"stage{'s' if len(stages) > 1 else ''} {join_words(stages)}"] if stages else []
        places += ["the weighted sum"] if STAGES - 1 in wrong else []
        return (
            f"In {' and in '.join(places)} the factor of your slopes is off by up to {largest:.2g} of itself: take "
            "h/2, h/2, h and h/6 of h = model.opt.timestep, in Python floats with all their digits."
        )
    more = off * timesteps[:, None]
    if np.ptp(off) <= EXACT:
        seen = f"is {1 + float(off.mean()):.9g} times model.opt.timestep"
    elif np.ptp(more) <= EXACT * timesteps.min():
        seen = (
            f"is {abs(float(more.mean())):.3g} s {'longer' if more.mean() > 0 else 'shorter'} than model.opt.timestep"
        )
    else:
        lengths = (1 + off[:, WHOLE]) * timesteps
        rounded = {bits: timesteps.astype(f"float{bits}").astype(np.float64) for bits in (32, 16)}
        bits = next((bits for bits in rounded if np.allclose(lengths, rounded[bits], rtol=EXACT, atol=0)), None)
        seen = f"is off by up to {largest:.2g} of model.opt.timestep"
        seen += "" if bits is None else f": it goes through {bits}-bit floats, as with np.float{bits}"
    return f"Your h {seen}. Take h = model.opt.timestep as it is, a Python float."


def read_shares(step: Step) -> Rows | None:
    """Returns by how many timesteps each stage and the result of a classical step of four calls move velocities, over
    as many as they should; None where they move in another way."""
    shares = []
    for row, weights in enumerate(CLASSICAL[1:], 2):
        right = step.timestep_s * (np.array(weights) @ step.qacc[1 : len(weights) + 1])
        change = step.qvel[row] - step.qvel[0]
        share = float(right @ change) / (float(right @ right) or 1.0)
        scale = 1 + float(np.abs(step.qvel[0]).max(initial=0.0)) + float(np.abs(change).max(initial=0.0))
        if float(np.abs(change - share * right).max(initial=0.0)) > SHARE_ATOL * scale:
            return None
        shares.append(share)
    return np.array(shares)


def explain_truncated_slopes(reading: Reading) -> str | None:
    """Returns the sentence of slopes that have lost their fractions."""
    steps = reading.steps
    if reading.calls < 2 or not all(moves_with(step, np.trunc(step.qacc[1])) for step in steps):
        return None
    if not any(np.any(np.trunc(step.qacc[1])) for step in steps):
        return None
    return (
        "The slopes in your stages are cut off to whole numbers: an array of whole numbers, such as np.array([0, 0]) "
        "or one with dtype=int, keeps no fractions. Make it of floats, such as np.zeros(model.nv)."
    )


@dataclass(frozen=True, eq=False)
class Move:
    """A move of a part of the state by `factor` times a sum of slopes, as the step makes it and as it should."""

    factor: float
    slopes: Rows
    change: Rows
    noise: float

    @property
    def error(self) -> float:
        """By how much the change is off, beyond round-off, relative to its largest number."""
        right = self.factor * self.slopes
        size = float(np.abs(right).max(initial=0.0))
        off = float(np.abs(self.change - right).max(initial=0.0)) - self.noise
        return max(off, 0.0) / size if size else 0.0

    def is_rounded(self, bits: int) -> bool:
        """Whether the change is that of slopes rounded to so many bits, or of their product with the factor."""
        kind = np.dtype(f"float{bits}")
        with np.errstate(over="ignore"):
            slopes = self.slopes.astype(kind)
            products = (
                self.factor * slopes.astype(np.float64),
                (self.factor * slopes).astype(np.float64),
                (self.factor * self.slopes).astype(kind).astype(np.float64),
            )
        return any(bool(np.all(np.abs(self.change - product) <= self.noise)) for product in products)


def find_bits(moves: Sequence[Move]) -> int | None:
    """Returns to how many bits the slopes of some moves are rounded; None if they are not, or it is not known."""
    if not moves or np.median([move.error for move in moves]) <= ROUNDED:
        return None
    return next((bits for bits in (32, 16) if all(move.is_rounded(bits) for move in moves)), None)


def explain_rounded_slopes(reading: Reading) -> str | None:
    """Returns the sentence of slopes, or of their sum, that are rounded to 32 or 16 bits: a row that cannot be read is
    that of the classical step, but for the last digits."""
    if not reading.has_four_calls:
        return None
    parts: list[tuple[str, Combinations, str, Callable[[Step], Rows]]] = [
        ("The slopes", reading.velocities, "qvel", lambda step: step.qacc[1:])
    ]
    if reading.model.nq == reading.model.nv:
        parts.append(("The slopes of data.qpos", reading.positions, "qpos", lambda step: step.qvel[1:-1]))
    if reading.activations:
        parts.append(("The slopes of data.act", reading.activations, "act", lambda step: step.rate))
    for row, divisor, weights in ROUNDED_SUMS:
        for what, rows, field, slopes in parts:
            if rows[row] is not None:
                continue
            states = [(step, getattr(step, field)) for step in reading.steps]
            moves = [
                Move(step.timestep_s / divisor, np.array(weights) @ slopes(step), state[row + 1] - state[0],
                     NOISE * (1 + float(np.abs(state).max(initial=0.0))))
                for step, state in states
            ]  # fmt: skip
            if (bits := find_bits(moves)) is not None:
                whose = what if row < STAGES else "The weighted sum"
                return f"{whose} went through {bits}-bit floats: use NumPy's default, float64."
    return None


def explain_rounded_state(reading: Reading) -> str | None:
    """Returns the sentence of a state that is rounded: to 32 or 16 bits, or to some decimals at the end."""
    steps = [step for step in reading.steps if step.calls]
    if not steps:
        return None
    for bits, field in product((32, 16), ("qpos", "qvel", "act")):
        pairs = [(getattr(step, field)[0], getattr(step, field)[1]) for step in steps]
        if is_rounded(pairs, bits):
            return f"The state went through {bits}-bit floats: use NumPy's default, float64."
    if not reading.has_four_calls:
        return None
    ends = [step.qvel[0] + step.timestep_s * (np.array(CLASSICAL[-1]) @ step.qacc[1:]) for step in steps]
    pairs = [(end, step.qvel[-1]) for step, end in zip(steps, ends, strict=True)]
    for bits in (32, 16):
        if is_rounded(pairs, bits):
            return f"The state went through {bits}-bit floats: use NumPy's default, float64."
    for decimals in DECIMALS:
        if all(np.array_equal(np.round(end, decimals), seen) for end, seen in pairs):
            return f"Your step rounds its result to {decimals} decimals: round what you print, not the state."
    return None


def is_rounded(pairs: Sequence[tuple[Rows, Rows]], bits: int) -> bool:
    """Whether the second of each pair is the first, rounded to so many bits, and some differ."""
    rounded = [right.astype(f"float{bits}").astype(np.float64) for right, _ in pairs]
    return all(map(np.array_equal, rounded, (seen for _, seen in pairs))) and not all(
        np.array_equal(right, seen) for right, seen in pairs
    )


def explain_clipped_velocities(reading: Reading) -> str | None:
    """Returns the sentence of velocities that are those of the classical step, cut off at one size."""
    bounds: list[float] = []
    for step in reading.steps:
        if step.calls != STAGES:
            return None
        end = step.qvel[0] + step.timestep_s * (np.array(CLASSICAL[-1]) @ step.qacc[1:])
        wrong = np.abs(step.qvel[-1] - end) > CUT_ATOL * (1 + np.abs(end))
        if np.any(np.abs(step.qvel[-1][wrong]) >= np.abs(end[wrong])):
            return None
        bounds += np.abs(step.qvel[-1][wrong]).tolist()
    if len(bounds) < CUTS_MIN or max(bounds) - min(bounds) > CUT_ATOL * max(bounds):
        return None
    if max(bounds) == 0:
        return (
            "Your step sets a velocity to 0 that is not: MuJoCo does not, since a joint limit is a force in data.qacc. "
            "Leave data.qpos and data.qvel as the formula gives them."
        )
    return f"Your step cuts velocities off at {bounds[0]:.4g}: MuJoCo does not, so leave data.qvel as it comes out."


def explain_added_constant(reading: Reading) -> str | None:
    """Returns the sentence of accelerations to which the same numbers are added in every step."""
    if not reading.has_four_calls:
        return None
    added = [2 * (step.qvel[2] - step.qvel[0]) / step.timestep_s - step.qacc[1] for step in reading.steps]
    scale = CONSTANT_RTOL * max(float(np.max(np.abs(step.qacc))) for step in reading.steps)
    if np.max(np.abs(added[0])) < 1e3 * scale or any(np.max(np.abs(force - added[0])) > scale for force in added):
        return None
    number = added[0][0]
    what = f"{number:.4g}" if np.all(np.abs(added[0] - number) <= scale) else "a constant"
    return (
        f"Your accelerations are data.qacc plus {what}, at every state: gravity and all other forces are in data.qacc "
        "already, so integrate it as mj_forward leaves it."
    )


def explain_own_drag(velocities: Sequence[Combination | None]) -> str | None:
    """Returns the sentence of accelerations to which a multiple of the velocities is added."""
    first = velocities[1] if len(velocities) > 1 and velocities[1] else {}
    drag, share = first.get(Term("v", 1)), first.get(Term("a", 1))
    if drag is None or not share:
        return explain_mistyped_slope(velocities)
    return (
        f"Your accelerations are data.qacc {'plus' if drag > 0 else 'minus'} {format_coefficient(abs(drag / share))} "
        "times the velocity: damping and drag belong to the model, and data.qacc holds them already. Integrate it as "
        "mj_forward leaves it."
    )


def explain_mistyped_slope(velocities: Sequence[Combination | None]) -> str | None:
    """Returns the sentence of a velocity in the place of an acceleration."""
    for row, moves in enumerate(velocities, 1):
        mistyped = [term.stage for term in moves or () if term.slope == "v"]
        if moves and len(mistyped) == 1 < len(moves):
            where = f"In your stage {row}" if row < len(velocities) else "At the end of your step"
            return (
                f"{where} the velocity moves by a velocity, that of stage {mistyped[0]}, where an acceleration "
                "belongs: the slope of data.qvel is data.qacc. Look for a mistyped name there."
            )
    return None


def explain_powers_of_h(reading: Reading) -> str | None:
    """Returns the sentence of slopes that are not multiplied by h exactly once."""
    for rows, slope, what in ((reading.velocities, "a", "velocity"), (reading.positions, "v", "position")):
        if any(row is None for row in rows):
            continue
        used = [{term.power for term in row if term.slope == slope} for row in rows if row is not None]
        if not any(numbers - {1} for numbers in used):
            continue
        number = find_fixed_timestep(rows, slope)
        if number is not None:
            return (
                f"Your step is {number:g} s long whatever the timestep of the model is: use model.opt.timestep, not a "
                "fixed number."
            )
        return describe_power(used, rows, slope, what)
    return None


def find_fixed_timestep(rows: Combinations, slope: str) -> float | None:
    """Returns the number [s] that every row has in the place of h; None if there is none."""
    weights = {term: value for term, value in (rows[-1] or {}).items() if term.slope == slope}
    if not weights or any(term.power for row in rows if row for term in row if term.slope == slope):
        return None
    number = sum(weights.values())
    return number if 0 < number < 0.1 else None  # the weights of a fixed step sum to it, those without h to about 1


def describe_power(used: Sequence[set[int]], rows: Combinations, slope: str, what: str) -> str:
    """Returns the sentence of a row that is multiplied by h too often, or not at all."""
    *stages, result = used
    weights = {term.stage: term.power for term in rows[-1] or {} if term.slope == slope}
    off = any(power != 1 for power in weights.values())
    if result == {2} and all(2 in numbers for numbers in stages[1:]):
        return (
            f"h is applied twice to the {what}, in every stage and at the end: once to the slope, and once where it is "
            "added. mj_integratePos multiplies by h itself."
        )
    if result == {2}:
        return (
            f"h is applied twice to the {what}: once in k, once in the sum. If your k are already multiplied by h, the "
            "result is the start plus (k1 + 2 k2 + 2 k3 + k4)/6."
        )
    if result == {0}:
        return (
            f"The weighted sum that advances the {what} is not multiplied by h: add h times the sum to the start of "
            "the step."
        )
    if off:
        return describe_powers_of_sum(weights, what)
    stage = next(index for index, powers in enumerate(stages, 1) if powers - {1})
    how = "h twice" if 2 in used[stage - 1] else "a slope without h"
    return f"The {what} of your stage {stage} moves by {how}: a stage moves by a fraction of h, times a slope."


def describe_powers_of_sum(weights: Mapping[int, int], what: str) -> str:
    """Returns the sentence of weighted slopes of which some are multiplied by h too often, or not at all; `weights` are
    the powers of h by stages."""
    off = [stage for stage, power in weights.items() if power != 1]
    if len(off) == len(weights):
        return (
            f"The factor of the weighted sum that advances the {what} is not h/6 at every timestep: print it, and "
            "compare it with model.opt.timestep / 6."
        )
    if all(weights[stage] > 1 for stage in off):
        return (
            f"In the weighted sum of the {what} h is applied twice to {join_words([f'k{stage}' for stage in off])}: "
            "once before, once in the sum. A slope that is multiplied in place (k *= h) stays so."
        )
    return (
        f"{spell_number(len(off)).capitalize()} of the {spell_number(len(weights))} weighted slopes of the {what} "
        f"{'is' if len(off) == 1 else 'are'} not multiplied by h/6: put parentheses around the whole sum, h/6 * (k1 + "
        "2*k2 + 2*k3 + k4)."
    )
