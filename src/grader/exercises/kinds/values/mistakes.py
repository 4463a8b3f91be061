"""Recognises mistakes in any `values` exercise: computes what each gives, and compares with the student's results."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from math import pi

import mujoco
import numpy as np

from grader.exercises.kind import Judged
from grader.exercises.kinds.values.asked import Asked, gives
from grader.exercises.kinds.values.driver import Rows, compiled, started
from grader.exercises.kinds.values.judge import Outcome, fits, largest, tolerance
from grader.exercises.kinds.values.parameters import Problem, Result, ValuesParameters
from grader.exercises.kinds.values.recorded import by_trace, never_derived, unreadable

SWAPS_MAX = 4
"""The largest number of results or elements of which every order is tried."""

DECIMALS = range(1, 9)
"""Decimals to which a result may be rounded."""

PATTERN_MIN = 3
"""Fewer numbers than this show no pattern."""

Explains = Callable[[Sequence[Asked]], bool]
"""Returns whether a mistake gives the results of the wrong calls."""


def name_the_mistake(parameters: ValuesParameters, judged: Sequence[Judged[Problem, Outcome]]) -> str | None:
    """Returns the sentence for the first function that is wrong: the mistake and the cure; None if no mistake fits."""
    first = next((one.trial.problem.name for one in judged if not one.judgement.passed), None)
    asked = [
        Asked(one.trial.problem, compared, one.trace, one.trial.hidden)
        for one in judged
        if one.trial.problem.name == first
        for compared in one.judgement.outcome
    ]
    with np.errstate(all="ignore"):  # a student's numbers may be as large as a double can hold
        found = sentence_of(asked)
    several = len(parameters.functions) > 1
    return f"{first}: {found}" if found and several else found


def sentence_of(asked: Sequence[Asked]) -> str | None:
    """Returns the sentence of the first mistake that explains every wrong call."""
    wrong = [one for one in asked if one.compared.why]
    if not wrong:
        return None
    if any(one.compared.answer.values is None for one in wrong):
        return missing(wrong) or unreadable(wrong)
    if (empty := never_derived(wrong)) is not None:
        return empty
    if is_stale(asked):
        return "You give the same results for every call: compute them from the arguments of the call."
    if any(one.compared.expected is None for one in wrong):
        return by_programs(wrong)
    return (
        by_programs(wrong)
        or by_results(wrong)
        or by_state(wrong)
        or by_inputs(wrong)
        or by_trace(wrong)
        or by_pattern(wrong)
    )


def missing(wrong: Sequence[Asked]) -> str | None:
    """Returns the sentence for a function that returns nothing."""
    if any(one.compared.answer.text != "None" for one in wrong if one.compared.answer.values is None):
        return None
    if any(one.compared.answer.printed for one in wrong):
        return "Your function prints its result and returns None: return it instead."
    return "Your function returns None: end it with `return` and the results."


def is_stale(asked: Sequence[Asked]) -> bool:
    """Whether every call gave the same results although the arguments or starts, and the right results, differ."""
    answers = [one.compared.answer.values or () for one in asked]
    if any(one.compared.call == asked[0].compared.call for one in asked[1:]) or len(asked) < 2:
        return False
    rights = [one.compared.expected for one in asked if one.compared.expected is not None]
    return all(same(answers[0], other) for other in answers) and not (
        len(rights) == len(asked) and all(same(rights[0], other) for other in rights)
    )


def same(one: Sequence[Rows], other: Sequence[Rows]) -> bool:
    """Whether all arrays are equal."""
    return len(one) == len(other) and all(map(np.array_equal, one, other))


def by_programs(wrong: Sequence[Asked]) -> str | None:
    """Returns the sentence of the first of the author's wrong programs that gives the student's results."""
    for index, (_, sentence) in enumerate(wrong[0].problem.mistakes):
        if all(gives(one, program=one.problem.mistakes[index][0]) for one in wrong):
            return sentence
    return None


@dataclass(frozen=True)
class WrongResult:
    """A mistake that turns a right result into `altered(result)`; {name} in the sentence is the name of the result."""

    sentence: str
    altered: Callable[[Rows], Rows]


def transposed(right: Rows) -> Rows:
    """Returns the transpose of a matrix; anything else unchanged."""
    return right.T if right.ndim == 2 else right


RESULTS: tuple[WrongResult, ...] = (
    WrongResult(
        "{name} has the wrong sign: it is the negative of what it should be. Check the direction.", np.negative
    ),
    WrongResult("{name} is twice what it should be: look for a factor of 2 too many.", lambda right: 2 * right),
    WrongResult("{name} is half of what it should be: look for a missing factor of 2.", lambda right: right / 2),
    WrongResult("{name} is in degrees: give it in radians.", np.rad2deg),
    WrongResult("{name} was converted to radians once too often: its angles are in radians already.", np.deg2rad),
    WrongResult("{name} is 1000 times too large: look for milli-units.", lambda right: 1000 * right),
    WrongResult("{name} is 1000 times too small: look for milli-units.", lambda right: right / 1000),
    WrongResult("{name} is transposed: swap its rows and columns.", transposed),
)


def by_results(wrong: Sequence[Asked]) -> str | None:
    """Returns the sentence of a mistake that the results alone show."""
    names = " and ".join(dict.fromkeys(result.name for one in wrong for result, _, _ in one.wrong))
    if all(swapped(one) for one in wrong):
        return "Your results are in the wrong order: return them as the exercise lists them."
    for mistake in RESULTS:
        if all(fits(result, got, mistake.altered(right)) for one in wrong for result, got, right in one.wrong):
            return mistake.sentence.format(name=names)
    pairs = [pair for one in wrong for pair in one.wrong]
    if all(permuted(*pair) for pair in pairs):
        return f"The elements of {names} are in the wrong order: check which comes first."
    if all(shifted(*pair) for pair in pairs):
        return f"{names} is off by one step: each row is one step early or late. Check where you start and store."
    if all(got.size == right.size and fits(result, got.reshape(right.shape), right) for result, got, right in pairs):
        return f"{names} has the right numbers in the wrong shape: give it the shape that the exercise asks for."
    return None


def by_pattern(wrong: Sequence[Asked]) -> str | None:
    """Returns the sentence of results that differ from the right ones in the same way everywhere."""
    pairs = [pair for one in wrong for pair in one.wrong]
    if any(got.shape != right.shape for _, got, right in pairs):
        return None
    names = " and ".join(dict.fromkeys(result.name for result, _, _ in pairs))
    for decimals in DECIMALS:
        if all(rounded(pair, decimals) for pair in pairs):
            return (
                f"{names} is rounded to {decimals} decimals: return the number as it is, and round only what you print."
            )
    rights = np.concatenate([right.ravel() for _, _, right in pairs])
    if rights.size < PATTERN_MIN or np.ptp(rights) <= max(tolerance(result, right) for result, _, right in pairs):
        return None
    _, got, right = max(pairs, key=lambda pair: largest(pair[2]))
    at = np.argmax(np.abs(right))
    offset, factor = (got - right).flat[at], (got.flat[at] / right.flat[at] if right.flat[at] else 0.0)
    if all(fits(result, got, right + offset) for result, got, right in pairs):
        return (
            f"{names} is off by the same amount in every result: a constant is missing or one too many, or you count "
            "from another zero."
        )
    if factor and all(fits(result, got, factor * right) for result, got, right in pairs):
        return f"{names} is {factor:.4g} times what it should be in every result: look for a constant factor."
    return None


def rounded(pair: tuple[Result, Rows, Rows], decimals: int) -> bool:
    """Whether a result is right but for its rounding; it must keep two figures to tell."""
    result, got, right = pair
    unit = 10.0**-decimals
    off = largest(got - right) <= unit / 2 + tolerance(result, right)
    return off and largest(got) >= 10 * unit and np.array_equal(got, np.round(got, decimals))


def swapped(asked: Asked) -> bool:
    """Whether the results are right in another order."""
    pairs = asked.pairs
    orders = permutations([got for _, got, _ in pairs]) if len(pairs) <= SWAPS_MAX else ()
    return any(
        all(fits(result, got, right) for (result, _, right), got in zip(pairs, order, strict=True)) for order in orders
    )


def permuted(result: Result, got: Rows, right: Rows) -> bool:
    """Whether a vector is right in another order."""
    if got.shape != right.shape or right.ndim != 1 or right.size > SWAPS_MAX:
        return False
    return any(fits(result, got[list(order)], right) for order in permutations(range(right.size)))


def shifted(result: Result, got: Rows, right: Rows) -> bool:
    """Whether the rows are shifted by one step, or one row at an end is missing or too many."""
    if got.ndim != right.ndim or right.ndim == 0 or min(len(got), len(right)) < 3:
        return False
    if len(got) == len(right):
        return fits(result, got[1:], right[:-1]) or fits(result, got[:-1], right[1:])
    longer, shorter = (got, right) if len(got) > len(right) else (right, got)
    return len(longer) == len(shorter) + 1 and (fits(result, longer[1:], shorter) or fits(result, longer[:-1], shorter))


def by_state(wrong: Sequence[Asked]) -> str | None:
    """Returns the sentence of a mistake that the state after a step shows."""
    if not all(result.field for one in wrong for result in one.problem.function.results):
        return None
    if all(unchanged(one) for one in wrong):
        return "data is left as it was: write into its fields in place, such as data.qpos[:] = ..."
    if all(gives(one, times=2) for one in wrong):
        return "You are off by one step: data is advanced twice in one call."
    if all(explicit(one) for one in wrong):
        return (
            "Your step is explicit: positions move with the velocity at the start of the step. In a semi-implicit "
            "step the velocity is advanced first, and positions move with the new one."
        )
    return left_alone(wrong)


def left_alone(wrong: Sequence[Asked]) -> str | None:
    """Returns the sentence of fields that every wrong call leaves as they were."""
    kept = [{result.field for result, _, _ in one.wrong} & {*unchanged_fields(one)} for one in wrong]
    fields = [result.field for result in wrong[0].problem.function.results if all(result.field in one for one in kept)]
    if not fields:
        return None
    names = " and ".join(f"data.{field}" for field in fields)
    were = "is left as it was: write its new value" if len(fields) == 1 else "are left as they were: write new values"
    because = " data.qacc is 0 until mj_forward has computed it: call it first." if "qvel" in fields else ""
    return f"{names} {were} in place, as you do for the rest.{because}"


def state_of(asked: Asked, advance: Callable[[mujoco.MjModel, mujoco.MjData], None]) -> Mapping[str, Rows]:
    """Returns the state of a call's start after `advance`, by field."""
    model = compiled(asked.problem.xml)
    assert model is not None
    data = started(model, asked.compared.call.start)
    advance(model, data)
    return {
        result.field: np.array(getattr(data, result.field), dtype=np.float64)
        for result in asked.problem.function.results
        if result.field
    }


