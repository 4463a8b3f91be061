# diagnosis: The function let MuJoCo take the step
import mujoco
import numpy as np


def rk4_step(model, data):
    """Find the force that mj_forward adds, and smuggle it into MuJoCo's own RK4."""
    scratch = mujoco.MjData(model)

    def smuggle(m, d):
        mujoco.set_mjcb_passive(None)
        scratch.qpos[:], scratch.qvel[:], scratch.act[:], scratch.time = d.qpos, d.qvel, d.act, d.time
        mujoco.mj_forward(model, scratch)
        d.qfrc_passive[:] += scratch.qfrc_smooth - (
            scratch.qfrc_passive - scratch.qfrc_bias + scratch.qfrc_actuator + scratch.qfrc_applied
        )
        mujoco.set_mjcb_passive(smuggle)

    model.opt.integrator = 1
    mujoco.set_mjcb_passive(smuggle)
    mujoco.mj_step(model, data)
    mujoco.set_mjcb_passive(None)
