"""Recognises wrong Runge-Kutta steps: simulates each, and names the one that gives the student's trajectory."""

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
    mujoco_run,
    stepped,
    tangent_difference,
    unforced_run,
)
from grader.exercises.kinds.rk4.parameters import Problem, Run, retimed
from grader.numerics.integrators import DISCRETE, EULER, IMPLICIT, IMPLICITFAST, RK4
from grader.numerics.runge_kutta import STAGES, WEIGHTS

PREFIX = 40
"""Steps that are compared: enough for two fourth-order tableaus to differ by more than round-off."""

GLANCE = 3
"""Steps that are compared first: they rule out most methods."""

ROUND_OFF = 1e-12
"""The largest difference between two programs of the same method over PREFIX steps.

Source: measured 2e-14, with room for stiffer models.
"""

WHOLE_TURN = 1e-9
"""The tolerance of a whole number of turns: far more than round-off, far less than a wrong step."""

RELATIVE = 1e-5
"""Tolerance relative to the departure from MuJoCo's RK4: where that is large, round-off has grown with it."""

FLOAT32 = 1e-3
"""A state kept in 32 bits departs by less than this within PREFIX steps."""

Vector = NDArray[np.float64]
State = tuple[Vector, Vector]
Row = Sequence[float]


@dataclass(frozen=True)
class Motion:
    """Computes accelerations and moves positions of one model."""

    model: mujoco.MjModel
    data: mujoco.MjData
    forward: Forward

    def accelerate(self, q: Vector, v: Vector, time: float) -> Vector:
        """Returns the accelerations (nv,) at a state."""
        self.data.qpos[:], self.data.qvel[:], self.data.time = q, v, time
        self.forward(self.model, self.data)
        return np.array(self.data.qacc)

    def move(self, q: Vector, velocity: Vector, h: float) -> Vector:
        """Returns the positions after `h` [s] at a constant velocity, rotations included."""
        moved = q.copy()
        mujoco.mj_integratePos(self.model, moved, velocity, h)
        return moved


Method = Callable[[Motion, Vector, Vector, float, float], State]
"""(motion, q, v, time, h) -> (q, v) after the step."""


def stepper(method: Method, forward: Forward) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """Returns a method as a function of model and data, like the student's."""

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        time, h = float(data.time), float(model.opt.timestep)
        q, v = method(Motion(model, data, forward), data.qpos.copy(), data.qvel.copy(), time, h)
        data.qpos[:], data.qvel[:], data.time = q, v, time + h

    return step


def weighted_sum(weights: Row, parts: Sequence[Vector]) -> Vector:
    """Returns the weighted sum of as many parts as there are weights."""
    return np.array(np.add.reduce([w * part for w, part in zip(weights, parts, strict=False)]))


CLASSICAL: tuple[Row, ...] = ((1 / 2,), (0, 1 / 2), (0, 0, 1))
"""The stages of Kutta's classical method, as rows of its Butcher tableau."""


def tableau(
    stages: Sequence[Row] = CLASSICAL, weights: Row = WEIGHTS, acceleration_weights: Row | None = None
) -> Method:
    """Returns the explicit Runge-Kutta method of a Butcher tableau.

    Row i of `stages` weights the slopes before stage i + 1. `acceleration_weights` replace `weights` for accelerations.
    """

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        velocities, slopes = [v], [motion.accelerate(q, v, time)]
        for row in stages:
            position = motion.move(q, weighted_sum(row, velocities), h)
            velocity = v + h * weighted_sum(row, slopes)
            velocities.append(velocity)
            slopes.append(motion.accelerate(position, velocity, time + sum(row) * h))
        change = weighted_sum(acceleration_weights or weights, slopes)
        return motion.move(q, weighted_sum(weights, velocities), h), v + h * change

    return step


