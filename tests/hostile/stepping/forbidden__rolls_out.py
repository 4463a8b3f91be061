"""mujoco.rollout, which steps in its own C++ code."""

import mujoco
import numpy as np
from mujoco import rollout


def step(model, data):
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    states, _ = rollout.rollout(model, mujoco.MjData(model), state, nstep=1)
    mujoco.mj_setState(model, data, states[0, -1], kind)
