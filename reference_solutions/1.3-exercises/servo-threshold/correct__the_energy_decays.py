"""Stable means: the energy of servo and pendulum at the end is below that at the start. One number, the middle."""
import mujoco
import numpy as np


def decays(model, h):
    model.opt.timestep = h
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    mujoco.mj_forward(model, data)
    kp = model.actuator_gainprm[0, 0]

    def energy():
        mujoco.mj_forward(model, data)
        return data.energy.sum() + 0.5 * kp * data.qpos[0] ** 2

    start = energy()
    for _ in range(int(30 / h)):
        mujoco.mj_step(model, data)
        if not np.isfinite(data.qpos[0]) or abs(data.qpos[0]) > 1e3:
            return False
    return energy() < start


def largest_stable_timestep(model, integrator):
    model.opt.integrator = integrator
    lo, hi = 0.001, 0.05
    if decays(model, hi):
        return None
    while hi - lo > 1e-4:
        mid = (lo + hi) / 2
        if decays(model, mid):
            lo = mid
        else:
            hi = mid
    return (lo + hi) / 2