def unchanged(asked: Asked) -> bool:
    """Whether data is unchanged."""
    return len(unchanged_fields(asked)) == len(asked.pairs)


def unchanged_fields(asked: Asked) -> list[str]:
    """Returns the fields of data that are as before the call."""
    start = state_of(asked, lambda model, data: None)
    return [result.field for result, got, _ in asked.pairs if result.field and fits(result, got, start[result.field])]


def explicit(asked: Asked) -> bool:
    """Whether positions alone are wrong, and are those that the velocity at the start of the step gives."""

    def drift(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)

    moved = state_of(asked, drift)
    return all(result.field == "qpos" and fits(result, got, moved["qpos"]) for result, got, _ in asked.wrong)


Variant = tuple[str, Callable[[Asked], bool]]


def by_inputs(wrong: Sequence[Asked]) -> str | None:
    """Returns the sentence of a change of the inputs under which the reference gives the student's results."""
    return next((sentence for sentence, explains in variants(wrong[0]) if all(map(explains, wrong))), None)


def variants(first: Asked) -> Iterator[Variant]:
    """Yields the sentence of every change of arguments, state and model, with the change."""
    degrees = "You take {what} for degrees: it is in radians already, so do not convert it."
    radians = "You take radians for degrees in {what}: the trigonometric functions need radians."
    arguments = first.compared.call.arguments
    for index, argument in enumerate(arguments):
        name = f"argument {index + 1}"
        if isinstance(argument, int):
            for step in (-1, 1):
                yield f"You are off by one step: {name} counts one step too {few_or_many(step)}.", shift(index, step)
        elif not isinstance(argument, str):
            yield degrees.format(what=name), scale(index, pi / 180)
            yield radians.format(what=name), scale(index, 180 / pi)
        if not isinstance(argument, str):
            yield f"A term with {name} is missing: your results are those for 0 in its place.", scale(index, 0.0)
    if first.problem.xml is not None:
        yield from ((sentence, changed(change)) for sentence, change in MODELS)
        yield degrees.format(what="data.qpos"), scale_state("qpos", pi / 180)
        yield radians.format(what="data.qpos"), scale_state("qpos", 180 / pi)
        yield "A term with the velocity is missing: your results are those at rest. Add it.", scale_state("qvel", 0.0)
        yield (
            "A term is missing: your results are those without control. Add the term with data.ctrl.",
            scale_state("ctrl", 0.0),
        )
        yield (
            "Your results are those of the opposite velocity: check the signs of the terms with it.",
            scale_state("qvel", -1.0),
        )


