"""Judges what was measured of a model against the reference, goal by goal."""

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grader.exercises.crashes import add_article
from grader.exercises.judgement import Judgement, Part, Results
from grader.exercises.kinds.model import measuring
from grader.exercises.kinds.model.parameters import Goal, Problem, list_asked_names
from grader.exercises.kinds.model.xml_faults import explain_xml
from grader.exercises.parameters import WrongInCase
from grader.sandbox.cleaning import read_json

LINE = re.compile(r"\b[Ll]ine (\d{1,6})\b")
NO_MODEL = "There is no model."
RETURN = "return MJCF text, or a mujoco.MjSpec"
KNOWN_TYPES = {
    "Element", "ElementTree", "MjData", "MjModel", "PosixPath", "bool", "dict", "float", "int", "list", "tuple",
}  # fmt: skip
"""Types that are named where a function returns them: another name may be the student's, with numbers of the case."""
MASS = re.compile(r"model\.body\('(\w+)'\)\.mass(?:\[0\])?")
OF_WATER = (
    "The body {body!r} weighs as much as its geoms of 1000 kg/m^3, MuJoCo's default: write its mass in a geom or in an "
    "<inertial>, which an MjSpec does with explicitinertial=True."
)
COLLIDES = (
    'Something collides {when}: write contype="0" and conaffinity="0" in every geom, or leave out a geom that was not '
    "asked for."
)
FIGURES = 5
FAULTS_MAX = 3
"""Most expressions of a goal that its finding says something of."""
SHOWN_MAX = 6
"""Most numbers of a value that are shown."""
NOISE = 1e-7
"""Numbers that are smaller, relative to the largest of the run, are shown as 0."""
CODE = re.compile(r"\.(?:integrator|cone|solver|jacobian|\w*type)\b")
"""Expressions whose numbers stand for names, so that none is larger than another."""
NO_RANGE = re.compile(r"model\.joint\('(\w+)'\)\.range")
"""Expressions that are 0 of a joint that nothing limits."""
QUATERNION = re.compile(r"quat\b")
"""Expressions whose sign does not matter: q and -q are the same rotation."""


@dataclass(frozen=True)
class ModelOutcome:
    """What was measured: of each goal the values of the student's model, as the measuring program reports them; the
    `geoms` of both models; and `error`, why MuJoCo could not compile the student's, or, with `is_plain`, the whole
    sentence on it."""

    goals: Sequence[Mapping[str, Any]] = ()
    geoms: Sequence[Any] = ()
    reference_geoms: Sequence[Any] = ()
    error: str = ""
    is_plain: bool = False
    missing: Sequence[str] = ()

    @property
    def line(self) -> int | None:
        """The line of the model that MuJoCo's message names."""
        match = LINE.search(self.error)
        return int(match[1]) if match else None


@dataclass(frozen=True)
class ExpressionComparison:
    """One expression of a goal: what is wrong with it, empty if nothing is, and its values for the finding."""

    fault: str = ""
    measured: Any = None
    expected: Any = None
    missing: tuple[str, ...] = field(default=())


def judge_model(problem: Problem, results: Results) -> Judgement[ModelOutcome]:
    """Returns the judgement on one case. Raises ValueError where the reference itself cannot be measured, which is a
    fault of the author's."""
    report = read_json(results["report"].tobytes())
    submitted, reference = report["model"], report["reference"]
    if "error" in reference:
        raise ValueError(f"the reference cannot be measured: {reference['error']}")
    if "returned" in submitted or submitted.get("braces"):
        sentence = explain_no_model(submitted)
        return Judgement(False, NO_MODEL, ModelOutcome(error=sentence, is_plain=True))
    if "error" in submitted:
        error = explain_xml(" ".join(str(submitted["error"]).split()))
        return Judgement(False, "MuJoCo cannot compile the model.", ModelOutcome(error=error))
    of_water = {*submitted["of_water"]} - {*reference["of_water"]}
    parts, missing = list[Part](), list[str]()
    for index, goal in enumerate(problem.case.goals):
        mine, its = submitted["goals"][index], reference["goals"][index]
        compared = explain_masses(dict(compare_goal(goal, mine, its, submitted["names"])), of_water)
        missing += [name for each in compared.values() for name in each.missing]
        parts.append(judge_goal(goal, str(index + 1), compared, runs=problem.case.seconds > 0))
    outcome = ModelOutcome(
        submitted["goals"], submitted["geoms"], reference["geoms"], missing=tuple(dict.fromkeys(missing))
    )
    message = next((part.message for part in parts if not part.passed), "The model is as it should be.")
    return Judgement(all(part.passed for part in parts), message, outcome, parts=tuple(parts))


