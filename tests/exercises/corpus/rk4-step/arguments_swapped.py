# mistake: The function takes (data, model) although it is called with (model, data).
# next: Write def rk4_step(model, data).
# status: crashed
# told: AttributeError: 'mujoco._structs.MjData' object has
import mujoco


def slope(data, model, q, v, w, t):
    data.qpos[:], data.qvel[:], data.act[:] = q, v, w
    data.time = t
    mujoco.mj_forward(model, data)
    return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()


def rk4_step(data, model):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    k1 = slope(data, model, q, v, w, t)
    k2 = slope(data, model, q + h / 2 * k1[0], v + h / 2 * k1[1], w + h / 2 * k1[2], t + h / 2)
    k3 = slope(data, model, q + h / 2 * k2[0], v + h / 2 * k2[1], w + h / 2 * k2[2], t + h / 2)
    k4 = slope(data, model, q + h * k3[0], v + h * k3[1], w + h * k3[2], t + h)
    data.qpos[:] = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = w + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
