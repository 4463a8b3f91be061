"""Solves for the exact motion of a case, and rehearses what a judgement needs."""

from functools import lru_cache, partial

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.judging.judge import Truth, coarsen, list_sample_times
from grader.exercises.kinds.rk4.judging.run import Problem, Run, with_timestep
from grader.exercises.kinds.rk4.judging.trajectory import Trajectory, build_forward, simulate_mujoco
from grader.numerics.accuracy.reference import solve_dop853

ORDER_RTOL = 1e-13
"""Gives the truth an error of 1e-12, a thirtieth of the smallest error that the order check meets (3e-11)."""

CASE_RTOL = 1e-12
"""Gives the truth of a case without order check an error of 1e-11, a tenth of TRUTH_FLOOR."""


def build_truth(problem: Problem) -> Truth:
    """Returns the exact motion of a case; the order check uses that of the first case too."""
    run = problem.run
    held = [*problem.order_runs, *([run, coarsen(run)[0]] if problem.accepts_other_methods else [])]
    times = sorted({time for other in held for time in list_sample_times(other)})
    rtol = ORDER_RTOL if problem.order_runs else CASE_RTOL
    return Truth(tuple(times), partial(solve_motion, with_timestep(run, 1.0, 1), tuple(times), rtol))


def rehearse(problem: Problem) -> None:
    """Simulates, and solves for the exact motion where the judgement needs it. Raises ValueError where the scene has
    constraints, or its motion does not stay finite."""
    if problem.asks_order:
        return
    cure = "take a start with less energy, smaller gains or a smaller timestep_s"
    try:
        with np.errstate(all="ignore"):  # a motion that diverges overflows first
            prepare(problem)
            if problem.order_runs:
                build_truth(problem).solve()
    except (RuntimeError, mujoco.FatalError) as error:
        raise ValueError(f"the motion cannot be solved ({error}): {cure}") from error
    if len(simulate_mujoco(problem.run)) < problem.run.steps:
        raise ValueError(f"MuJoCo's own run of {problem.run.steps} steps diverges: {cure}")


def prepare(problem: Problem) -> None:
    """Simulates by MuJoCo's method and solves for the exact motion, where every judgement needs them."""
    if not problem.asks_order:
        simulate_mujoco(problem.run)
    if problem.asks_order or problem.accepts_other_methods:
        build_truth(problem).solve()


@lru_cache(maxsize=64)
def solve_motion(run: Run, times_s: tuple[float, ...], rtol: float) -> Trajectory:
    """Solves for the motion at ascending times [s]. Raises ValueError where the scene has constraints."""
    reference = solve_dop853(run.scene(), times_s, rtol=rtol, forward=build_forward(run))
    return Trajectory(reference.time, reference.qpos, reference.qvel, reference.act)