def few_or_many(step: int) -> str:
    """Returns the word for one step less or more."""
    return "few" if step < 0 else "many"


def shift(index: int, step: int) -> Callable[[Asked], bool]:
    """Returns whether the results are those of an integer argument changed by one."""
    return with_argument(index, lambda value: int(value) + step)


def scale(index: int, factor: float) -> Callable[[Asked], bool]:
    """Returns whether the results are those of an argument multiplied by a factor."""
    return with_argument(index, lambda value: type(value)(value * factor))


def with_argument(index: int, change: Callable[[float], float]) -> Callable[[Asked], bool]:
    """Returns whether the reference with one argument changed, element by element, gives the results."""

    def explains(asked: Asked) -> bool:
        call = asked.compared.call
        arguments = list(call.arguments)
        arguments[index] = nested(arguments[index], change)
        return gives(asked, replace(call, arguments=tuple(arguments)))

    return explains


def nested(value: object, change: Callable[[float], float]) -> object:
    """Applies a change to every number of nested lists."""
    if isinstance(value, list):
        return [nested(item, change) for item in value]
    return change(value) if isinstance(value, int | float) else value


def scale_state(name: str, factor: float) -> Callable[[Asked], bool]:
    """Returns whether the reference from a start with one part scaled gives the results."""

    def explains(asked: Asked) -> bool:
        call = asked.compared.call
        if call.start[name] is None:
            return False
        start = {**call.start, name: [factor * value for value in call.start[name]]}
        return gives(asked, replace(call, start=start))

    return explains


