# diagnosis: is the standard deviation
import mujoco
import numpy as np


def energy_range(model, data, start, integrator):
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = start
    model.opt.integrator = integrator
    energies = []
    for _ in range(1500):
        mujoco.mj_step(model, data)
        energies.append(data.energy.sum())
    return np.std(energies)


def energies(model, data):
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    start = data.qpos.copy(), data.qvel.copy()
    kinds = mujoco.mjtIntegrator
    return {
        "euler": energy_range(model, data, start, kinds.mjINT_EULER),
        "implicit": energy_range(model, data, start, kinds.mjINT_IMPLICIT),
    }
