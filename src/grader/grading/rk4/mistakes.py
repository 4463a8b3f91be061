"""Believable wrong Runge-Kutta steps: each a sentence for the student, and the method that makes the mistake."""

from dataclasses import dataclass

from grader.grading.rk4.methods import (
    CLASSICAL_STAGES,
    CLASSICAL_WEIGHTS,
    Method,
    chained,
    chained_positions,
    chained_to_the_end,
    first_velocity,
    four_moves,
    own_new_velocity,
    position_by_new_velocity,
    position_by_old_velocity,
    semi_implicit,
    staged,
    tableau,
)
from grader.grading.rk4.rotations import (
    in_the_world,
    quaternion_derivative,
    rate_in_the_world,
    rate_without_the_half,
)


@dataclass(frozen=True)
class WrongMethod:
    """A mistake: the sentence for the student, and the method that makes it.

    `on_rotations` is the sentence for models with quaternions, where it is another.
    """

    sentence: str
    method: Method
    on_rotations: str | None = None


THIRDS: tuple[tuple[float, ...], ...] = ((1 / 3,), (-1 / 3, 1), (1, -1, 1))
RALSTON_STAGES = (
    (0.4,),
    ((-2889 + 1428 * 5**0.5) / 1024, (3785 - 1620 * 5**0.5) / 1024),
    (
        (-3365 + 2094 * 5**0.5) / 6040,
        (-975 - 3046 * 5**0.5) / 2552,
        (467040 + 203968 * 5**0.5) / 240845,
    ),
)
RALSTON_WEIGHTS = (
    (263 + 24 * 5**0.5) / 1812,
    (125 - 1000 * 5**0.5) / 3828,
    1024 * (3346 + 1623 * 5**0.5) / 5924787,
    (30 - 4 * 5**0.5) / 123,
)
"""Source: Ralston 1962, the fourth-order tableau of least truncation error."""

GILL = 2**0.5
GILL_STAGES = ((1 / 2,), ((GILL - 1) / 2, (2 - GILL) / 2), (0, -GILL / 2, (2 + GILL) / 2))
GILL_WEIGHTS = (1 / 6, (2 - GILL) / 6, (2 + GILL) / 6, 1 / 6)
"""Source: Gill 1951."""

OTHER_TABLEAU = "Fourth order, but not MuJoCo's tableau: this is {name}. MuJoCo uses the classical weights 1, 2, 2, 1."

OTHER_TABLEAU_MOVED_ONCE = (
    "This is {name} with one mj_integratePos for all slopes, which is of second order on rotations only. MuJoCo does "
    "that with the classical weights 1, 2, 2, 1; another method counts where it is of fourth order on rotations too."
)


def other_tableau(name: str, method: Method) -> WrongMethod:
    """A method of fourth order, but for rotations."""
    return WrongMethod(OTHER_TABLEAU.format(name=name), method, OTHER_TABLEAU_MOVED_ONCE.format(name=name))


