"""Recognises mistakes in any `values` exercise: computes what each gives, and compares with the student's results."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import permutations

import mujoco
import numpy as np

from grader.exercises.kind import JudgedTrial, Mistake
from grader.exercises.kinds.values.call_trace import (
    explain_by_trace,
    explain_missing_forward,
    explain_unreadable_results,
    find_missing_call,
)
from grader.exercises.kinds.values.input_mistakes import explain_by_inputs
from grader.exercises.kinds.values.judging.driver import Rows, compile_model, start_data
from grader.exercises.kinds.values.judging.judge import (
    Comparisons,
    compare_residual,
    compute_tolerance,
    find_largest,
    fits,
)
from grader.exercises.kinds.values.mutants.matching import RunJob, name_edit
from grader.exercises.kinds.values.parameters import Problem, Result, ValuesParameters
from grader.exercises.kinds.values.student_call import StudentCall, is_given_by
from grader.exercises.rules import find_sentence

SWAPS_MAX = 4
"""The largest number of results or elements of which every order is tried."""

DECIMALS = range(1, 9)
"""Decimals to which a result may be rounded."""

PLURALS = {"is": "are", "has": "have", "was": "were"}

PATTERN_MIN = 3
"""Fewer numbers than this show no pattern."""


def name_the_mistake(parameters: ValuesParameters, judged: Sequence[JudgedTrial[Problem, Comparisons]]) -> str | None:
    """Returns the sentence for the first function that is wrong: the mistake and the cure; None if no mistake fits."""
    calls = list_calls(judged)
    sentence = find_mistake(calls)
    return add_function(write_plural(sentence, calls), parameters, calls) if sentence else None


def name_by_edits(
    parameters: ValuesParameters, judged: Sequence[JudgedTrial[Problem, Comparisons]], run: RunJob
) -> Mistake | None:
    """Returns the mistake for the first function that is wrong, found by edits of its program and of the author's; None
    if none fits. Raises JailFault."""
    calls = list_calls(judged)
    mistake = name_edit(calls, judged[0].script.source, run)
    return replace(mistake, sentence=add_function(mistake.sentence, parameters, calls)) if mistake else None


def list_calls(judged: Sequence[JudgedTrial[Problem, Comparisons]]) -> list[StudentCall]:
    """Returns the calls of the first function that is wrong."""
    first = next((trial.problem.name for trial in judged if not trial.judgement.passed), None)
    return [
        StudentCall(trial.problem, compared, trial.trace, trial.hidden)
        for trial in judged
        if trial.problem.name == first
        for compared in trial.judgement.outcome
    ]


def write_plural(sentence: str, calls: Sequence[StudentCall]) -> str:
    """Returns a sentence with its verb in the plural where it begins with the names of several results."""
    name = "|".join(re.escape(result.name) for result in calls[0].problem.function.results)
    return re.sub(
        rf"^((?:{name})(?: and (?:{name}))+) ({'|'.join(PLURALS)}) ", lambda at: f"{at[1]} {PLURALS[at[2]]} ", sentence
    )


def add_function(sentence: str, parameters: ValuesParameters, calls: Sequence[StudentCall]) -> str:
    """Returns a sentence with the name of the function that it is about, where the exercise has several."""
    return f"{calls[0].problem.name}: {sentence}" if len(parameters.functions) > 1 else sentence


def find_mistake(calls: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of the first mistake that explains every wrong call."""
    wrong = [call for call in calls if call.comparison.why]
    if not wrong:
        return None
    if any(call.comparison.answer.values is None for call in wrong):
        return explain_missing(wrong) or explain_unreadable_results(wrong)
    if (authored := explain_by_programs(wrong)) is not None:
        return authored
    is_compared = all(call.comparison.expected is not None for call in wrong)  # else a residual decides
    if is_compared and (sentence := find_sentence(FIRST_RULES, wrong)) is not None:
        return sentence
    if is_stale(calls):
        return "You give the same results for every call: they must depend on the arguments of the call."
    return find_sentence(RULES, wrong) if is_compared else explain_by_residual(wrong)


