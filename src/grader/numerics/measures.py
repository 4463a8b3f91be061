"""Measures of a Rollout: energy, and any quantity that MuJoCo computes from a state."""

from collections.abc import Callable

import mujoco
import numpy as np

from grader.numerics.reference import Reference
from grader.numerics.rollout import Rollout
from grader.numerics.scene import Scene, Vector, frozen
from grader.numerics.workspace import Workspace

EULER = int(mujoco.mjtIntegrator.mjINT_EULER)


def energy(scene: Scene, rollout: Rollout | Reference) -> Vector:
    """Potential plus kinetic energy at every kept state [J], (n,), with the start's controls."""

    def total(model: mujoco.MjModel, data: mujoco.MjData) -> float:
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        return float(data.energy[0] + data.energy[1])

    return measure(scene, rollout, total)


def measure(
    scene: Scene, rollout: Rollout | Reference, quantity: Callable[[mujoco.MjModel, mujoco.MjData], float]
) -> Vector:
    """`quantity(model, data)` at every kept state, after mj_forward with its energies, (n,).

    It has a model and a data of its own, which it may write.
    """
    options = (rollout.timestep_s, rollout.integrator) if isinstance(rollout, Rollout) else (None, EULER)
    with scene.borrow(timestep_s=options[0], integrator=options[1], keep=False) as workspace:
        workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        return frozen(np.array([_at(workspace, rollout, index, quantity) for index in range(len(rollout.time))]))


def _at(
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
