# diagnosis: The function let MuJoCo take the step
import mujoco
import numpy as np
from mujoco import rollout


def rk4_step(model, data):
    model.opt.integrator = 1
    spec = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, spec))
    mujoco.mj_getState(model, data, state, spec)
    states, _ = rollout.rollout(model, mujoco.MjData(model), state[None], nstep=1)
    mujoco.mj_setState(model, data, states[0, -1], spec)
