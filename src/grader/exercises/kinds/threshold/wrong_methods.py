"""Wrong ways to the largest stable timestep, each with the test whether it gives a claim: by its closed form, or by
simulating the same wrong way."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi

import mujoco
import numpy as np

from grader.exercises.kinds.threshold.judging.judge import (
    Bracket,
    Claim,
    NoLimit,
    bracket_around,
    judge_claim,
)
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters
from grader.numerics.integrators import DISCRETE, EULER, IMPLICITFAST, RK4
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.stability.horizon import warns_within
from grader.numerics.stability.servo import Servo

FORMULA_TOLERANCE = 5e-4
"""Relative difference of a claim from a formula, which students report as an end or as the middle of the bracket.

Source: leaving the body's own inertia out of I changes the lesson's bound by 2e-4.
"""

NUMBER_TOLERANCE = 5e-3
"""Relative difference of a single number from a formula: it may be rounded, 22.4 ms for 22.365 ms."""

WIDEST = 1.25
"""The largest high end over the low one of a bracket that tells methods apart: a wider one holds the limits of many."""

METHOD_TOLERANCE = 0.005
"""Relative difference between two programs of one wrong method (rounding of the number of steps, the criterion)."""


@dataclass(frozen=True)
class ClaimContext:
    """The question behind one claim: its cell, and the cell of the first case under the same integrator."""

    parameters: ThresholdParameters
    cell: Cell
    first: Cell


Predicate = Callable[[ClaimContext, Claim], bool]


@dataclass(frozen=True)
class WrongMethod:
    """A mistake: the sentence for the student, and whether the mistake gives a claim. The mistake must explain every
    wrong claim; with `all_claims` also the right ones, which may be right by accident. At least one wrong claim must
    hold numbers, unless `of_numbers` is false: a claim of `None` has many explanations."""

    id: str
    matches: Predicate
    sentence: str
    all_claims: bool = False
    of_numbers: bool = True


def read_servo(cell: Cell) -> Servo | None:
    """Inertia and gains read off a model of one joint and one position servo; None for any other model."""
    model = cell.scene.model
    if model.nv != 1 or model.nu != 1:
        return None
    kp, kv = float(model.actuator_gainprm[0, 0]), float(-model.actuator_biasprm[0, 2])
    if kp <= 0 or kv < 0 or model.actuator_biasprm[0, 1] != -kp:
        return None
    return Servo(float(model.dof_M0[0]), kp, kv)


def make_formula_test(value: Callable[[Servo], float]) -> Predicate:
    """Returns the method that reports a closed form."""

    def matches(context: ClaimContext, claim: Claim) -> bool:
        servo = read_servo(context.cell)
        if servo is None:
            return False
        limit = value(servo)
        if not isinstance(claim, Bracket):
            return isinstance(claim, NoLimit) and limit > context.parameters.search_s[1]
        tolerance = FORMULA_TOLERANCE if claim.number is None else NUMBER_TOLERANCE
        ends = (claim.low, claim.high, (claim.low + claim.high) / 2)
        return any(abs(end - limit) <= tolerance * limit for end in ends)

    return matches


def make_simulation_test(
    change: Callable[[Scene], Scene | None] = lambda scene: scene, *, code: int | None = None, seconds: float = 0
) -> Predicate:
    """Returns the method that bisects correctly, but another scene, another integrator, or another run length."""

    def matches(context: ClaimContext, claim: Claim) -> bool:
        scene = change(context.cell.scene)
        return scene is not None and is_bisection_of(context, claim, scene, code, seconds=seconds)

    return matches


def is_bisection_of(
    context: ClaimContext, claim: Claim, scene: Scene, code: int | None = None, *, seconds: float = 0
) -> bool:
    """Whether a bisection of this scene ends in this claim; the run may be one step longer or shorter."""
    integrator = context.cell.integrator.code if code is None else code
    horizon = seconds or context.parameters.horizon_s
    shortest, longest = context.parameters.search_s
    if isinstance(claim, NoLimit):
        return not warns_within(scene, longest, horizon, integrator=integrator)
    if not isinstance(claim, Bracket) or not shortest / 2 <= claim.low <= claim.high <= 2 * longest:
        return False
    if claim.high > WIDEST * claim.low:
        return False
    low, high = claim.low * (1 - METHOD_TOLERANCE), claim.high * (1 + METHOD_TOLERANCE)
    stays = not warns_within(scene, low, horizon - low, integrator=integrator)
    return stays and warns_within(scene, high, horizon + high, integrator=integrator)


def remove_kv(scene: Scene) -> Scene:
    """Returns the servo without its damper."""

    def change(model: mujoco.MjModel) -> None:
        model.actuator_biasprm[:, 2] = 0

    return scene.changed(change)


def move_damping_to_joint(scene: Scene) -> Scene | None:
    """Returns the damper in the joint instead of the servo."""
    if scene.model.nv != 1 or scene.model.nu != 1:
        return None

    def change(model: mujoco.MjModel) -> None:
        model.dof_damping[0] -= model.actuator_biasprm[0, 2]
        model.actuator_biasprm[0, 2] = 0

    return scene.changed(change)


def uses_pgs(context: ClaimContext, claim: Claim) -> bool:
    """Another constraint solver, which matters under `discrete` alone."""

    def change(model: mujoco.MjModel) -> None:
        model.opt.solver = mujoco.mjtSolver.mjSOL_PGS

    return context.cell.integrator.code == DISCRETE.code and is_bisection_of(
        context, claim, context.cell.scene.changed(change)
    )


def is_in_milliseconds(context: ClaimContext, claim: Claim) -> bool:
    """The right claim, a thousand times as large."""
    return isinstance(claim, Bracket) and judge_claim(context.parameters, context.cell, claim.scale(1e-3)).passed


def is_in_hertz(context: ClaimContext, claim: Claim) -> bool:
    """The reciprocal of the right claim."""
    if not isinstance(claim, Bracket) or not all(end > 1 for end in claim.numbers):
        return False
    ends = sorted(1 / end for end in claim.numbers)
    timestep = bracket_around(ends[0]) if len(ends) == 1 else Bracket(*ends)
    return judge_claim(context.parameters, context.cell, timestep).passed


def has_swapped_ends(context: ClaimContext, claim: Claim) -> bool:
    """The right bracket with swapped ends."""
    if not isinstance(claim, Bracket) or claim.number is not None or claim.width >= 0:
        return False
    return judge_claim(context.parameters, context.cell, Bracket(claim.high, claim.low)).passed


def is_too_wide(context: ClaimContext, claim: Claim) -> bool:
    """A bracket that holds the limit but is too wide."""
    if not isinstance(claim, Bracket) or claim.width <= context.parameters.width_s:
        return False
    return is_bisection_of(context, claim, context.cell.scene)


def is_no_limit(context: ClaimContext, claim: Claim) -> bool:
    """None where there is a limit."""
    return isinstance(claim, NoLimit)


def swings_out(context: ClaimContext, timestep_s: float) -> bool:
    """Whether a coordinate moves further from zero than its start."""
    rollout = simulate(
        context.cell.scene,
        seconds=context.parameters.horizon_s,
        timestep_s=timestep_s,
        integrator=context.cell.integrator.code,
    )
    start = np.abs(context.cell.scene.start.qpos)
    return rollout.diverged_at_step is not None or bool(np.any(np.abs(rollout.qpos) > start * (1 + 1e-9)))


def is_overshoot_limit(context: ClaimContext, claim: Claim) -> bool:
    """A limit where the motion first swings further out than it started."""
    if not isinstance(claim, Bracket) or not context.parameters.search_s[0] <= claim.low <= claim.high:
        return False
    return not swings_out(context, claim.low * (1 - 1e-3)) and swings_out(context, claim.high * (1 + 1e-3))


def has_exchanged_integrators(context: ClaimContext, claim: Claim) -> bool:
    """The limit of implicitfast under Euler, and the other way round."""
    other = {EULER.code: IMPLICITFAST, IMPLICITFAST.code: EULER}.get(context.cell.integrator.code)
    cell = context.cell if other is None else replace(context.cell, integrator=other)
    return judge_claim(context.parameters, cell, claim).passed


def is_limit_of_first_model(context: ClaimContext, claim: Claim) -> bool:
    """The limit of the first model, reported for another one."""
    return context.first.case != context.cell.case and is_bisection_of(context, claim, context.first.scene)


def is_limit_of_gains_on_file(context: ClaimContext, claim: Claim) -> bool:
    """The limit of the given gains on the mass and length of the model file."""
    given = context.cell.scene.model

    def change(model: mujoco.MjModel) -> None:
        model.actuator_gainprm[:], model.actuator_biasprm[:] = given.actuator_gainprm, given.actuator_biasprm

    return is_bisection_of(context, claim, context.cell.scene_as_written.changed(change))


def is_limit_of_file(context: ClaimContext, claim: Claim) -> bool:
    """The limit of the model file without the case's numbers."""
    return is_bisection_of(context, claim, context.cell.scene_as_written)


