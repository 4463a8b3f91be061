"""Scenes whose constraints act throughout, beside those whose constraints switch: orders and active sets."""

from functools import cache

import mujoco
import numpy as np

from grader.numerics.accuracy.convergence import fit_order, measure_position_distance
from grader.numerics.integrators import BY_NAME
from grader.numerics.rollout import simulate
from grader.studies.bench.physics.peers import make_over_mj_forward
from grader.studies.bench.physics.precision import HORIZON_S
from grader.studies.bench.scenes import load_scene

TIMES_S = 0.016 * np.arange(33, dtype=np.float64)
TIMESTEPS_S = [0.008 / 2**k for k in range(5)]
CONSTANT = ("pressed_limit", "resting_sphere", "closed_loop")


def active_sets(scene: str) -> set[tuple[int, ...]]:
    """The kinds of constraint rows that push, at every step of a run at the smallest timestep."""
    start, sets = load_scene(scene), set()
    with start.borrow(timestep_s=TIMESTEPS_S[-1], integrator=BY_NAME["RK4"].code) as workspace:
        model, data = workspace.model, workspace.data
        for _ in range(round(HORIZON_S / TIMESTEPS_S[-1])):
            mujoco.mj_step(model, data)
            quadratic = data.efc_state[: data.nefc] == mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC
            sets.add(tuple(data.efc_type[: data.nefc][quadratic].tolist()))
    return sets


@cache
def order(name: str, integrator: str) -> float:
    """The order that an integrator shows on a scene, against DOP853 over `mj_forward`."""
    scene, code = load_scene(name), BY_NAME[integrator].code
    truth = make_over_mj_forward(scene, "DOP853")(1e-12, TIMES_S)
    runs = [simulate(scene, seconds=0.512, timestep_s=h, integrator=code, at_s=TIMES_S) for h in TIMESTEPS_S]
    return fit_order(TIMESTEPS_S, [measure_position_distance(scene, truth, run.qpos) for run in runs]).order
