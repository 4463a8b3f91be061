"""Recognises mistakes in what a learner's function computes from: the results are those of other arguments, of
another state or of another model."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import pi

import mujoco

from grader.exercises.explaining.claims import build_claims, uses
from grader.exercises.kinds.values.student_call import StudentCall, is_given_by

Variant = tuple[str, Callable[[StudentCall], bool]]


def explain_by_inputs(wrong: Sequence[StudentCall]) -> str | None:
    """Returns the sentence of a change of the inputs under which the reference gives the student's results."""
    return next((sentence for sentence, explains in list_variants(wrong[0]) if all(map(explains, wrong))), None)


def list_variants(first: StudentCall) -> Iterator[Variant]:
    """Yields the sentence of every change of arguments, state and model, with the change."""
    degrees = "You take {what} for degrees: it is in radians already, so do not convert it."
    radians = "You take radians for degrees in {what}: the trigonometric functions need radians."
    arguments = first.comparison.call.arguments
    for index, argument in enumerate(arguments):
        name = f"argument {index + 1}"
        if isinstance(argument, int):
            for step in (-1, 1):
                yield (
                    f"You are off by one step: {name} counts one step too {say_few_or_many(step)}.",
                    shift_argument(index, step),
                )
        elif not isinstance(argument, str):
            yield degrees.format(what=name), scale_argument(index, pi / 180)
            yield radians.format(what=name), scale_argument(index, 180 / pi)
        if not isinstance(argument, str):
            yield (
                f"A term with {name} is missing: your results are those for 0 in its place.",
                scale_argument(index, 0.0),
            )
    if first.problem.xml is not None:
        yield from ((sentence, change_model(change)) for sentence, change in WRONG_MODELS.items())
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


def say_few_or_many(step: int) -> str:
    """Returns the word for one step less or more."""
    return "few" if step < 0 else "many"


def shift_argument(index: int, step: int) -> Callable[[StudentCall], bool]:
    """Returns whether the results are those of an integer argument changed by one."""
    return change_argument(index, lambda value: int(value) + step)


def scale_argument(index: int, factor: float) -> Callable[[StudentCall], bool]:
    """Returns whether the results are those of an argument multiplied by a factor."""
    return change_argument(index, lambda value: type(value)(value * factor))


def change_argument(index: int, change: Callable[[float], float]) -> Callable[[StudentCall], bool]:
    """Returns whether the reference with one argument changed, element by element, gives the results."""

    def explains(student_call: StudentCall) -> bool:
        call = student_call.comparison.call
        arguments = list(call.arguments)
        arguments[index] = map_numbers(arguments[index], change)
        return is_given_by(student_call, replace(call, arguments=tuple(arguments)))

    return explains


def map_numbers(value: object, change: Callable[[float], float]) -> object:
    """Applies a change to every number of nested lists."""
    if isinstance(value, list):
        return [map_numbers(item, change) for item in value]
    return change(value) if isinstance(value, int | float) else value


def scale_state(name: str, factor: float) -> Callable[[StudentCall], bool]:
    """Returns whether the reference from a start with one part scaled gives the results."""

    def explains(student_call: StudentCall) -> bool:
        call = student_call.comparison.call
        if call.start[name] is None:
            return False
        start = {**call.start, name: [factor * value for value in call.start[name]]}
        return is_given_by(student_call, replace(call, start=start))

    return explains


def change_model(change: Callable[[mujoco.MjModel], None]) -> Callable[[StudentCall], bool]:
    """Returns whether the reference on a changed model gives the results."""
    return lambda call: is_given_by(call, change=change)


def scale_field(name: str, factor: float) -> Callable[[mujoco.MjModel], None]:
    """Returns a change that multiplies a field of the model, such as dof_armature or opt.gravity."""

    def change(model: mujoco.MjModel) -> None:
        owner = model.opt if name == "gravity" else model
        getattr(owner, name)[:] *= factor

    return change


def remove_mass(model: mujoco.MjModel) -> None:
    """Takes all mass away, as if every body were the world."""
    model.body_mass[:] = 0
    model.body_inertia[:] = 0
    model.body_ipos[:] = 0


COUNTS_BODIES = r"body 0 is the world, so count the others from body 1"

CLAIMS = build_claims([
    (COUNTS_BODIES, uses("body_", ".mass", ".inertia"), "a term with their masses is missing, such as the weight"),
])  # fmt: skip
"""The claims of these sentences: a script that reads no field of bodies cannot read those of the wrong one."""

WRONG_MODELS: Mapping[str, Callable[[mujoco.MjModel], None]] = {
    "The rotor inertia is missing: add the joint's armature to the inertia (model.dof_armature).": scale_field(
        "dof_armature", 0.0
    ),
    "The bodies' own inertia is missing: your results are those of point masses. Add model.body_inertia.": scale_field(
        "body_inertia", 1e-12
    ),
    f"Your results are those of bodies without mass: {COUNTS_BODIES}.": remove_mass,
    "The damping is missing: model.dof_damping times the velocity, against it.": scale_field("dof_damping", 0.0),
    "The damping has the wrong sign: it acts against the velocity.": scale_field("dof_damping", -1.0),
    "The springs are missing: add the joint's stiffness (model.jnt_stiffness).": scale_field("jnt_stiffness", 0.0),
    "Gravity is missing: a term with the weight of the bodies.": scale_field("gravity", 0.0),
    "Gravity has the wrong sign, as if it pulled upwards: turn it "
    "(a length read off a position may be negative).": scale_field("gravity", -1.0),
}
