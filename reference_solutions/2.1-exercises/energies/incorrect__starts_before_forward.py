# diagnosis: includes a 0 that the run does not have
"""Reads the energy of the start before MuJoCo has computed any."""
import mujoco
import numpy as np


def energies(model, data):
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    spans = {}
    for name in ("euler", "implicit"):
        model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}")
        run = mujoco.MjData(model)
        run.qpos[:], run.qvel[:] = data.qpos, data.qvel
        total = [run.energy.sum()]
        for _ in range(1500):
            mujoco.mj_step(model, run)
            total.append(run.energy.sum())
        spans[name] = np.ptp(total)
    return spans
