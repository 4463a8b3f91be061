"""Evaluates a quantity that MuJoCo computes from a state, at every kept state of a run."""

from collections.abc import Callable

import mujoco
import numpy as np

from grader.numerics.accuracy.reference import Reference
from grader.numerics.integrators import EULER
from grader.numerics.rollout import Rollout
from grader.numerics.scene import Scene, Vector, freeze
from grader.numerics.workspace import Workspace


def measure_quantity(
    scene: Scene, rollout: Rollout | Reference, quantity: Callable[[mujoco.MjModel, mujoco.MjData], float]
) -> Vector:
    """`quantity(model, data)` at every kept state, (n,), each after mj_forward with energies enabled. `quantity` may
    write its model and data, which no other run uses."""
    options = (rollout.timestep_s, rollout.integrator) if isinstance(rollout, Rollout) else (None, EULER.code)
    with scene.borrow(timestep_s=options[0], integrator=options[1], keep=False) as workspace:
        workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        return freeze(np.array([_evaluate(workspace, rollout, index, quantity) for index in range(len(rollout.time))]))


def _evaluate(
    workspace: Workspace,
    rollout: Rollout | Reference,
    index: int,
    quantity: Callable[[mujoco.MjModel, mujoco.MjData], float],
) -> float:
    model, data = workspace.model, workspace.data
    data.time = rollout.time[index]
    data.qpos[:], data.qvel[:], data.act[:] = rollout.qpos[index], rollout.qvel[index], rollout.act[index]
    mujoco.mj_forward(model, data)
    return quantity(model, data)
