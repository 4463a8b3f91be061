# diagnosis: Each of your stages starts from the state of the stage before
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, t = data.qpos.copy(), data.qvel.copy(), data.time
    dq, dv = 0, 0
    for weight, part in ((1, 0.5), (2, 0.5), (2, 1.0), (1, 0.0)):
        mujoco.mj_forward(model, data)
        kq, kv = data.qvel.copy(), data.qacc.copy()
        dq, dv = dq + weight * kq, dv + weight * kv
        data.qpos += part * h * kq
        data.qvel += part * h * kv
        data.time = t + part * h
    data.qpos[:] = q + h * dq / 6
    data.qvel[:] = v + h * dv / 6
    data.time = t + h
