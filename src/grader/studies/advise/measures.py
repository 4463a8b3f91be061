"""Evaluates a quantity that MuJoCo computes from a state, at every kept state of a run."""

from collections.abc import Callable

import mujoco
import numpy as np

from grader.numerics.accuracy.reference import Reference
from grader.numerics.integrators import EULER
from grader.numerics.rollout import Rollout
from grader.numerics.scene import Scene, Vector, freeze


def measure_quantity(
    scene: Scene, rollout: Rollout | Reference, quantity: Callable[[mujoco.MjModel, mujoco.MjData], float]
) -> Vector:
    """`quantity(model, data)` at every kept state, (n,), each after mj_forward with energies enabled. `quantity` may
    write its model and data, which no other run uses."""
    timestep_s, code = (rollout.timestep_s, rollout.integrator) if isinstance(rollout, Rollout) else (None, EULER.code)
    values = np.empty(len(rollout.time))
    with scene.borrow(timestep_s=timestep_s, integrator=code, keep=False) as workspace:
        model, data = workspace.model, workspace.data
        workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        for row, time_s in enumerate(rollout.time):
            data.time = time_s
            data.qpos[:], data.qvel[:], data.act[:] = rollout.qpos[row], rollout.qvel[row], rollout.act[row]
            mujoco.mj_forward(model, data)
            values[row] = quantity(model, data)
    return freeze(values)
