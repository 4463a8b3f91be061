"""Names the mistake behind a wrong trajectory: by its trace, else by simulating wrong methods until one gives it. The
simulation knows few methods. It is for scripts whose trace cannot be read: forged, cut, or with too many calls."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.exercises.explaining.values import find_origin, find_view
from grader.exercises.kind import JudgedTrial, Mistake
from grader.exercises.kinds.rk4.diagnosis import Diagnosis, diagnose_passed_run, diagnose_run
from grader.exercises.kinds.rk4.judging.driver import Forward
from grader.exercises.kinds.rk4.judging.judge import Rk4Outcome, RunOutcome
from grader.exercises.kinds.rk4.judging.quaternions import find_quaternions
from grader.exercises.kinds.rk4.judging.run import Problem, Run, with_timestep
from grader.exercises.kinds.rk4.judging.trajectory import (
    Trajectory,
    build_forward,
    compare,
    simulate_mujoco,
    simulate_unforced,
    simulate_with,
    subtract_positions,
)
from grader.exercises.kinds.rk4.lines import StepPlace, find_line
from grader.exercises.kinds.rk4.methods import NAMED, chain_stages, chain_stages_and_result
from grader.exercises.kinds.rk4.sentences.tableaus import WRONG_WEIGHTS, describe_method
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Matrix, Row
from grader.exercises.trace import Trace
from grader.numerics.integrators import DISCRETE, EULER, IMPLICIT, IMPLICITFAST, RK4

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

FAR, NEAR = 1e-2, 2e-3
"""Differences of quaternions: a wrong sign gives more than the one, two methods of fourth order less than the other."""

VIEW = re.compile(r"\bis a view\b|\bare views\b|\balias(?:es)? data\.|without \.copy\(\)")
"""What sentences say of a field of data that is kept without a copy."""

FIELD = re.compile(r"\bdata\.(qpos|qvel|qacc|act_dot)\b")

Vector = NDArray[np.float64]
State = tuple[Vector, Vector]


@dataclass(frozen=True)
class ModelMotion:
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


Method = Callable[[ModelMotion, Vector, Vector, float, float], State]
"""(motion, q, v, time, h) -> (q, v) after the step."""


def build_step(method: Method, forward: Forward) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """Returns a method as a function of model and data, like the student's."""

    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        time, h = float(data.time), float(model.opt.timestep)
        q, v = method(ModelMotion(model, data, forward), data.qpos.copy(), data.qvel.copy(), time, h)
        data.qpos[:], data.qvel[:], data.time = q, v, time + h

    return step


def add_weighted(weights: Row, parts: Sequence[Vector]) -> Vector:
    """Returns the weighted sum of as many parts as there are weights."""
    return np.array(np.add.reduce([w * part for w, part in zip(weights, parts, strict=False)]))


def build_method(rows: Matrix) -> Method:
    """Returns the explicit Runge-Kutta method of a tableau: stages, then weights."""

    def step(motion: ModelMotion, q: Vector, v: Vector, time: float, h: float) -> State:
        *stages, weights = rows
        velocities, slopes = list[Vector](), list[Vector]()
        for row in stages:
            position = motion.move(q, add_weighted(row, velocities), h) if any(row) else q
            velocity = v + h * add_weighted(row, slopes) if any(row) else v
            velocities.append(velocity)
            slopes.append(motion.accelerate(position, velocity, time + sum(row) * h))
        return motion.move(q, add_weighted(weights, velocities), h), v + h * add_weighted(weights, slopes)

    return step


def step_semi_implicit(motion: ModelMotion, q: Vector, v: Vector, time: float, h: float) -> State:
    """MuJoCo's Euler without damping: the new velocity moves the position."""
    v = v + h * motion.accelerate(q, v, time)
    return motion.move(q, v, h), v


WRONG: Sequence[Matrix] = (
    *NAMED.values(),
    chain_stages(CLASSICAL),
    chain_stages_and_result(CLASSICAL),
    *([*CLASSICAL[:-1], weights] for weights in WRONG_WEIGHTS),
)
"""Tableaus of wrong methods, those that are met most."""

METHODS: Mapping[str, Method] = {
    "This is semi-implicit Euler: one acceleration a step, not four. Add the stages k2, k3 and k4.": step_semi_implicit,
    **{describe_method(rows, "state"): build_method(rows) for rows in WRONG},
}
"""The method behind each sentence for the student; the first one that gives the trajectory is named."""


def matches(run: Run, student: Trajectory, other: Trajectory, departure: float) -> bool:
    """Whether two trajectories agree to round-off over their common steps."""
    rows = min(PREFIX, len(student), len(other))
    if rows < 2:
        return False
    return compare(run, student.take_first(rows), other.take_first(rows)).worst <= max(ROUND_OFF, RELATIVE * departure)


