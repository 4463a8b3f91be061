"""Records every step of a run in one call of C, by mujoco.rollout: a chunk of one step costs three times the step.

It runs in the calling thread, without the interpreter's lock. In threads of its own an error of MuJoCo, such as a model
whose memory is too small, would end the process, where here it is raised.
"""

import mujoco
import mujoco.rollout
import numpy as np
from mujoco import mjtState
from numpy.typing import NDArray

from grader.numerics.workspace import Workspace

SPARSE = 4
"""From this many steps for each kept state on, chunks of steps cost less. Source: measured on the lesson's models; a
chunk costs 1.6 us beside its steps, a recorded step 0.1."""

PHYSICS = int(mjtState.mjSTATE_FULLPHYSICS)

_ROLLOUT = mujoco.rollout.Rollout(nthread=0)
"""Without threads it has no state."""


def record_steps(workspace: Workspace, steps: int, inputs: int) -> tuple[NDArray[np.float64], int] | None:
    """Returns the states at the start and after each step, (steps + 1, size of mjSTATE_FULLPHYSICS), and the number of
    completed steps; the rows of others mean nothing. `inputs` are those of `find_inputs`. None where it cannot be told
    at which step the run ended; the workspace then has to be restarted."""
    model, data = workspace.model, workspace.data
    states = np.empty((1, steps + 1, mujoco.mj_stateSize(model, PHYSICS)))
    mujoco.mj_getState(model, data, states[0, 0], PHYSICS)
    control = None
    if inputs:
        held = np.empty(mujoco.mj_stateSize(model, inputs))
        mujoco.mj_getState(model, data, held, inputs)
        control = np.tile(held, (1, steps, 1))
    warmstart, workspace.known = data.qacc_warmstart[None].copy(), None
    try:
        _ROLLOUT.rollout(
            [model], [data], states[:, 0], control, control_spec=inputs, skip_checks=True, nstep=steps,
            initial_warmstart=warmstart, state=states[:, 1:],
        )  # fmt: skip
    except mujoco.FatalError:
        return None
    done = count_completed(states[0, :, 0], any(workspace.warned), workspace.timestep_s)
    return None if done is None else (states[0], done)


def count_completed(times_s: NDArray[np.float64], warned: bool, timestep_s: float) -> int | None:
    """Returns the number of steps before the one that warned, from the times [s] of a rollout, its start included; None
    where they do not tell.

    After the step that warned, mujoco.rollout repeats its state. MuJoCo restarts the clock at that step, so that it
    reads one timestep, except for warnings about the size of its memory and for models without automatic resets.
    """
    steps = len(times_s) - 1
    late = ~(times_s[1:] > times_s[:-1])  # true for NaN too
    first = int(np.argmax(late)) if late.any() else steps
    if not warned:
        return steps if first == steps else None
    if first == steps:
        return steps - 1
    now = times_s[first]
    if times_s[first + 1] < now:
        return first
    is_certain = first > 0 and now != timestep_s and now + timestep_s > now
    return first - 1 if is_certain else None


def find_inputs(model: mujoco.MjModel, data: mujoco.MjData) -> int:
    """Returns the inputs, as bits of mjtState, that mujoco.rollout has to be given: it resets the others."""
    inputs = int(mjtState.mjSTATE_MOCAP_POS | mjtState.mjSTATE_MOCAP_QUAT) if model.nmocap else 0
    parts = (
        (mjtState.mjSTATE_CTRL, data.ctrl, 0.0),
        (mjtState.mjSTATE_QFRC_APPLIED, data.qfrc_applied, 0.0),
        (mjtState.mjSTATE_XFRC_APPLIED, data.xfrc_applied, 0.0),
        (mjtState.mjSTATE_EQ_ACTIVE, data.eq_active, model.eq_active0),
    )
    for bit, values, reset in parts:
        if np.any(values != reset):
            inputs |= int(bit)
    return inputs
