# diagnosis: Energy range under implicit is measured in a run that begins where another one has ended
import mujoco
import numpy as np


def energy_range(model, data, start, integrator):
    data.time = 0
    model.opt.integrator = integrator
    energies = []
    for _ in range(1500):
        mujoco.mj_step(model, data)
        energies.append(data.energy.sum())
    return np.ptp(energies)


def energies(model, data):
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    start = data.qpos.copy(), data.qvel.copy()
    kinds = mujoco.mjtIntegrator
    return {
        "euler": energy_range(model, data, start, kinds.mjINT_EULER),
        "implicit": energy_range(model, data, start, kinds.mjINT_IMPLICIT),
    }