def measure_departure(run: Run, student: Trajectory) -> float:
    """Returns the largest difference from MuJoCo's RK4 within PREFIX steps."""
    return compare(run, student.take_first(PREFIX), simulate_mujoco(run).take_first(PREFIX)).worst


def name_the_mistake(first_case: str, judged: Sequence[JudgedTrial[Problem, Rk4Outcome]]) -> Mistake | None:
    """Returns the mistake in the first wrong trajectory; None if it is not recognised. What the trace shows comes
    first. Then the trajectory is compared with those of wrong methods; at last the trace says up to where the step can
    be read."""
    failed = [trial for trial in judged if not trial.judgement.passed]
    if not failed or not isinstance(failed[0].judgement.outcome, RunOutcome):
        return None
    outcome = failed[0].judgement.outcome
    runs = [trial for trial in judged if isinstance(trial.judgement.outcome, RunOutcome)]
    diagnosis = diagnose_run([run for run in runs if run in failed])
    if diagnosis.sentence is None and failed[0].trial.hidden:
        passed = (diagnose_passed_run(run) for run in runs if run not in failed and not run.hidden)
        diagnosis = next((candidate for candidate in passed if candidate.sentence), diagnosis)
    if diagnosis.sentence:
        return Mistake(diagnosis.sentence, find_mistaken_line(diagnosis, runs))
    if wraps_angles(outcome):
        return Mistake(
            "You wrap angles into one turn: MuJoCo does not, so leave data.qpos as it comes out of the step."
        )
    if loses_sign(outcome):
        return Mistake(
            "Your step changes the sign of a quaternion's w and leaves x, y and z as they are: that is another "
            "rotation. A quaternion and its negative are the same one, so change all four signs, or none."
        )
    is_first = outcome.problem.case == first_case
    sentence = (name_the_step(outcome) if is_first else name_the_state(outcome)) or (
        diagnosis.fallback if is_first else None
    )
    return Mistake(sentence) if sentence else None


def find_mistaken_line(diagnosis: Diagnosis, runs: Sequence[JudgedTrial[Problem, Rk4Outcome]]) -> int | None:
    """Returns the line that a diagnosis is about: that of the view which it names, else the one that computes what the
    step writes at its place."""
    script, sentence = runs[0].script, diagnosis.sentence or ""
    if VIEW.search(sentence) and (line := find_view(script, FIELD.findall(sentence))) is not None:
        return line
    line = find_first_line([run.trace for run in runs], diagnosis.place)
    return None if line is None or diagnosis.place is None else find_origin(script, line, diagnosis.place.part)


def find_first_line(traces: Sequence[Trace], place: StepPlace | None) -> int | None:
    """Returns the line of a place in a step, from the first trace that tells it."""
    return next((line for trace in traces if place and (line := find_line(trace, place)) is not None), None)


def name_the_step(wrong: RunOutcome) -> str | None:
    """Returns the sentence of the first explanation that gives a trajectory."""
    run, student = wrong.run, wrong.student
    departure = measure_departure(run, student)
    if len(student) < 2 or not np.isfinite(departure) or departure <= ROUND_OFF:
        return None
    explanations = (explain_other_forward, explain_shifted_time, explain_odd_numbers, explain_wrong_method)
    return next((sentence for explain in explanations if (sentence := explain(run, student, departure))), None)


def name_the_state(wrong: RunOutcome) -> str | None:
    """Returns the sentence of a part of the state that does not change although it should."""
    student, ours = wrong.student, simulate_mujoco(wrong.run)
    if not len(student):
        return None
    if wrong.problem.time_matters and (student.time == student.time[0]).all():
        return "data.time does not change: set it at every stage, and advance it by model.opt.timestep in every step."
    if ours.act.size and (student.act == student.act[0]).all():
        return "data.act does not change: advance it with data.act_dot, as you advance qvel with qacc."
    if len(student) > 1 and np.any(np.all(student.qvel == student.qvel[0], axis=0)):
        return "Some velocities do not change: a model may have more joints than you move, so advance all of data.qvel."
    return None


def wraps_angles(wrong: RunOutcome) -> bool:
    """Whether the trajectory first departs by whole turns of hinges, and by nothing else."""
    if wrong.first_departure is None:
        return False
    run, here, model = wrong.run, slice(wrong.first_departure - 1, wrong.first_departure), wrong.run.scene().model
    turns = subtract_positions(run, simulate_mujoco(run).qpos[here], wrong.student.qpos[here])[0] / (2 * np.pi)
    hinges = model.jnt_dofadr[model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)]
    whole = np.zeros(model.nv)
    whole[hinges] = np.round(turns[hinges])
    return bool(whole.any() and np.all(np.abs(turns - whole) <= WHOLE_TURN))


