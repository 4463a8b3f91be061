# mistake: The state at the start of the step is stored in a global once, so every later step starts from the first state again.
# next: Copy qpos, qvel, act and time at the beginning of every call.
# status: incorrect
# told: Your step does not begin at the state in data, but at one that an earlier call has
import mujoco

START = {}


def slope(model, data, q, v, w, t):
    data.qpos[:] = q
    data.qvel[:] = v
    data.act[:] = w
    data.time = t
    mujoco.mj_forward(model, data)
    return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    if "q" not in START or len(START["q"]) != model.nq:
        START["q"] = data.qpos.copy()
        START["v"] = data.qvel.copy()
        START["w"] = data.act.copy()
        START["t"] = data.time
    q, v, w, t = START["q"], START["v"], START["w"], START["t"]
    h = model.opt.timestep
    q1, v1, w1 = slope(model, data, q, v, w, t)
    q2, v2, w2 = slope(model, data, q + h / 2 * q1, v + h / 2 * v1, w + h / 2 * w1, t + h / 2)
    q3, v3, w3 = slope(model, data, q + h / 2 * q2, v + h / 2 * v2, w + h / 2 * w2, t + h / 2)
    q4, v4, w4 = slope(model, data, q + h * q3, v + h * v3, w + h * w3, t + h)
    data.qpos[:] = q + h / 6 * (q1 + 2 * q2 + 2 * q3 + q4)
    data.qvel[:] = v + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    data.act[:] = w + h / 6 * (w1 + 2 * w2 + 2 * w3 + w4)
    data.time = t + h