METHODS: tuple[WrongMethod, ...] = (
    WrongMethod("This is explicit Euler: one slope a step, taken at its start.", tableau((), (1,))),
    WrongMethod("This is semi-implicit Euler: one acceleration a step, not four.", semi_implicit),
    WrongMethod("This is the midpoint method: second order, two slopes a step.", tableau(((1 / 2,),), (0, 1))),
    WrongMethod("This is Heun's method: second order, two slopes a step.", tableau(((1,),), (1 / 2, 1 / 2))),
    WrongMethod("This is Kutta's third-order method.", tableau(((1 / 2,), (-1, 2)), (1 / 6, 2 / 3, 1 / 6))),
    other_tableau("Kutta's 3/8 rule", tableau(THIRDS, (1 / 8, 3 / 8, 3 / 8, 1 / 8))),
    other_tableau("Ralston's method", tableau(RALSTON_STAGES, RALSTON_WEIGHTS)),
    other_tableau("Gill's method", tableau(GILL_STAGES, GILL_WEIGHTS)),
    WrongMethod(
        "All four slopes have the same weight; the classical weights are 1, 2, 2, 1 over 6.",
        tableau(CLASSICAL_STAGES, (1 / 4,) * 4),
    ),
    WrongMethod(
        "The weights are those of the 3/8 rule (1, 3, 3, 1 over 8) on the classical stages; use 1, 2, 2, 1 over 6.",
        tableau(CLASSICAL_STAGES, (1 / 8, 3 / 8, 3 / 8, 1 / 8)),
    ),
    WrongMethod(
        "The weights do not sum to 1: the middle slopes count twice (1, 2, 2, 1 over 6).",
        tableau(CLASSICAL_STAGES, (1 / 6,) * 4),
    ),
    WrongMethod(
        "The weights 1, 2, 2, 1 are divided by 8, not by 6: they do not sum to 1.",
        tableau(CLASSICAL_STAGES, (1 / 8, 1 / 4, 1 / 4, 1 / 8)),
    ),
    WrongMethod(
        "The weights 1, 2, 2, 1 are divided by 4, not by 6: they do not sum to 1.",
        tableau(CLASSICAL_STAGES, (1 / 4, 1 / 2, 1 / 2, 1 / 4)),
    ),
    WrongMethod(
        "The weights 2 stand at the first and last slope, 1 in the middle: it is 1, 2, 2, 1.",
        tableau(CLASSICAL_STAGES, (1 / 3, 1 / 6, 1 / 6, 1 / 3)),
    ),
    WrongMethod(
        "All slopes equal the last one: data.qvel and data.qacc are views that the next mj_forward "
        "overwrites, so copy them.",
        tableau(CLASSICAL_STAGES, (0, 0, 0, 1)),
    ),
    WrongMethod(
        "All accelerations equal the last one: data.qacc is a view that the next mj_forward overwrites, so copy it.",
        tableau(CLASSICAL_STAGES, CLASSICAL_WEIGHTS, (0, 0, 0, 1)),
    ),
    WrongMethod(
        "All stage velocities equal the last one: data.qvel is a view that the next stage overwrites, so copy it.",
        tableau(CLASSICAL_STAGES, (0, 0, 0, 1), CLASSICAL_WEIGHTS),
    ),
    WrongMethod(
        "Your last stage stands at half the step; it belongs at its end.",
        tableau(((1 / 2,), (0, 1 / 2), (0, 0, 1 / 2)), CLASSICAL_WEIGHTS),
    ),
    WrongMethod(
        "Your stages 2 and 3 stand at the end of the step; they belong at its middle.",
        tableau(((1,), (0, 1), (0, 0, 1)), CLASSICAL_WEIGHTS),
    ),
    WrongMethod(
        "Your stage 3 stands at the end of the step; it belongs at its middle, like stage 2.",
        tableau(((1 / 2,), (0, 1), (0, 0, 1)), CLASSICAL_WEIGHTS),
    ),
    WrongMethod(
        "Your stage 3 starts from the first slope again; it needs stage 2's velocity and acceleration.",
        tableau(((1 / 2,), (1 / 2, 0), (0, 0, 1)), CLASSICAL_WEIGHTS),
    ),
    WrongMethod(
        "Your stage 4 goes on from stage 2's slope; it needs stage 3's velocity and acceleration.",
        tableau(((1 / 2,), (0, 1 / 2), (0, 1, 0)), CLASSICAL_WEIGHTS),
    ),
    WrongMethod(
        "Your stages 2, 3 and 4 all start from the first slope; each needs the velocity and acceleration of "
        "the stage before it.",
        tableau(((1 / 2,), (1 / 2, 0), (1, 0, 0)), CLASSICAL_WEIGHTS),
    ),
    WrongMethod(
        "Your stages move the position with their own new velocity; each needs the velocity of the stage before it.",
        staged(own_new_velocity),
    ),
    WrongMethod(
        "Your stages all move the position with the velocity at the start of the step; each needs the "
        "velocity of the stage before it.",
        staged(first_velocity),
    ),
    WrongMethod(
        "Each of your stages starts where the one before it stood, not from the start of the step: put q and "
        "v back before every stage.",
        staged(chained),
    ),
    WrongMethod(
        "Your stages move the positions in place: each starts where the one before it stood. Put qpos back "
        "to the start of the step before every stage.",
        staged(chained_positions),
    ),
    WrongMethod(
        "The state is not put back between the stages: q and v alias data.qpos and data.qvel, so copy them.",
        chained_to_the_end(),
    ),
    WrongMethod(
        "The velocity is not put back between the stages: v aliases data.qvel, so copy it.",
        chained_to_the_end(positions=False),
    ),
    WrongMethod(
        "The positions are moved in place by every stage and at the end: put qpos back to the start of the step before "
        "every mj_integratePos.",
        chained_to_the_end(velocities=False),
    ),
    WrongMethod(
        "The position is advanced with the new velocity alone; it needs the weighted mean of the four stage "
        "velocities.",
        position_by_new_velocity,
    ),
    WrongMethod(
        "The position is advanced with the velocity at the start of the step alone; it needs the weighted "
        "mean of the four stage velocities.",
        position_by_old_velocity,
    ),
    WrongMethod(
        "The position is moved four times, by one weighted velocity after the other; rotations do not add up "
        "like that: sum the velocities first, then move once.",
        four_moves,
    ),
    WrongMethod(
        "The angular velocity of a free or ball joint is given in the body's axes, not the world's: turn the "
        "quaternion from the other side.",
        in_the_world(tableau(CLASSICAL_STAGES, CLASSICAL_WEIGHTS)),
    ),
    WrongMethod(
        "The quaternion's derivative takes the angular velocity in the world's axes, as mju_derivQuat does; here it is "
        "given in the body's, so it is quat * (0, omega) / 2.",
        quaternion_derivative(rate_in_the_world),
    ),
    WrongMethod(
        "The quaternion turns twice as fast as it should: its derivative is quat * (0, omega) / 2, with the 1/2.",
        quaternion_derivative(rate_without_the_half),
    ),
)
