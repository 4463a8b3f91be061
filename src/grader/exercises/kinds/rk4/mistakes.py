"""The wrong ways to a Runge-Kutta step, each with its sentence for the student: does it give this trajectory?"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.exercises.kind import Judged
from grader.exercises.kinds.rk4.driver import Forward
from grader.exercises.kinds.rk4.judge import (
    Outcome,
    RunOutcome,
    Trajectory,
    difference,
    forward_of,
    mujocos,
    stepped,
    turned,
    unforced,
)
from grader.exercises.kinds.rk4.parameters import Problem, Run, retimed
from grader.numerics.integrators import DISCRETE, EULER, IMPLICIT, IMPLICITFAST, RK4
from grader.numerics.runge_kutta import STAGES, WEIGHTS

PREFIX = 40
"""Steps on which methods are told apart: enough for a fourth-order tableau to differ by more than round-off."""

GLANCE = 3
"""Steps after which most methods are ruled out already, so that they need not take the others."""

ROUND_OFF = 1e-12
"""What two ways to write one method differ by over PREFIX steps.

Source: measured 2e-14, with room for stiffer models.
"""

WHOLE_TURN = 1e-9
"""How near to an integer a number of turns must be: far more than round-off, far less than a wrong step."""

RELATIVE = 1e-5
"""Of the departure from MuJoCo's RK4: where that is large, round-off has grown with it."""


FLOAT32 = 1e-3
"""A state kept in 32 bits departs by less than this within PREFIX steps."""

Vector = NDArray[np.float64]
State = tuple[Vector, Vector]
Row = Sequence[float]


@dataclass(frozen=True)
class Motion:
    """Accelerations and position updates of one model."""

    model: mujoco.MjModel
    data: mujoco.MjData
    forward: Forward

    def accelerate(self, q: Vector, v: Vector, time: float) -> Vector:
        """Accelerations (nv,) at a state."""
        self.data.qpos[:], self.data.qvel[:], self.data.time = q, v, time
        self.forward(self.model, self.data)
        return np.array(self.data.qacc)

    def move(self, q: Vector, velocity: Vector, h: float) -> Vector:
        """Positions after `h` [s] at a constant velocity: quaternion-aware."""
        moved = q.copy()
        mujoco.mj_integratePos(self.model, moved, velocity, h)
        return moved


Method = Callable[[Motion, Vector, Vector, float, float], State]
"""(motion, q, v, time, h) -> (q, v) after the step."""


def stepper(method: Method, forward: Forward) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """A method as a function like the student's."""

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        time, h = float(data.time), float(model.opt.timestep)
        q, v = method(Motion(model, data, forward), data.qpos.copy(), data.qvel.copy(), time, h)
        data.qpos[:], data.qvel[:], data.time = q, v, time + h

    return step


def weighed(weights: Row, parts: Sequence[Vector]) -> Vector:
    """The weighted sum of as many parts as there are weights."""
    return np.array(np.add.reduce([w * part for w, part in zip(weights, parts, strict=False)]))


def tableau(stages: Sequence[Row], weights: Row, acceleration_weights: Row | None = None) -> Method:
    """The explicit Runge-Kutta method of a Butcher tableau: row i of `stages` weighs the slopes before stage i + 1.

    `acceleration_weights` are those of a step that weighs accelerations otherwise than velocities.
    """

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        velocities, slopes = [v], [motion.accelerate(q, v, time)]
        for row in stages:
            position = motion.move(q, weighed(row, velocities), h)
            velocity = v + h * weighed(row, slopes)
            velocities.append(velocity)
            slopes.append(motion.accelerate(position, velocity, time + sum(row) * h))
        change = weighed(acceleration_weights or weights, slopes)
        return motion.move(q, weighed(weights, velocities), h), v + h * change

    return step


CLASSICAL_STAGES: tuple[Row, ...] = ((1 / 2,), (0, 1 / 2), (0, 0, 1))
CLASSICAL_WEIGHTS: Row = WEIGHTS


