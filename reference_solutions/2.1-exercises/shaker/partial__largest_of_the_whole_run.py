# diagnosis: the transient is included
import mujoco
import numpy as np
from mujoco import rollout

def shake(model, data):
    h = model.opt.timestep
    nst = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    s0 = np.zeros(nst)
    mujoco.mj_getState(model, data, s0, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    N = 6000
    t = h * np.arange(N)
    ctrl = np.stack([8 * np.sin(6 * t), 12 * np.ones(N)])[..., None]
    state, _ = rollout.rollout(model, data, np.stack([s0, s0]), ctrl)
    q = state[:, :, 1]
    tt = state[0, :, 0]
    late = tt > 8
    # fit of sin and cos
    A = np.c_[np.sin(6 * tt[late]), np.cos(6 * tt[late])]
    c, *_ = np.linalg.lstsq(A, q[0, late], rcond=None)
    x_end = q[1, -1]
    out = np.abs(q[1] - x_end) > 0.002
    last = out.nonzero()[0].max()
    return {"amplitude": np.abs(q[0]).max(), "settled": tt[last + 1], "rest": np.array([x_end - 5e-5, x_end + 5e-5])}