def explain_no_model(submitted: Mapping[str, Any]) -> str:
    """Returns what to hand over in place of what is no model."""
    returned = str(submitted.get("returned", ""))
    if returned == measuring.FILE:
        return "What is handed over looks like the name of a file: hand over the MJCF itself, <mujoco> ... </mujoco>."
    if not returned:
        return f'In the MJCF, {submitted["braces"]}: in Python, an f-string fills the braces, f"...".'
    if returned == "NoneType":
        return f"The function returns nothing: {RETURN}."
    what = add_article(returned) if returned in KNOWN_TYPES else "something else"
    compiled = ", not the compiled model" if returned == "MjModel" else ""
    return f"The function returns {what}: {RETURN}{compiled}."


def require_values(problem: Problem) -> None:
    """Raises WrongInCase where an expression has no value of the reference where the case begins."""
    begin = measuring.describe(problem.reference, {**problem.measured, "seconds": 0}, halved=False)
    for index, goal in enumerate(begin.get("goals", ())):
        for part in ("same", "within"):
            for expression, claimed in goal[part].items():
                if "values" not in claimed:
                    why = f"has no {claimed['missing']!r}" if "missing" in claimed else f"raises {claimed['raised']}"
                    raise WrongInCase(f"goals.{index}.{part}", f"the reference {why} in {expression}: correct either")


def judge_goal(goal: Goal, id_: str, compared: Mapping[str, ExpressionComparison], *, runs: bool) -> Part:
    """Returns the finding of one goal; `runs` is whether its values are those at the end of a run."""
    wrong = {name: comparison for name, comparison in compared.items() if comparison.fault}
    wrong = dict(sorted(wrong.items(), key=lambda item: not item[1].missing))  # a name that lacks explains a number
    faults = list(dict.fromkeys(comparison.fault for comparison in wrong.values()))
    more = f"({len(faults) - FAULTS_MAX} more)" if len(faults) > FAULTS_MAX else ""
    message = " ".join(filter(None, [*faults[:FAULTS_MAX], more])) or "As it should be."
    shown = dict(list((wrong or compared).items())[:FAULTS_MAX])
    measured, expected = (
        "; ".join(f"{name} = {write_value(value)}" for name, value in values.items() if value is not None)
        for values in (
            {name: comparison.measured for name, comparison in shown.items()},
            {name: comparison.expected for name, comparison in shown.items()},
        )
    )
    detail = f"In yours{' at the end' if runs else ''}: {measured}." if wrong and measured else ""
    title = goal.title or ", ".join(compared)
    return Part(id_, title, not wrong, message, detail, measured or None, expected or None, goal.points)


def compare_goal(
    goal: Goal, mine: Mapping[str, Any], its: Mapping[str, Any], names: Mapping[str, Sequence[str]]
) -> Iterator[tuple[str, ExpressionComparison]]:
    """Yields each expression of a goal with what is wrong."""
    for expression in goal.same:
        one, other = mine["same"][expression], its["same"][expression]
        if "values" not in other:
            raise ValueError(f"the reference has no {expression}: {other}")
        comparison = compare_same(goal, expression, one, other)
        if not comparison.fault and mine["half"]:
            halves = compare_same(goal, expression, mine["half"][expression], its["half"][expression])
            if halves.fault:
                comparison = ExpressionComparison(
                    f"With half the timestep, {halves.fault[0].lower()}{halves.fault[1:]}"
                )
        yield expression, explain_missing(expression, one, names) or comparison
    for expression, allowed in goal.within.items():
        one, other = mine["within"][expression], its["within"][expression]
        if compare_range(goal, expression, other, allowed).fault:
            raise ValueError(f"the reference itself is out of the range of {expression}: {other}")
        comparison = compare_range(goal, expression, one, allowed)
        yield expression, explain_missing(expression, one, names) or comparison


def explain_missing(
    expression: str, measured: Mapping[str, Any], names: Mapping[str, Sequence[str]]
) -> ExpressionComparison | None:
    """Returns the fault of an expression that asks for an element which the model lacks; None where it does not."""
    if "missing" not in measured:
        return None
    name = str(measured["missing"])
    kind = next((kind for kind, asked in list_asked_names(expression) if asked == name), "")
    kind = kind or next(iter(kind for kind in ("joint", "actuator") if name not in names[kind]), "element")
    there = names.get(kind, ())
    fault = f"The model has no {kind} {name!r}"
    if near := get_close_matches(name, [*filter(None, there)], 1):
        fault += f", but one named {near[0]!r}"
    elif "" in there:
        fault += f', only one without a name: write name="{name}"'
    return ExpressionComparison(f"{fault}.", missing=(name,))