def semi_implicit(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """MuJoCo's Euler without damping: the new velocity moves the position."""
    v = v + h * motion.accelerate(q, v, time)
    return motion.move(q, v, h), v


def classical_slopes(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> tuple[list[Vector], list[Vector]]:
    """Velocities and accelerations of the four classical stages."""
    velocities, slopes = [v], [motion.accelerate(q, v, time)]
    for fraction in STAGES:
        position, velocity = motion.move(q, velocities[-1], fraction * h), v + fraction * h * slopes[-1]
        velocities.append(velocity)
        slopes.append(motion.accelerate(position, velocity, time + fraction * h))
    return velocities, slopes


def position_by_new_velocity(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """Velocities by the classical method, positions by the new velocity alone."""
    v = v + h * weighed(CLASSICAL_WEIGHTS, classical_slopes(motion, q, v, time, h)[1])
    return motion.move(q, v, h), v


def position_by_old_velocity(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """Velocities by the classical method, positions by the velocity at the step's start."""
    slopes = classical_slopes(motion, q, v, time, h)[1]
    return motion.move(q, v, h), v + h * weighed(CLASSICAL_WEIGHTS, slopes)


def four_moves(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """The weighted velocities move the position one after the other, in four calls of mj_integratePos."""
    velocities, slopes = classical_slopes(motion, q, v, time, h)
    for weight, velocity in zip(CLASSICAL_WEIGHTS, velocities, strict=True):
        q = motion.move(q, velocity, weight * h)
    return q, v + h * weighed(CLASSICAL_WEIGHTS, slopes)


def staged(
    stage: Callable[[Motion, State, State, tuple[Vector, Vector], float], State], fractions: Row = STAGES
) -> Method:
    """The classical method with another rule for where a stage starts: from the step's start, the stage before it
    and that stage's slope (velocity, acceleration), over a part of the step."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        here: State = (q, v)
        velocities, slopes = [v], [motion.accelerate(q, v, time)]
        for fraction in fractions:
            here = stage(motion, (q, v), here, (velocities[-1], slopes[-1]), fraction * h)
            velocities.append(here[1])
            slopes.append(motion.accelerate(*here, time + fraction * h))
        weights = CLASSICAL_WEIGHTS
        return motion.move(q, weighed(weights, velocities), h), v + h * weighed(weights, slopes)

    return step


def own_new_velocity(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """Semi-implicit: a stage's position moves with that stage's own velocity."""
    velocity = start[1] + part * slope[1]
    return motion.move(start[0], velocity, part), velocity


def first_velocity(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """A stage's position moves with the velocity at the step's start."""
    return motion.move(start[0], start[1], part), start[1] + part * slope[1]


def chained(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """A stage starts where the one before it stood."""
    return motion.move(here[0], slope[0], part), here[1] + part * slope[1]


def chained_positions(motion: Motion, start: State, here: State, slope: tuple[Vector, Vector], part: float) -> State:
    """Only the positions start where the stage before stood: mj_integratePos in place."""
    return motion.move(here[0], slope[0], part), start[1] + part * slope[1]


def chained_to_the_end(positions: bool = True, velocities: bool = True) -> Method:
    """Stages and the final update go on from where the last one stood: positions, velocities or both are never put
    back."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        speeds, slopes = [v], [motion.accelerate(q, v, time)]
        position, velocity = q, v
        for fraction in STAGES:
            position = motion.move(position if positions else q, speeds[-1], fraction * h)
            velocity = (velocity if velocities else v) + fraction * h * slopes[-1]
            speeds.append(velocity)
            slopes.append(motion.accelerate(position, velocity, time + fraction * h))
        last, speed = position if positions else q, velocity if velocities else v
        weights = CLASSICAL_WEIGHTS
        return motion.move(last, weighed(weights, speeds), h), speed + h * weighed(weights, slopes)

    return step


Rate = Callable[[Vector, Vector], Vector]


class WorldMotion(Motion):
    """Takes the angular velocity of a free or ball joint as if it were given in the world's axes."""

    def move(self, q: Vector, velocity: Vector, h: float) -> Vector:
        """Positions after `h` [s], quaternions turned from the wrong side."""
        moved = super().move(q, velocity, h)
        for kind, at, dof in zip(self.model.jnt_type, self.model.jnt_qposadr, self.model.jnt_dofadr, strict=True):
            if int(kind) in QUATERNION:
                quat, spin = at + QUATERNION[int(kind)], dof + QUATERNION[int(kind)]
                rate = velocity[spin : spin + 3]
                angle = float(np.linalg.norm(rate))
                turn = np.zeros(4)
                mujoco.mju_axisAngle2Quat(turn, rate / angle if angle else np.array([1.0, 0.0, 0.0]), h * angle)
                mujoco.mju_mulQuat(moved[quat : quat + 4], turn, q[quat : quat + 4])
        return moved


QUATERNION = {int(mujoco.mjtJoint.mjJNT_FREE): 3, int(mujoco.mjtJoint.mjJNT_BALL): 0}
"""Where quaternion and angular velocity begin in a joint's coordinates."""


def in_the_world(method: Method) -> Method:
    """A method with angular velocities taken in the world's axes."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        return method(WorldMotion(motion.model, motion.data, motion.forward), q, v, time, h)

    return step


def quaternion_derivative(rate: Rate) -> Method:
    """The classical method on qpos itself; `rate`: of a quaternion (4,), from it and an angular velocity (3,)."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        velocities, rates, slopes = [v], [qpos_rate(motion, rate, q, v)], [motion.accelerate(q, v, time)]
        for fraction in STAGES:
            position, velocity = q + fraction * h * rates[-1], v + fraction * h * slopes[-1]
            velocities.append(velocity)
            rates.append(qpos_rate(motion, rate, position, velocity))
            slopes.append(motion.accelerate(position, velocity, time + fraction * h))
        position = q + h * weighed(CLASSICAL_WEIGHTS, rates)
        mujoco.mj_normalizeQuat(motion.model, position)
        return position, v + h * weighed(CLASSICAL_WEIGHTS, slopes)

    return step


def qpos_rate(motion: Motion, rate: Rate, q: Vector, v: Vector) -> Vector:
    """The rate of change of qpos (nq,)."""
    result, model = np.zeros(len(q)), motion.model
    for kind, at, dof in zip(model.jnt_type, model.jnt_qposadr, model.jnt_dofadr, strict=True):
        plain = QUATERNION.get(int(kind), 1)
        result[at : at + plain] = v[dof : dof + plain]
        if int(kind) in QUATERNION:
            quat, spin = at + plain, dof + plain
            result[quat : quat + 4] = rate(q[quat : quat + 4], v[spin : spin + 3])
    return result


def rate_in_the_world(quat: Vector, omega: Vector) -> Vector:
    """(0, omega) * quat / 2: right for an angular velocity in the world's axes."""
    rate = np.zeros(4)
    mujoco.mju_derivQuat(rate, quat, omega)
    return rate


def rate_without_the_half(quat: Vector, omega: Vector) -> Vector:
    """quat * (0, omega)."""
    rate = np.zeros(4)
    mujoco.mju_mulQuat(rate, quat, np.concatenate([[0.0], omega]))
    return rate


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


def matches(run: Run, student: Trajectory, other: Trajectory, departure: float) -> bool:
    """Whether two trajectories agree to round-off over what both have."""
    rows = min(PREFIX, len(student), len(other))
    if rows < 2:
        return False
    return difference(run, student.first(rows), other.first(rows)).worst <= max(ROUND_OFF, RELATIVE * departure)


def departure_of(run: Run, student: Trajectory) -> float:
    """How far the student is from MuJoCo's RK4 within PREFIX steps."""
    return difference(run, student.first(PREFIX), mujocos(run).first(PREFIX)).worst


def name_the_mistake(first_case: str, judged: Sequence[Judged[Problem, Outcome]]) -> str | None:
    """Returns the sentence of what gives the first wrong trajectory; None if it is not recognised."""
    wrong = next((one.judgement.outcome for one in judged if not one.judgement.passed), None)
    if not isinstance(wrong, RunOutcome):
        return None
    return name_the_step(wrong) if wrong.problem.case.id == first_case else name_the_state(wrong)


def name_the_step(wrong: RunOutcome) -> str | None:
    """Returns the sentence of the method, or of the way round mj_forward, that gives a trajectory."""
    run, student = wrong.run, wrong.student
    departure = departure_of(run, student)
    if len(student) < 2 or not np.isfinite(departure) or departure <= ROUND_OFF:
        return None
    ways = (another_forward, another_time, another_number, another_step)
    return next((said for way in ways if (said := way(run, student, departure))), None)


def name_the_state(wrong: RunOutcome) -> str | None:
    """Returns the sentence of a part of the state that stands still although it should move."""
    student, ours = wrong.student, mujocos(wrong.run)
    if not len(student):
        return None
    if wraps(wrong):
        return "You wrap angles into one turn: MuJoCo does not, so leave data.qpos as it comes out of the step."
    if wrong.problem.case.time_matters and (student.time == student.time[0]).all():
        return "data.time stands still: set it at every stage, and advance it by model.opt.timestep in every step."
    if ours.act.size and (student.act == student.act[0]).all():
        return "data.act stands still: advance it with data.act_dot, as you advance qvel with qacc."
    if len(student) > 1 and np.any(np.all(student.qvel == student.qvel[0], axis=0)):
        return "Some velocities stand still: a model may have more joints than you move, so advance all of data.qvel."
    return None


def wraps(wrong: RunOutcome) -> bool:
    """Whether the trajectory first departs by whole turns of hinges, and by nothing else."""
    if wrong.first_departure is None:
        return False
    run, here, model = wrong.run, slice(wrong.first_departure - 1, wrong.first_departure), wrong.run.scene().model
    turns = turned(run, mujocos(run).qpos[here], wrong.student.qpos[here])[0] / (2 * np.pi)
    hinges = model.jnt_dofadr[model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)]
    whole = np.zeros(model.nv)
    whole[hinges] = np.round(turns[hinges])
    return bool(whole.any() and np.all(np.abs(turns - whole) <= WHOLE_TURN))


def another_forward(run: Run, student: Trajectory, departure: float) -> str | None:
    """Whether the accelerations came from elsewhere than mj_forward."""
    for integrator in (RK4, EULER, IMPLICIT, IMPLICITFAST, DISCRETE):
        if matches(run, student, unforced(run, integrator.code, PREFIX), departure):
            return (
                f"The trajectory is that of MuJoCo's own stepping ({integrator.name}): the accelerations did not come "
                "from mujoco.mj_forward."
            )
    forward = forward_of(run)

    def first_stage_only(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        forward(model, data)
        mujoco.mj_RungeKutta(model, data, len(CLASSICAL_WEIGHTS))

    if matches(run, student, stepped(run, first_stage_only, PREFIX), departure):
        return (
            "Only the first slope came from mujoco.mj_forward, the others from MuJoCo's own stepping (mj_RungeKutta), "
            "which goes round it: write the stages yourself."
        )
    return None


def another_time(run: Run, student: Trajectory, departure: float) -> str | None:
    """Whether the right states come at the wrong time."""
    ours = mujocos(run)
    if matches(run, student.at(slice(1, PREFIX)), ours.at(slice(0, PREFIX - 1)), departure):
        return "You are one step behind: the first call does not advance the state."
    if matches(run, student.first(PREFIX), ours.at(slice(1, PREFIX + 1)), departure):
        return "You are one step ahead: the first call takes two steps."
    for factor in (0.5, 2.0):
        other = stepped(retimed(run, factor * run.timestep_s, PREFIX), classical(run))
        if matches(run, student, other, departure):
            return f"Every step advances by {factor:g} times model.opt.timestep."
    return None


def another_number(run: Run, student: Trajectory, departure: float) -> str | None:
    """What shows in the numbers themselves."""
    if np.all(student.qpos == student.qpos[0]):
        return "Every step leaves the same positions."
    if departure < FLOAT32 and np.array_equal(student.qpos, student.qpos.astype(np.float32)):
        return "The state went through 32-bit floats: use NumPy's default, float64."
    return None


def classical(run: Run) -> Callable[..., None]:
    """The right step, as a function of model and data."""
    return stepper(tableau(CLASSICAL_STAGES, CLASSICAL_WEIGHTS), forward_of(run))


def another_step(run: Run, student: Trajectory, departure: float) -> str | None:
    """Which wrong method it is."""
    forward = forward_of(run)
    for wrong in METHODS:
        step = stepper(wrong.method, forward)
        if all(matches(run, student, stepped(run, step, steps), departure) for steps in (GLANCE, PREFIX)):
            return wrong.on_rotations if wrong.on_rotations and len(run.qpos) > len(run.qvel) else wrong.sentence
    return None


def lazy_steps(entry: str) -> Mapping[str, str]:
    """Returns steps that know nothing of the model."""
    bodies = {
        "a step that does nothing": "pass",
        "a step that advances the time alone": "data.time += model.opt.timestep",
        "a step of constant velocity": "mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)",
        "MuJoCo's own step": "mujoco.mj_step(model, data)",
    }
    return {name: f"import mujoco\n\n\ndef {entry}(model, data):\n    {body}\n" for name, body in bodies.items()}
