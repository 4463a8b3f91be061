"""RK4 keeps its order while the same constraints act throughout; it is switching that costs it."""

import mujoco
import numpy as np
import pytest

from grader.bench.peers import over_mj_forward
from grader.bench.precision import HORIZON_S
from grader.bench.scenes import load_scene
from grader.numerics.convergence import observed_order, positions_apart
from grader.numerics.integrators import BY_NAME
from grader.numerics.rollout import simulate

TIMES_S = 0.016 * np.arange(33, dtype=np.float64)
TIMESTEPS_S = [0.008 / 2**k for k in range(5)]
CONSTANT = ("pressed_limit", "resting_sphere", "closed_loop")


def active_sets(scene: str) -> set[tuple[int, ...]]:
    """The kinds of constraint rows that push, at every step of a run at the smallest timestep."""
    start, found = load_scene(scene), set()
    with start.borrow(timestep_s=TIMESTEPS_S[-1], integrator=BY_NAME["RK4"].code) as workspace:
        model, data = workspace.model, workspace.data
        for _ in range(round(HORIZON_S / TIMESTEPS_S[-1])):
            mujoco.mj_step(model, data)
            quadratic = data.efc_state[: data.nefc] == mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC
            found.add(tuple(data.efc_type[: data.nefc][quadratic].tolist()))
    return found


@pytest.mark.parametrize("name", CONSTANT)
@pytest.mark.parametrize(("integrator", "order"), [("RK4", 4), ("Euler", 1)])
def test_the_order_of_a_scene_whose_constraints_act_throughout(name: str, integrator: str, order: int) -> None:
    scene, code = load_scene(name), BY_NAME[integrator].code
    truth = over_mj_forward(scene, "DOP853")(1e-12, TIMES_S)
    errors = [
        positions_apart(scene, truth, simulate(scene, seconds=0.512, timestep_s=h, integrator=code, at_s=TIMES_S).qpos)
        for h in TIMESTEPS_S
    ]
    assert observed_order(TIMESTEPS_S, errors).order == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("name", CONSTANT)
def test_their_active_set_is_constant(name: str) -> None:
    (rows,) = active_sets(name)
    assert rows


@pytest.mark.parametrize("name", ["joint_limits", "cube"])
def test_that_of_the_scenes_of_first_order_switches(name: str) -> None:
    assert len(active_sets(name)) > 1