FORMULAS: tuple[WrongMethod, ...] = (
    WrongMethod("bound", make_formula_test(lambda servo: servo.bound_s),
        "You reported the bound 2*sqrt(I/kp), which ignores the damper{shift}; simulate instead of computing it."),
    WrongMethod("damping bound", make_formula_test(lambda servo: 2 * servo.inertia / servo.kv if servo.kv else 0.0),
        "You reported the damping bound 2*I/kv, which ignores the spring and holds for explicit damping only."),
    WrongMethod("smaller bound", make_formula_test(
            lambda servo: min(servo.bound_s, 2 * servo.inertia / servo.kv if servo.kv else servo.bound_s)),
        "You reported the smaller of the bounds 2*sqrt(I/kp) and 2*I/kv; spring and damper act together, so simulate."),
    WrongMethod("half the bound", make_formula_test(lambda servo: servo.bound_s / 2),
        "You reported sqrt(I/kp) = 1/omega; the explicit spring limit is twice that, and the damper moves it again."),
    WrongMethod("period", make_formula_test(lambda servo: pi * servo.bound_s),
        "You reported the period 2*pi*sqrt(I/kp) of the oscillation, not a stability limit."),
)  # fmt: skip
"""Closed forms that are reported in place of a measurement."""

METHODS: tuple[WrongMethod, ...] = (
    WrongMethod("milliseconds", is_in_milliseconds, "You reported milliseconds, not seconds: divide by 1000."),
    WrongMethod("hertz", is_in_hertz, "You reported a rate in Hz, not a timestep: take its reciprocal, 1 / f."),
    WrongMethod("swapped", has_swapped_ends,
        "The ends of your brackets are in the wrong order: return (h_stable, h_unstable), the smaller one first."),
    WrongMethod("nothing unstable", is_no_limit,
        "You found nothing unstable where there is a limit: step the model you were given, set the timestep on it, "
        "start with {start}, and look at data.warning (or at data.time running backwards), because after a warning "
        "MuJoCo resets the state to one at rest.", all_claims=True, of_numbers=False),
    WrongMethod("search ends early", is_no_limit,
        "You returned None for some models that have a limit: search up to {longest} ms, and return None only if the "
        "run is stable there.", of_numbers=False),
    *FORMULAS,
    WrongMethod("too wide", is_too_wide,
        "Your brackets hold the limit but are too wide: go on halving until they are no wider than {width} ms."),
    WrongMethod("model of the file", is_limit_of_file,
        "You measured the model of the file, with the file's gains: measure the model you were given."),
    WrongMethod("mass of the file", is_limit_of_gains_on_file,
        "You took the gains of the model you were given, but mass and length from the file: measure the model you were "
        "given.", all_claims=True),
    WrongMethod("another model", is_limit_of_first_model,
        "You reported the limits of the first model for every model: measure the model you were given."),
    WrongMethod("Euler everywhere", make_simulation_test(code=EULER.code),
        "Every integrator got Euler's limit: either model.opt.integrator is not set, or the servo's torque is computed "
        "in Python (as for a motor), which is explicit whatever the integrator.", all_claims=True),
    WrongMethod("PGS", uses_pgs,
        "You set the solver to PGS, under which MuJoCo's discrete integrator silently becomes explicit."),
    WrongMethod("kv forgotten", make_simulation_test(remove_kv),
        "Your limits are those of a servo without its damping kv: keep the actuator's third bias parameter, -kv."),
    WrongMethod("damped joint", make_simulation_test(move_damping_to_joint),
        "Your limits are those of a pendulum with the joint's damping in place of the servo's kv: Euler treats a "
        "joint's damping implicitly, an actuator's explicitly."),
    WrongMethod("RK4", make_simulation_test(code=RK4.code),
        "Every integrator got RK4's limit: set model.opt.integrator to the integrator you are given.", all_claims=True),
    WrongMethod("implicitfast everywhere", make_simulation_test(code=IMPLICITFAST.code),
        "Every integrator got implicitfast's limit: set model.opt.integrator to the integrator you are given.",
        all_claims=True),
    WrongMethod("exchanged", has_exchanged_integrators,
        "Your limits under Euler and under implicitfast are exchanged: the servo's damping lowers Euler's limit and "
        "raises implicitfast's. In a formula turn the sign of kv, which actuator_biasprm[0, 2] holds as -kv; in a "
        "simulation set model.opt.integrator to the integrator you are given.", all_claims=True),
    WrongMethod("half a second", make_simulation_test(seconds=0.5),
        "Your runs are too short: within half a second a slow divergence does not show yet. Run for {horizon} s."),
    WrongMethod("one second", make_simulation_test(seconds=1.0),
        "Your runs are too short: within one second a slow divergence does not show yet. Run for {horizon} s."),
    WrongMethod("overshoot", is_overshoot_limit,
        "You called an overshoot unstable: the motion first swings out further than it started, but then decays. Count "
        "a run as unstable where MuJoCo raises a warning."),
)  # fmt: skip