def semi_implicit(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """MuJoCo's Euler without damping: the new velocity moves the position."""
    v = v + h * motion.accelerate(q, v, time)
    return motion.move(q, v, h), v


Stage = Callable[[Motion, State, State, State, float], State]
"""(motion, start, here, slope, time) -> the state at which the next stage is evaluated.

`start` is the state at the start of the step, `here` that of the stage before, `slope` its velocity and acceleration;
`time` [s] is the time from the start of the step to the next stage.
"""


def from_the_start(motion: Motion, start: State, here: State, slope: State, time: float) -> State:
    """The classical stage: from the start of the step along the slope of the stage before."""
    return motion.move(start[0], slope[0], time), start[1] + time * slope[1]


def own_new_velocity(motion: Motion, start: State, here: State, slope: State, time: float) -> State:
    """Semi-implicit: the position moves with the new velocity of the same stage."""
    velocity = start[1] + time * slope[1]
    return motion.move(start[0], velocity, time), velocity


def first_velocity(motion: Motion, start: State, here: State, slope: State, time: float) -> State:
    """The position moves with the velocity at the start of the step."""
    return motion.move(start[0], start[1], time), start[1] + time * slope[1]


def chained(motion: Motion, start: State, here: State, slope: State, time: float) -> State:
    """Positions and velocities move on from the stage before."""
    return motion.move(here[0], slope[0], time), here[1] + time * slope[1]


def chained_positions(motion: Motion, start: State, here: State, slope: State, time: float) -> State:
    """Positions alone move on from the stage before: mj_integratePos in place."""
    return motion.move(here[0], slope[0], time), start[1] + time * slope[1]


def chained_velocities(motion: Motion, start: State, here: State, slope: State, time: float) -> State:
    """Velocities alone move on from the stage before."""
    return motion.move(start[0], slope[0], time), here[1] + time * slope[1]


@dataclass(frozen=True)
class Stages:
    """The states, velocities and accelerations of the four stages of a step."""

    states: list[State]
    slopes: list[Vector]

    @property
    def velocity(self) -> Vector:
        """The mean velocity, with the classical weights."""
        return weighted_sum(WEIGHTS, [velocity for _, velocity in self.states])

    @property
    def acceleration(self) -> Vector:
        """The mean acceleration, with the classical weights."""
        return weighted_sum(WEIGHTS, self.slopes)


def stages_of(motion: Motion, q: Vector, v: Vector, time: float, h: float, *, stage: Stage = from_the_start) -> Stages:
    """Evaluates the four stages of a step, each where `stage` says."""
    states, slopes = [(q, v)], [motion.accelerate(q, v, time)]
    for fraction in STAGES:
        here = stage(motion, (q, v), states[-1], (states[-1][1], slopes[-1]), fraction * h)
        states.append(here)
        slopes.append(motion.accelerate(*here, time + fraction * h))
    return Stages(states, slopes)


def staged(stage: Stage, *, q_from_last: bool = False, v_from_last: bool = False) -> Method:
    """The classical method with other stages; the final update may start from the last stage, not from the start."""

    def step(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
        stages = stages_of(motion, q, v, time, h, stage=stage)
        last_q, last_v = stages.states[-1]
        q, v = (last_q if q_from_last else q), (last_v if v_from_last else v)
        return motion.move(q, stages.velocity, h), v + h * stages.acceleration

    return step


def position_by_new_velocity(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """Velocities by the classical method, positions by the new velocity alone."""
    v = v + h * stages_of(motion, q, v, time, h).acceleration
    return motion.move(q, v, h), v


def position_by_old_velocity(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """Velocities by the classical method, positions by the velocity at the start of the step."""
    return motion.move(q, v, h), v + h * stages_of(motion, q, v, time, h).acceleration


def four_moves(motion: Motion, q: Vector, v: Vector, time: float, h: float) -> State:
    """Each weighted velocity moves the position in turn, in four calls of mj_integratePos."""
    stages = stages_of(motion, q, v, time, h)
    for weight, (_, velocity) in zip(WEIGHTS, stages.states, strict=True):
        q = motion.move(q, velocity, weight * h)
    return q, v + h * stages.acceleration


Rate = Callable[[Vector, Vector], Vector]


class WorldMotion(Motion):
    """Takes the angular velocity of free and ball joints to be in the world's axes."""

    def move(self, q: Vector, velocity: Vector, h: float) -> Vector:
        """Returns the positions after `h` [s], with quaternions multiplied from the wrong side."""
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
    """Returns a method with angular velocities taken in the world's axes."""

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
        position = q + h * weighted_sum(WEIGHTS, rates)
        mujoco.mj_normalizeQuat(motion.model, position)
        return position, v + h * weighted_sum(WEIGHTS, slopes)

    return step


def qpos_rate(motion: Motion, rate: Rate, q: Vector, v: Vector) -> Vector:
    """Returns the rate of change of qpos (nq,)."""
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

OTHER_TABLEAUS: Mapping[str, Method] = {
    "Kutta's 3/8 rule": tableau(THIRDS, (1 / 8, 3 / 8, 3 / 8, 1 / 8)),
    "Ralston's method": tableau(RALSTON_STAGES, RALSTON_WEIGHTS),
    "Gill's method": tableau(GILL_STAGES, GILL_WEIGHTS),
}
"""Other methods of fourth order; on rotations, with one mj_integratePos a step, they are of second order."""

METHODS: Mapping[str, Method] = {
    # other methods
    "This is explicit Euler: one slope a step, taken at its start.": tableau((), (1,)),
    "This is semi-implicit Euler: one acceleration a step, not four.": semi_implicit,
    "This is the midpoint method: second order, two slopes a step.": tableau(((1 / 2,),), (0, 1)),
    "This is Heun's method: second order, two slopes a step.": tableau(((1,),), (1 / 2, 1 / 2)),
    "This is Kutta's third-order method.": tableau(((1 / 2,), (-1, 2)), (1 / 6, 2 / 3, 1 / 6)),
    # wrong weights
    "All four slopes have the same weight; the classical weights are 1, 2, 2, 1 over 6.": tableau(weights=(1 / 4,) * 4),
    "The weights are those of the 3/8 rule (1, 3, 3, 1 over 8) on the classical stages; use 1, 2, 2, 1 over 6.": (
        tableau(weights=(1 / 8, 3 / 8, 3 / 8, 1 / 8))
    ),
    "The weights do not sum to 1: the middle slopes count twice (1, 2, 2, 1 over 6).": tableau(weights=(1 / 6,) * 4),
    "The weights 1, 2, 2, 1 are divided by 8, not by 6: they do not sum to 1.": (
        tableau(weights=(1 / 8, 1 / 4, 1 / 4, 1 / 8))
    ),
    "The weights 1, 2, 2, 1 are divided by 4, not by 6: they do not sum to 1.": (
        tableau(weights=(1 / 4, 1 / 2, 1 / 2, 1 / 4))
    ),
    "The first and the last slope have the weight 2, the others 1; the classical weights are 1, 2, 2, 1.": (
        tableau(weights=(1 / 3, 1 / 6, 1 / 6, 1 / 3))
    ),
    # views of data that are not copied
    "All slopes equal the last one: data.qvel and data.qacc are views that the next mj_forward overwrites, so copy "
    "them.": tableau(weights=(0, 0, 0, 1)),
    "All accelerations equal the last one: data.qacc is a view that the next mj_forward overwrites, so copy it.": (
        tableau(acceleration_weights=(0, 0, 0, 1))
    ),
    "All stage velocities equal the last one: data.qvel is a view that the next stage overwrites, so copy it.": (
        tableau(weights=(0, 0, 0, 1), acceleration_weights=WEIGHTS)
    ),
    # wrong stages
    "Your last stage is evaluated at half the step; evaluate it at the end.": (
        tableau(((1 / 2,), (0, 1 / 2), (0, 0, 1 / 2)))
    ),
    "Your stages 2 and 3 are evaluated at the end of the step; evaluate them at half the step.": (
        tableau(((1,), (0, 1), (0, 0, 1)))
    ),
    "Your stage 3 is evaluated at the end of the step; evaluate it at half the step, like stage 2.": (
        tableau(((1 / 2,), (0, 1), (0, 0, 1)))
    ),
    "Your stage 3 uses the first slope again; use the velocity and acceleration of stage 2.": (
        tableau(((1 / 2,), (1 / 2, 0), (0, 0, 1)))
    ),
    "Your stage 4 uses the slope of stage 2; use the velocity and acceleration of stage 3.": (
        tableau(((1 / 2,), (0, 1 / 2), (0, 1, 0)))
    ),
    "Your stages 2, 3 and 4 all use the first slope; use the velocity and acceleration of the stage before.": (
        tableau(((1 / 2,), (1 / 2, 0), (1, 0, 0)))
    ),
    "Your stages move the position with their own new velocity; use the velocity of the stage before.": (
        staged(own_new_velocity)
    ),
    "Your stages all move the position with the velocity at the start of the step; use the velocity of the stage "
    "before.": staged(first_velocity),
    # a state that is not restored
    "Each of your stages starts from the state of the stage before; restore q and v to the start of the step before "
    "every stage.": staged(chained),
    "Your stages move the positions in place, so that each starts from those of the stage before; restore qpos to the "
    "start of the step before every stage.": staged(chained_positions),
    "The state is not restored between the stages: q and v alias data.qpos and data.qvel, so copy them.": (
        staged(chained, q_from_last=True, v_from_last=True)
    ),
    "The velocity is not restored between the stages: v aliases data.qvel, so copy it.": (
        staged(chained_velocities, v_from_last=True)
    ),
    "The positions are moved in place by every stage and at the end; restore qpos to the start of the step before "
    "every mj_integratePos.": staged(chained_positions, q_from_last=True),
    # positions
    "The position advances with the new velocity alone; use the weighted mean of the four stage velocities.": (
        position_by_new_velocity
    ),
    "The position advances with the velocity at the start of the step alone; use the weighted mean of the four stage "
    "velocities.": position_by_old_velocity,
    "The position is moved four times, by one weighted velocity after the other, but rotations do not add up: sum the "
    "velocities first, then move once.": four_moves,
    # quaternions
    "The angular velocity of a free or ball joint is given in the body's axes, not the world's: multiply the "
    "quaternion by the rotation from the right.": in_the_world(tableau()),
    "mju_derivQuat and the like take the angular velocity in the world's axes; here it is given in the body's axes, so "
    "the derivative is quat * (0, omega) / 2.": quaternion_derivative(rate_in_the_world),
    "The quaternion turns twice as fast as it should: its derivative is quat * (0, omega) / 2, with the 1/2.": (
        quaternion_derivative(rate_without_the_half)
    ),
}
"""The method behind each sentence for the student; the first one that gives the trajectory is named."""


def matches(run: Run, student: Trajectory, other: Trajectory, departure: float) -> bool:
    """Whether two trajectories agree to round-off over their common steps."""
    rows = min(PREFIX, len(student), len(other))
    if rows < 2:
        return False
    return difference(run, student.first(rows), other.first(rows)).worst <= max(ROUND_OFF, RELATIVE * departure)


def departure_of(run: Run, student: Trajectory) -> float:
    """Returns the largest difference from MuJoCo's RK4 within PREFIX steps."""
    return difference(run, student.first(PREFIX), mujoco_run(run).first(PREFIX)).worst


def name_the_mistake(first_case: str, judged: Sequence[Judged[Problem, Outcome]]) -> str | None:
    """Returns the sentence of the mistake in the first wrong trajectory; None if it is not recognised."""
    wrong = next((one.judgement.outcome for one in judged if not one.judgement.passed), None)
    if not isinstance(wrong, RunOutcome):
        return None
    return name_the_step(wrong) if wrong.problem.case.id == first_case else name_the_state(wrong)


def name_the_step(wrong: RunOutcome) -> str | None:
    """Returns the sentence of the first explanation that gives a trajectory."""
    run, student = wrong.run, wrong.student
    departure = departure_of(run, student)
    if len(student) < 2 or not np.isfinite(departure) or departure <= ROUND_OFF:
        return None
    explanations = (another_forward, another_time, another_number, another_step)
    return next((sentence for explain in explanations if (sentence := explain(run, student, departure))), None)


def name_the_state(wrong: RunOutcome) -> str | None:
    """Returns the sentence of a part of the state that does not change although it should."""
    student, ours = wrong.student, mujoco_run(wrong.run)
    if not len(student):
        return None
    if wraps(wrong):
        return "You wrap angles into one turn: MuJoCo does not, so leave data.qpos as it comes out of the step."
    if wrong.problem.case.time_matters and (student.time == student.time[0]).all():
        return "data.time does not change: set it at every stage, and advance it by model.opt.timestep in every step."
    if ours.act.size and (student.act == student.act[0]).all():
        return "data.act does not change: advance it with data.act_dot, as you advance qvel with qacc."
    if len(student) > 1 and np.any(np.all(student.qvel == student.qvel[0], axis=0)):
        return "Some velocities do not change: a model may have more joints than you move, so advance all of data.qvel."
    return None


def wraps(wrong: RunOutcome) -> bool:
    """Whether the trajectory first departs by whole turns of hinges, and by nothing else."""
    if wrong.first_departure is None:
        return False
    run, here, model = wrong.run, slice(wrong.first_departure - 1, wrong.first_departure), wrong.run.scene().model
    turns = tangent_difference(run, mujoco_run(run).qpos[here], wrong.student.qpos[here])[0] / (2 * np.pi)
    hinges = model.jnt_dofadr[model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)]
    whole = np.zeros(model.nv)
    whole[hinges] = np.round(turns[hinges])
    return bool(whole.any() and np.all(np.abs(turns - whole) <= WHOLE_TURN))


def another_forward(run: Run, student: Trajectory, departure: float) -> str | None:
    """Returns the sentence if MuJoCo's own stepping, which lacks the hidden force, gives the trajectory."""
    for integrator in (RK4, EULER, IMPLICIT, IMPLICITFAST, DISCRETE):
        if matches(run, student, unforced_run(run, integrator.code, PREFIX), departure):
            return (
                f"The trajectory is that of MuJoCo's own stepping ({integrator.name}): the accelerations did not come "
                "from mujoco.mj_forward."
            )
    return None


def another_time(run: Run, student: Trajectory, departure: float) -> str | None:
    """Returns the sentence if the states are right, but at the wrong time."""
    ours = mujoco_run(run)
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
    """Returns the sentence of a mistake that the numbers themselves show."""
    if np.all(student.qpos == student.qpos[0]):
        return "No step changes the positions."
    if departure < FLOAT32 and np.array_equal(student.qpos, student.qpos.astype(np.float32)):
        return "The state went through 32-bit floats: use NumPy's default, float64."
    return None


def classical(run: Run) -> Callable[..., None]:
    """The right step, as a function of model and data."""
    return stepper(tableau(), forward_of(run))


def another_step(run: Run, student: Trajectory, departure: float) -> str | None:
    """Returns the sentence of the wrong method that gives the trajectory."""
    forward = forward_of(run)

    def is_given_by(method: Method) -> bool:
        step = stepper(method, forward)
        return all(matches(run, student, stepped(run, step, steps), departure) for steps in (GLANCE, PREFIX))

    if sentence := next((sentence for sentence, method in METHODS.items() if is_given_by(method)), None):
        return sentence
    name = next((name for name, method in OTHER_TABLEAUS.items() if is_given_by(method)), None)
    if name is None:
        return None
    if len(run.qpos) == len(run.qvel):
        return f"This is {name}: fourth order, but MuJoCo uses the classical weights 1, 2, 2, 1."
    return (
        f"This is {name} with one mj_integratePos for all slopes, which is of second order on rotations only. MuJoCo "
        "does that with the classical weights 1, 2, 2, 1; another method must be of fourth order on rotations too."
    )


def lazy_steps(entry: str) -> Mapping[str, str]:
    """Returns steps that ignore the model's dynamics."""
    bodies = {
        "a step that does nothing": "pass",
        "a step that advances the time alone": "data.time += model.opt.timestep",
        "a step of constant velocity": "mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)",
        "MuJoCo's own step": "mujoco.mj_step(model, data)",
    }
    return {name: f"import mujoco\n\n\ndef {entry}(model, data):\n    {body}\n" for name, body in bodies.items()}