def changed(change: Callable[[mujoco.MjModel], None]) -> Callable[[Asked], bool]:
    """Returns whether the reference on a changed model gives the results."""
    return lambda asked: gives(asked, change=change)


def scaled_field(name: str, factor: float) -> Callable[[mujoco.MjModel], None]:
    """Returns a change that multiplies a field of the model, such as dof_armature or opt.gravity."""

    def change(model: mujoco.MjModel) -> None:
        owner = model.opt if name == "gravity" else model
        getattr(owner, name)[:] *= factor

    return change


def weightless(model: mujoco.MjModel) -> None:
    """Takes all mass away, as if every body were the world."""
    model.body_mass[:] = 0
    model.body_inertia[:] = 0
    model.body_ipos[:] = 0


MODELS: tuple[tuple[str, Callable[[mujoco.MjModel], None]], ...] = (
    (
        "The rotor inertia is missing: add the joint's armature to the inertia (model.dof_armature).",
        scaled_field("dof_armature", 0.0),
    ),
    (
        "The bodies' own inertia is missing: your results are those of point masses. Add model.body_inertia.",
        scaled_field("body_inertia", 1e-12),
    ),
    (
        "Your results are those of bodies without mass: body 0 is the world, so count the others from body 1.",
        weightless,
    ),
    ("The damping is missing: subtract model.dof_damping times the velocity.", scaled_field("dof_damping", 0.0)),
    ("The damping has the wrong sign: it acts against the velocity.", scaled_field("dof_damping", -1.0)),
    ("The springs are missing: add the joint's stiffness (model.jnt_stiffness).", scaled_field("jnt_stiffness", 0.0)),
    ("Gravity is missing: add its torque.", scaled_field("gravity", 0.0)),
    (
        "Gravity has the wrong sign, as if it pulled upwards: turn it (a length read off a position may be negative).",
        scaled_field("gravity", -1.0),
    ),
)