def explain_masses(compared: Mapping[str, ExpressionComparison], of_water: Set[str]) -> dict[str, ExpressionComparison]:
    """Returns the comparisons, with a sentence on each wrong mass that is that of the geoms of water."""
    explained = dict(compared)
    for expression, comparison in compared.items():
        body = MASS.fullmatch(expression)
        if comparison.fault and body and body[1] in of_water:
            explained[expression] = replace(comparison, fault=OF_WATER.format(body=body[1]))
    return explained


def compare_same(goal: Goal, expression: str, one: Mapping[str, Any], other: Mapping[str, Any]) -> ExpressionComparison:
    """Returns how the values of an expression differ from those of the reference."""
    its = read_values(other)
    if "values" not in one:
        return ExpressionComparison(
            f"{expression} cannot be had: {one.get('raised', 'it is missing')}.", None, shorten(its)
        )
    mine = read_values(one)
    measured, expected = shorten(mine), shorten(its)
    if "lost" in one and "lost" not in other:
        return ExpressionComparison("The simulation blows up, and MuJoCo gives it up.", None, expected)
    if mine is None or its is None or mine.shape != its.shape:
        return ExpressionComparison(f"{expression} has another number of values.", measured, expected)
    scale = float(np.nanmax(np.abs(its), initial=0.0))
    signs = (1, -1) if QUATERNION.search(expression) else (1,)
    errors = [np.abs(sign * mine - its) for sign in signs]
    error = min(errors, key=lambda each: float(np.nan_to_num(each, nan=np.inf).max(initial=0.0)))
    if bool(np.all(error <= goal.atol + goal.rtol * scale)):
        return ExpressionComparison("", measured, expected)
    free = NO_RANGE.fullmatch(expression)
    if free and not mine.any():
        return ExpressionComparison(f"The joint {free[1]!r} has no range.", measured, expected)
    return ExpressionComparison(describe_difference(expression, mine, its), measured, expected)


def describe_difference(expression: str, mine: NDArray[np.float64], its: NDArray[np.float64]) -> str:
    """Returns in which way values differ from those of the reference."""
    if len(its) > 1 and bool(np.any(its != its[0])):
        return f"{expression} does not move as it should."
    mine, its = mine[-1:], its[-1:]
    if its.size == 1 and not CODE.search(expression):
        way = "larger" if float(mine.flat[0]) > float(its.flat[0]) else "smaller"
        return f"{expression} is {way} than it should be."
    return f"{expression} is not what it should be."


def compare_range(
    goal: Goal, expression: str, measured: Mapping[str, Any], allowed: Sequence[float]
) -> ExpressionComparison:
    """Returns whether the values of an expression are within a range."""
    low, high = allowed
    if "values" not in measured:
        return ExpressionComparison(
            f"{expression} cannot be had: {measured.get('raised', 'it is missing')}.", None, [low, high]
        )
    values = read_values(measured)
    if "lost" in measured or values is None or not values.size:
        return ExpressionComparison("The simulation blows up, and MuJoCo gives it up.", None, [low, high])
    looked = values if goal.when == "always" else values[-1:]
    if bool(np.all((looked >= low) & (looked <= high))):
        return ExpressionComparison("", shorten(looked), [low, high])
    way = "too large" if bool(np.any(looked > high)) else "too small"
    when = "at some time" if goal.when == "always" and len(looked) > 1 else "at the end" if len(values) > 1 else ""
    if expression == "data.ncon" and high == 0:
        return ExpressionComparison(COLLIDES.format(when=when or "from the start"), float(looked.max()), [low, high])
    worst = looked.max() if way == "too large" else looked.min()
    return ExpressionComparison(
        f"{expression} is {way} {when}".rstrip() + ".", float(f"{worst:.{FIGURES}g}"), [low, high]
    )


def read_values(measured: Mapping[str, Any]) -> NDArray[np.float64] | None:
    """Returns the values at the moments of a run (n, numbers), NaN for what is not finite; None where they are no such
    table."""
    try:
        values = np.array(measured["values"], dtype=np.float64)
    except (KeyError, TypeError, ValueError):
        return None
    return values.reshape(len(values), -1)


def shorten(values: NDArray[np.float64] | None) -> Any:
    """Returns the last values as plain JSON: a number, or a list of the first few."""
    if values is None or not values.size:
        return None
    least = NOISE * float(np.nanmax(np.abs(values), initial=0.0))
    last = [value if abs(value) > least or not np.isfinite(value) else 0.0 for value in values[-1][:SHOWN_MAX].tolist()]
    numbers = [float(f"{value:.{FIGURES}g}") if np.isfinite(value) else None for value in last]
    return numbers[0] if len(numbers) == 1 else numbers


def write_value(value: Any) -> str:
    """Returns a value as a finding shows it."""
    if isinstance(value, list):
        return f"[{', '.join(map(write_value, value))}]"
    return "not finite" if value is None else f"{value:.4g}"
