"""Believable wrong ways to a largest stable timestep: would this method, put to this cell, have given this claim?"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from grader.grading.threshold.claims import Bracket, Claim, NoLimit
from grader.grading.threshold.parameters import INTEGRATORS, Cell, Problem
from grader.grading.threshold.truth import judge_claim, warns
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.servo import Servo

FORMULA_TOLERANCE = 5e-4
"""Relative: a formula is reported as it is, as an end or as the middle of the bracket.

Source: leaving the body's own inertia out of I changes the lesson's bound by 2e-4.
"""

NUMBER_TOLERANCE = 5e-3
"""Relative: a single number may be rounded, 22.4 ms for 22.365 ms."""

METHOD_TOLERANCE = 0.005
"""Relative: how differently the same wrong method may be written (rounding of the number of steps, the criterion)."""

Gives = Callable[[Problem, Cell, Claim], bool]


@dataclass(frozen=True)
class WrongMethod:
    """A mistake: the sentence for the student, and whether it would have given a claim.

    It must explain every wrong claim; with `all_claims` the right ones too (they may be right by accident). One of the
    wrong ones must hold numbers, unless `of_numbers` is false: `None` shows little of how it came about.
    """

    id: str
    sentence: str
    gives: Gives
    all_claims: bool = False
    of_numbers: bool = True


def servo_of(cell: Cell) -> Servo | None:
    """Inertia and gains read off a model of one joint and one position servo; None for any other model."""
    model = cell.scene.model
    if model.nv != 1 or model.nu != 1:
        return None
    kp, kv = float(model.actuator_gainprm[0, 0]), float(-model.actuator_biasprm[0, 2])
    if kp <= 0 or kv < 0 or model.actuator_biasprm[0, 1] != -kp:
        return None
    return Servo(float(model.dof_M0[0]), kp, kv)


def formula(value: Callable[[Servo], float]) -> Gives:
    """The method that reports a closed form."""

    def gives(problem: Problem, cell: Cell, claim: Claim) -> bool:
        servo = servo_of(cell)
        if servo is None:
            return False
        limit = value(servo)
        if not isinstance(claim, Bracket):
            return isinstance(claim, NoLimit) and limit > problem.parameters.search_s[1]
        tolerance = FORMULA_TOLERANCE if claim.number is None else NUMBER_TOLERANCE
        ends = (claim.low, claim.high, (claim.low + claim.high) / 2)
        return any(abs(end - limit) <= tolerance * limit for end in ends)

    return gives


def simulated(
    change: Callable[[Scene], Scene | None] = lambda scene: scene, *, code: int | None = None, seconds: float = 0
) -> Gives:
    """The method that bisects rightly, but another scene, under another integrator, or for another time."""

    def gives(problem: Problem, cell: Cell, claim: Claim) -> bool:
        scene = change(cell.scene)
        return scene is not None and claim_fits(problem, cell, claim, scene, code, seconds=seconds)

    return gives


def claim_fits(
    problem: Problem, cell: Cell, claim: Claim, scene: Scene, code: int | None = None, *, seconds: float = 0
) -> bool:
    """Whether a bisection of this scene would have ended in this claim, give or take one step in the run's length."""
    integrator = cell.code if code is None else code
    horizon = seconds or problem.parameters.horizon_s
    shortest, longest = problem.parameters.search_s
    if isinstance(claim, NoLimit):
        return not warns(scene, integrator, longest, horizon)
    if not isinstance(claim, Bracket) or not shortest / 2 <= claim.low <= claim.high <= 2 * longest:
        return False
    low, high = claim.low * (1 - METHOD_TOLERANCE), claim.high * (1 + METHOD_TOLERANCE)
    return not warns(scene, integrator, low, horizon - low) and warns(scene, integrator, high, horizon + high)


def without_kv(scene: Scene) -> Scene:
    """The servo without its damper."""

    def change(model: mujoco.MjModel) -> None:
        model.actuator_biasprm[:, 2] = 0

    return scene.changed(change)


def damped_joint(scene: Scene) -> Scene | None:
    """The damper in the joint instead of the servo."""
    if scene.model.nv != 1 or scene.model.nu != 1:
        return None

    def change(model: mujoco.MjModel) -> None:
        model.dof_damping[0] -= model.actuator_biasprm[0, 2]
        model.actuator_biasprm[0, 2] = 0

    return scene.changed(change)


def pgs(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """Another constraint solver, which matters under `discrete` alone."""

    def change(model: mujoco.MjModel) -> None:
        model.opt.solver = mujoco.mjtSolver.mjSOL_PGS

    return cell.code == INTEGRATORS["discrete"] and claim_fits(problem, cell, claim, cell.scene.changed(change))


def in_milliseconds(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """The right claim, a thousand times as large."""
    return isinstance(claim, Bracket) and judge_claim(problem.parameters, cell, claim.scaled(1e-3)).right


def swapped(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """The right bracket, turned round."""
    if not isinstance(claim, Bracket) or claim.number is not None or claim.width >= 0:
        return False
    return judge_claim(problem.parameters, cell, Bracket(claim.high, claim.low)).right


def too_wide(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """A bracket that holds the limit, but not narrow enough."""
    if not isinstance(claim, Bracket) or claim.width <= problem.parameters.width_s:
        return False
    return claim_fits(problem, cell, claim, cell.scene)


def nothing_unstable(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """None where there is a limit."""
    return isinstance(claim, NoLimit)


def swings_out(problem: Problem, cell: Cell, timestep_s: float) -> bool:
    """Whether some coordinate gets further from zero than it started."""
    rollout = simulate(cell.scene, seconds=problem.parameters.horizon_s, timestep_s=timestep_s, integrator=cell.code)
    start = np.abs(cell.scene.start.qpos)
    return rollout.diverged_at_step is not None or bool(np.any(np.abs(rollout.qpos) > start * (1 + 1e-9)))


def overshoots(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """A limit where the motion first swings further out than it started."""
    if not isinstance(claim, Bracket) or not problem.parameters.search_s[0] <= claim.low <= claim.high:
        return False
    return not swings_out(problem, cell, claim.low * (1 - 1e-3)) and swings_out(problem, cell, claim.high * (1 + 1e-3))


def another_model(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """The limit of the first model, reported for another one."""
    first = next(c for c in problem.cells if c.integrator == cell.integrator)
    return first.model != cell.model and claim_fits(problem, cell, claim, first.scene)


def gains_on_the_file(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """The right gains on the mass and length that stand in the file."""
    given = cell.scene.model

    def change(model: mujoco.MjModel) -> None:
        model.actuator_gainprm[:], model.actuator_biasprm[:] = given.actuator_gainprm, given.actuator_biasprm

    return claim_fits(problem, cell, claim, problem.as_in_the_file.changed(change))


def model_of_the_file(problem: Problem, cell: Cell, claim: Claim) -> bool:
    """The limit of the model as it stands in its file."""
    return claim_fits(problem, cell, claim, problem.as_in_the_file)