def loses_sign(wrong: RunOutcome) -> bool:
    """Whether the first quaternion that is far from the right one has the sign of w turned, and nothing else."""
    ours, theirs = simulate_mujoco(wrong.run).qpos, wrong.student.qpos
    rows = min(len(ours), len(theirs))
    for address in find_quaternions(wrong.run.scene().model):
        here = slice(address.qpos, address.qpos + 4)
        one, other = ours[:rows, here], theirs[:rows, here]
        far = np.flatnonzero(measure_turns(one, other) > FAR)
        if len(far) and measure_turns(one, other * [-1, 1, 1, 1])[far[0]] <= NEAR:
            return True
    return False


def measure_turns(one: Vector, other: Vector) -> Vector:
    """Returns the difference of quaternions (n, 4), whatever their signs."""
    apart, against = (np.max(np.abs(one - sign * other), axis=1) for sign in (1, -1))
    return np.array(np.minimum(apart, against))


def explain_other_forward(run: Run, student: Trajectory, departure: float) -> str | None:
    """Returns the sentence if MuJoCo's own stepping, which lacks the hidden force, gives the trajectory."""
    for integrator in (RK4, EULER, IMPLICIT, IMPLICITFAST, DISCRETE):
        if matches(run, student, simulate_unforced(run, integrator.code, PREFIX), departure):
            return (
                f"The trajectory is that of MuJoCo's own stepping ({integrator.name}), without the force that "
                "mj_forward carries here: the accelerations did not come from data.qacc, as mujoco.mj_forward leaves "
                "it. Take them from there."
            )
    return None


def explain_shifted_time(run: Run, student: Trajectory, departure: float) -> str | None:
    """Returns the sentence if the states are right, but at the wrong time."""
    ours = simulate_mujoco(run)
    if matches(run, student.take(slice(1, PREFIX)), ours.take(slice(0, PREFIX - 1)), departure):
        return "You are one step behind: the first call does not advance the state. Advance it once in every call."
    if matches(run, student.take_first(PREFIX), ours.take(slice(1, PREFIX + 1)), departure):
        return "You are one step ahead: the first call takes two steps. Take one in every call."
    for factor in (0.5, 2.0):
        other = simulate_with(with_timestep(run, factor * run.timestep_s, PREFIX), build_classical(run))
        if matches(run, student, other, departure):
            return f"Every step advances by {factor:g} times model.opt.timestep: take h = model.opt.timestep itself."
    return None


def explain_odd_numbers(run: Run, student: Trajectory, departure: float) -> str | None:
    """Returns the sentence of a mistake that the numbers themselves show."""
    if np.all(student.qpos == student.qpos[0]):
        return (
            "No step changes the positions: your step gives data.qvel no acceleration. Call mujoco.mj_forward at every "
            "stage, and take data.qacc from it."
        )
    if departure < FLOAT32 and np.array_equal(student.qpos, student.qpos.astype(np.float32)):
        return "The state went through 32-bit floats: use NumPy's default, float64."
    return None


def build_classical(run: Run) -> Callable[..., None]:
    """Returns the right step, as a function of model and data."""
    return build_step(build_method(CLASSICAL), build_forward(run))


def explain_wrong_method(run: Run, student: Trajectory, departure: float) -> str | None:
    """Returns the sentence of the wrong method that gives the trajectory."""
    forward = build_forward(run)

    def is_given_by(method: Method) -> bool:
        step = build_step(method, forward)
        return all(matches(run, student, simulate_with(run, step, steps), departure) for steps in (GLANCE, PREFIX))

    return next((sentence for sentence, method in METHODS.items() if is_given_by(method)), None)


def write_lazy_steps(entry: str) -> Mapping[str, str]:
    """Returns steps that ignore the model's dynamics."""
    bodies = {
        "a step that does nothing": "pass",
        "a step that advances the time alone": "data.time += model.opt.timestep",
        "a step of constant velocity": "mujoco.mj_integratePos(model, data.qpos, data.qvel, model.opt.timestep)",
        "MuJoCo's own step": "mujoco.mj_step(model, data)",
        "a step to zero": "data.qpos[:] = data.qvel[:] = data.act[:] = 0",
        "a step to huge numbers": "data.qpos[:] = data.qvel[:] = data.act[:] = 1e300",
    }
    return {name: f"import mujoco\n\n\ndef {entry}(model, data):\n    {body}\n" for name, body in bodies.items()}
