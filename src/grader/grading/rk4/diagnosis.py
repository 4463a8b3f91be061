"""Names the mistake: the wrong method, or the way round mj_forward, that gives the student's trajectory."""

from collections.abc import Callable

import mujoco
import numpy as np

from grader.grading.rk4.methods import CLASSICAL_STAGES, CLASSICAL_WEIGHTS, stepper, tableau
from grader.grading.rk4.mistakes import METHODS
from grader.grading.rk4.parameters import Problem, Run, replaced
from grader.grading.rk4.trajectories import (
    Trajectory,
    difference,
    forward_of,
    mujocos,
    stepped,
    unforced,
)

PREFIX = 40
"""Steps on which methods are told apart: enough for a fourth-order tableau to differ by more than round-off."""

GLANCE = 3
"""Steps after which most methods are ruled out already, so that they need not take the others."""

ROUND_OFF = 1e-12
"""What two ways to write one method differ by over PREFIX steps.

Source: measured 2e-14, with room for stiffer models.
"""

RELATIVE = 1e-5
"""Of the departure from MuJoCo's RK4: where that is large, round-off has grown with it."""


FLOAT32 = 1e-3
"""A state kept in 32 bits departs by less than this within PREFIX steps."""

INTEGRATORS = {1: "RK4", 0: "Euler", 2: "implicit", 3: "implicitfast", 4: "discrete"}


def matches(run: Run, student: Trajectory, other: Trajectory, departure: float) -> bool:
    """Whether two trajectories agree to round-off over what both have."""
    rows = min(PREFIX, len(student), len(other))
    if rows < 2:
        return False
    return difference(run, student.first(rows), other.first(rows)).worst <= max(ROUND_OFF, RELATIVE * departure)


def departure_of(run: Run, student: Trajectory) -> float:
    """How far the student is from MuJoCo's RK4 within PREFIX steps."""
    return difference(run, student.first(PREFIX), mujocos(run).first(PREFIX)).worst


def name_the_mistake(problem: Problem, student: Trajectory) -> str | None:
    """The sentence of what gives the student's trajectory of the first run, or None."""
    run = problem.runs[0]
    departure = departure_of(run, student)
    if len(student) < 2 or not np.isfinite(departure) or departure <= ROUND_OFF:
        return None
    ways = (another_forward, another_time, another_number, another_step)
    return next((said for way in ways if (said := way(run, student, departure))), None)


def another_forward(run: Run, student: Trajectory, departure: float) -> str | None:
    """Whether the accelerations came from elsewhere than mj_forward."""
    for code, name in INTEGRATORS.items():
        if matches(run, student, unforced(run, code, PREFIX), departure):
            return (
                f"The trajectory is that of MuJoCo's own stepping ({name}): the accelerations did not come from "
                "mujoco.mj_forward."
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
        other = stepped(replaced(run, factor * run.timestep_s, PREFIX), classical(run))
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
