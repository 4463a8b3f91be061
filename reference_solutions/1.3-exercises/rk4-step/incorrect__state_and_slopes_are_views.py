# diagnosis: q, v and the slopes are views
import mujoco
def rk4_step(model, data):
    h = model.opt.timestep
    q, v = data.qpos, data.qvel
    mujoco.mj_forward(model, data); k1v, k1 = v, data.qacc
    data.qpos[:] = q + h/2*k1v; data.qvel[:] = v + h/2*k1
    mujoco.mj_forward(model, data); k2v, k2 = data.qvel, data.qacc
    data.qpos[:] = q + h/2*k2v; data.qvel[:] = v + h/2*k2
    mujoco.mj_forward(model, data); k3v, k3 = data.qvel, data.qacc
    data.qpos[:] = q + h*k3v; data.qvel[:] = v + h*k3
    mujoco.mj_forward(model, data); k4v, k4 = data.qvel, data.qacc
    data.qpos[:] = q + h/6*(k1v+2*k2v+2*k3v+k4v); data.qvel[:] = v + h/6*(k1+2*k2+2*k3+k4)
    data.time += h