def explain_missing(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence for a function that returns nothing."""
    if any(call.comparison.answer.text != "None" for call in wrong if call.comparison.answer.values is None):
        return None
    if any(call.comparison.answer.printed for call in wrong):
        return "Your function prints its result and returns None: return it instead."
    return "Your function returns None: end it with `return` and the results."


def is_stale(calls: Sequence[StudentCall]) -> bool:
    """Whether every call gave the same results although the arguments or starts, and the right results, differ."""
    answers = [call.comparison.answer.values or () for call in calls]
    if any(call.comparison.call == calls[0].comparison.call for call in calls[1:]) or len(calls) < 2:
        return False
    rights = [call.comparison.expected for call in calls if call.comparison.expected is not None]
    return all(is_same(answers[0], other) for other in answers) and not (
        len(rights) == len(calls) and all(is_same(rights[0], other) for other in rights)
    )


def is_same(one: Sequence[Rows], other: Sequence[Rows]) -> bool:
    """Whether all arrays are equal."""
    return len(one) == len(other) and all(map(np.array_equal, one, other))


def explain_by_programs(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of the first of the author's wrong programs that gives the student's results."""
    for index, (_, sentence) in enumerate(wrong[0].problem.mistakes):
        if all(is_given_by(call, program=call.problem.mistakes[index][0]) for call in wrong):
            return sentence
    return None


@dataclass(frozen=True)
class WrongResult:
    """A mistake that turns a right result into `alter(result)`, and `mend` back; {name} in the sentence is the name of
    the result."""

    sentence: str
    alter: Callable[[Rows], Rows]
    mend: Callable[[Rows], Rows]


def transpose(right: Rows) -> Rows:
    """Returns the transpose of a matrix; anything else unchanged."""
    return right.T if right.ndim == 2 else right


WRONG_RESULTS: tuple[WrongResult, ...] = (
    WrongResult(
        "{name} has the wrong sign: it is the negative of what it should be. Check the direction.",
        np.negative, np.negative,
    ),
    WrongResult(
        "{name} is twice what it should be: look for a factor of 2 too many.", partial(np.multiply, 2),
        partial(np.multiply, 0.5),
    ),
    WrongResult(
        "{name} is half of what it should be: look for a missing factor of 2.", partial(np.multiply, 0.5),
        partial(np.multiply, 2),
    ),
    WrongResult("{name} is in degrees: give it in radians.", np.rad2deg, np.deg2rad),
    WrongResult(
        "{name} was converted to radians once too often: its angles are in radians already.", np.deg2rad, np.rad2deg
    ),
    WrongResult(
        "{name} is 1000 times too large: look for milli-units.", partial(np.multiply, 1000), partial(np.multiply, 0.001)
    ),
    WrongResult(
        "{name} is 1000 times too small: look for milli-units.", partial(np.multiply, 0.001), partial(np.multiply, 1000)
    ),
    WrongResult("{name} is transposed: swap its rows and columns.", transpose, transpose),
)  # fmt: skip


def explain_by_residual(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of a mistake in one result, or in all, without which they satisfy the author's residual."""
    names = [result.name for result in wrong[0].problem.function.results]
    for mistake in WRONG_RESULTS:
        for altered in dict.fromkeys([*((name,) for name in names), tuple(names)]):
            if all(satisfies_mended(call, altered, mistake.mend) for call in wrong):
                return mistake.sentence.format(name=" and ".join(altered))
    return None


def satisfies_mended(call: StudentCall, altered: Sequence[str], mend: Callable[[Rows], Rows]) -> bool:
    """Whether a call's results have the declared shapes and satisfy the residual, once these are mended."""
    asked, answer = call.comparison.call, call.comparison.answer
    named = zip(call.problem.function.results, answer.values or (), strict=True)
    mended = tuple(mend(got) if result.name in altered else got for result, got in named)
    # Before anything is computed: arrays of other shapes broadcast to huge ones.
    fits_shapes = [array.shape for array in mended] == call.problem.list_shapes(asked)
    return fits_shapes and not compare_residual(call.problem, asked, answer, mended).why


def explain_by_results(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of a mistake that the results alone show."""
    names = " and ".join(dict.fromkeys(result.name for call in wrong for result, _, _ in call.wrong_pairs))
    if all(is_swapped(call) for call in wrong):
        return "Your results are in the wrong order: return them as the exercise lists them."
    for mistake in WRONG_RESULTS:
        if all(fits(result, got, mistake.alter(right)) for call in wrong for result, got, right in call.wrong_pairs):
            return mistake.sentence.format(name=names)
    pairs = [pair for call in wrong for pair in call.wrong_pairs]
    if all(is_permuted(*pair) for pair in pairs):
        return f"The elements of {names} are in the wrong order: check which comes first."
    if all(is_shifted(*pair) for pair in pairs):
        return f"{names} is off by one step: each row is one step early or late. Check where you start and store."
    if all(got.size == right.size and fits(result, got.reshape(right.shape), right) for result, got, right in pairs):
        return f"{names} has the right numbers in the wrong shape: give it the shape that the exercise asks for."
    return None


def explain_by_pattern(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of results that differ from the right ones in the same way everywhere."""
    pairs = [pair for call in wrong for pair in call.wrong_pairs]
    if any(got.shape != right.shape for _, got, right in pairs):
        return None
    names = " and ".join(dict.fromkeys(result.name for result, _, _ in pairs))
    for decimals in DECIMALS:
        if all(is_rounded(pair, decimals) for pair in pairs):
            return (
                f"{names} is rounded to {decimals} decimals: return the number as it is, and round only what you print."
            )
    rights = np.concatenate([right.ravel() for _, _, right in pairs])
    if rights.size < PATTERN_MIN or np.ptp(rights) <= max(
        compute_tolerance(result, right) for result, _, right in pairs
    ):
        return None
    _, got, right = max(pairs, key=lambda pair: find_largest(pair[2]))
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


def is_rounded(pair: tuple[Result, Rows, Rows], decimals: int) -> bool:
    """Whether a result is right but for its rounding; it must keep two figures to tell."""
    result, got, right = pair
    unit = 10.0**-decimals
    off = find_largest(got - right) <= unit / 2 + compute_tolerance(result, right)
    return off and find_largest(got) >= 10 * unit and np.array_equal(got, np.round(got, decimals))


def is_swapped(call: StudentCall) -> bool:
    """Whether the results are right in another order."""
    pairs = call.pairs
    orders = permutations([got for _, got, _ in pairs]) if len(pairs) <= SWAPS_MAX else ()
    return any(
        all(fits(result, got, right) for (result, _, right), got in zip(pairs, order, strict=True)) for order in orders
    )


def is_permuted(result: Result, got: Rows, right: Rows) -> bool:
    """Whether a vector is right in another order."""
    if got.shape != right.shape or right.ndim != 1 or right.size > SWAPS_MAX:
        return False
    return any(fits(result, got[list(order)], right) for order in permutations(range(right.size)))


def is_shifted(result: Result, got: Rows, right: Rows) -> bool:
    """Whether the rows are shifted by one step, or one row at an end is missing or too many."""
    if got.ndim != right.ndim or right.ndim == 0 or min(len(got), len(right)) < 3:
        return False
    if len(got) == len(right):
        return fits(result, got[1:], right[:-1]) or fits(result, got[:-1], right[1:])
    longer, shorter = (got, right) if len(got) > len(right) else (right, got)
    return len(longer) == len(shorter) + 1 and (fits(result, longer[1:], shorter) or fits(result, longer[:-1], shorter))


def explain_unchanged_data(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of a function that leaves data as it was; of one that returns its results, where to."""
    fields = [result.field for result in wrong[0].problem.function.results]
    if not all(fields) or not all(is_unchanged(call) for call in wrong):
        return None
    names = " and ".join(f"data.{field}" for field in fields)
    if all(value.type != "NoneType" for call in wrong for value in call.trace.returned_values[:1]):
        return f"data is left as it was, and your function returns a value: write into {names} in place instead."
    return f"data is left as it was: write into {names} in place, as in data.{fields[0]}[:] = ..."


def explain_by_state(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of a mistake that the state after a step shows."""
    if not all(result.field for call in wrong for result in call.problem.function.results):
        return None
    if all(is_given_by(call, times=2) for call in wrong):
        return "You are off by one step: data is advanced twice in one call."
    if all(is_explicit(call) for call in wrong):
        return (
            "Your step is explicit: positions move with the velocity at the start of the step. In a semi-implicit "
            "step the velocity is advanced first, and positions move with the new one."
        )
    return explain_unchanged_fields(wrong)


def explain_unchanged_fields(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of fields that every wrong call leaves as they were."""
    unchanged = [{result.field for result, _, _ in call.wrong_pairs} & {*list_unchanged_fields(call)} for call in wrong]
    fields = [
        result.field for result in wrong[0].problem.function.results if all(result.field in one for one in unchanged)
    ]
    if not fields:
        return None
    names = " and ".join(f"data.{field}" for field in fields)
    were = "is left as it was: write its new value" if len(fields) == 1 else "are left as they were: write new values"
    missing = find_missing_call(wrong) if "qvel" in fields else None
    because = f" data.qacc is 0 until {missing} has computed it: call it first." if missing == "mj_forward" else ""
    return f"{names} {were} in place, as you do for the rest.{because}"


def compute_state(call: StudentCall, advance: Callable[[mujoco.MjModel, mujoco.MjData], None]) -> Mapping[str, Rows]:
    """Returns the state of a call's start after `advance`, by field."""
    model = compile_model(call.problem.xml)
    assert model is not None
    data = start_data(model, call.comparison.call.start)
    advance(model, data)
    return {
        result.field: np.array(getattr(data, result.field), dtype=np.float64)
        for result in call.problem.function.results
        if result.field
    }


def is_unchanged(call: StudentCall) -> bool:
    """Whether data is unchanged."""
    return len(list_unchanged_fields(call)) == len(call.pairs)


def list_unchanged_fields(call: StudentCall) -> list[str]:
    """Returns the fields of data that are as before the call."""
    start = compute_state(call, lambda model, data: None)
    return [result.field for result, got, _ in call.pairs if result.field and fits(result, got, start[result.field])]


def is_explicit(call: StudentCall) -> bool:
    """Whether positions alone are wrong, and are those that the velocity at the start of the step gives."""

    def drift(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)

    moved = compute_state(call, drift)
    return all(result.field == "qpos" and fits(result, got, moved["qpos"]) for result, got, _ in call.wrong_pairs)


FIRST_RULES: tuple[Callable[[Sequence[StudentCall]], str | None], ...] = (
    explain_missing_forward, explain_unchanged_data,
)  # fmt: skip
"""Rules that come before that of results which are the same for every call."""

RULES: tuple[Callable[[Sequence[StudentCall]], str | None], ...] = (
    explain_by_results, explain_by_state, explain_by_inputs, explain_by_trace, explain_by_pattern,
)  # fmt: skip
"""Rules that may explain every wrong call of a function; the first one that does gives the diagnosis."""
