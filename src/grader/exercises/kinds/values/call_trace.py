"""Reads the trace of a `values` trial: what was returned, which functions of MuJoCo ran, which inputs were changed."""

import re
from collections.abc import Sequence
from dataclasses import replace
from math import isfinite, isnan

import mujoco
import numpy as np

from grader.exercises.judgement import tell_to_convert
from grader.exercises.kinds.values.judging.driver import STATE, compile_model, note_changes, start_data
from grader.exercises.kinds.values.student_call import StudentCall, is_given_by
from grader.exercises.rules import find_sentence
from grader.exercises.trace import ReturnedValue, Trace

STEPPERS = ("mj_step", "mj_step2", "mj_Euler", "mj_implicit", "mj_RungeKutta")
DERIVE = ("mj_forward", "mj_step1", "mj_fwdPosition", "mj_kinematics", "mj_inverse")
"""Functions that compute derived quantities from a state, and leave it as it is."""


def list_texts(trace: Trace, key: str) -> list[str]:
    """Returns the texts of a list in the note `used`; empty if there is none."""
    texts = next((note.info.get(key) for note in trace.list_notes("used")), None)
    return [item for item in texts if isinstance(item, str)] if isinstance(texts, list) else []


def explain_unreadable_results(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence for results that cannot be read, from what the function returned first."""
    values = [next(iter(call.trace.returned_values), None) for call in wrong]
    first, names = values[0], [result.name for result in wrong[0].problem.function.results if result.field is None]
    if tell_to_convert(wrong[0].comparison.answer.text):
        return None  # the finding says what to do
    if first is None or not names or any(value is None or value.type != first.type for value in values):
        return None
    if first.type == "dict" and {*KEY.findall(wrong[0].comparison.answer.text)} == {*names}:
        return f"Your function returns a dict in which not every value is a finite number: {say_cure(names)}"
    return explain_returned_value(first, names)


KEY = re.compile(r"'(\w+)': ")
"""A key of a dict as its text shows it."""

OTHER_TYPES = {
    "str": "a text",
    "function": "a function, which it does not call",
    "builtin_function_or_method": "a function, which it does not call",
    "method": "a function, which it does not call",
    "generator": "a generator, whose values are not computed yet",
    "dict": "a dict with other keys",
    "set": "a set, which has no order",
    "bool": "a truth value",
    "bool_": "a truth value",
    "complex": "a complex number",
    "complex128": "a complex number",
}
"""Types that are no results, in words."""


def explain_returned_value(value: ReturnedValue, names: Sequence[str]) -> str | None:
    """Returns what was returned in place of the results, and the cure."""
    cure = say_cure(names)
    if value.type in OTHER_TYPES:
        return f"Your function returns {OTHER_TYPES[value.type]}: {cure}"
    if value.type in ("tuple", "list") and value.shape != (len(names),) and len(names) > 1:
        return f"Your function returns {value.shape[0] if value.shape else 0} values, not {len(names)}: {cure}"
    numbers = [] if value.items else [number for number in value.numbers if not isfinite(number)]
    if numbers and value.type == "int":
        return "Your result is a whole number too large for a float: look for a power or a loop that grows without end."
    if numbers:
        what = "nan (not a number)" if any(map(isnan, numbers)) else "inf"
        return f"Your result is {what}: look for a division by zero, or a root or logarithm of a number below zero."
    return None


def say_cure(names: Sequence[str]) -> str:
    """Returns what to return, to end a sentence."""
    return f"return {' and '.join(names)} as {'a number or an array' if len(names) == 1 else 'numbers or arrays'}."


def explain_by_trace(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of what the trace shows in every wrong call, or None."""
    return find_sentence((explain_step, explain_other_shape, explain_changed_input), wrong)


def explain_step(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence for the right results of the state one step later."""
    stepped = [next((name for name in STEPPERS if name in list_texts(call.trace, "functions")), None) for call in wrong]
    if None in stepped or not all(map(is_right_after_a_step, wrong)):
        return None
    return (
        f"Your function calls {stepped[0]}, which advances data by a timestep, so that your results are those of a "
        "step later. Call mj_forward, which computes without moving."
    )


def is_right_after_a_step(student_call: StudentCall) -> bool:
    """Whether the results are the author's after one mj_step."""
    model = compile_model(student_call.problem.xml)
    if model is None:
        return False
    call = student_call.comparison.call
    data = start_data(model, call.start)
    mujoco.mj_step(model, data)
    start = {**call.start, "key": None, **{name: getattr(data, name).tolist() for name in STATE}}
    return is_given_by(student_call, replace(call, start=start))


def explain_missing_forward(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence for results of 0 from a function that computed nothing from the state of `data`."""
    if not all("data" in call.comparison.call.arguments for call in wrong):
        return None
    pairs = [pair for call in wrong for pair in call.wrong_pairs]
    if not pairs or any(np.any(got) or not np.any(right) for _, got, right in pairs):
        return None
    name = find_missing_call(wrong)
    return name and (
        f"Your results are 0, and your function never calls {name}: positions of bodies, inertia and forces in data "
        f"are not computed before that. Call mujoco.{name}(model, data) first."
    )


def find_missing_call(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the function by which the author's program computes derived quantities, where the student's function
    calls none that does."""
    if any({*list_texts(call.trace, "functions")} & {*DERIVE, *STEPPERS} for call in wrong):
        return None
    called = {*re.findall(r"\w+", wrong[0].problem.text)}
    return next((name for name in DERIVE if name in called), None)


def explain_other_shape(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence for results of one wrong shape."""
    shapes = {(result.name, got.shape, right.shape) for call in wrong for result, got, right in call.wrong_pairs}
    if len(shapes) != 1:
        return None
    ((name, got, right),) = shapes
    if got == right:
        return None
    return f"{name} is {describe_shape(got)} where {describe_shape(right)} is asked for: look at what you return."


def describe_shape(shape: tuple[int, ...]) -> str:
    """Returns `a single number`, or `an array of shape (3, 1)`."""
    return f"an array of shape {shape}" if shape else "a single number"


def explain_changed_input(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence for a function that returns its results and changes its inputs in every wrong trial, which
    the author's program leaves as they are."""
    if any(result.field for result in wrong[0].problem.function.results):
        return None
    meant = find_changed_by_author(wrong[0])
    changed = [[name for name in list_texts(call.trace, "changed") if name not in meant] for call in wrong]
    common = [name for name in changed[0] if all(name in names for names in changed)]
    if not common:
        return None
    name = common[0]
    copy = "data" if name.startswith("data.") else "model" if name.startswith("model.") else name
    return (
        f"Your function changes {name} in place, so that its later lines work with other numbers than those given. "
        f"Work on a copy of {copy}."
    )


def find_changed_by_author(student_call: StudentCall) -> set[str]:
    """Returns which parts of its inputs the author's program changes in a call."""
    problem, changed = student_call.problem, dict[str, None]()
    program = {problem.name: note_changes(problem.program[problem.name], changed)}
    problem.compute_results(student_call.comparison.call, program)
    return {*changed}
