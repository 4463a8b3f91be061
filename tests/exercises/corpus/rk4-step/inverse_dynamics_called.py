# mistake: mj_inverse is called where mj_forward is meant: it computes forces from data.qacc, and leaves data.qacc as it was.
# next: Call mj_forward in every stage.
# status: incorrect
# told: No step changes the positions: your step gives data.qvel no acceleration. Call
import mujoco as mj


def derivative(model, data, q, v, act, t):
    data.qpos[:] = q
    data.qvel[:] = v
    data.act[:] = act
    data.time = t
    mj.mj_inverse(model, data)
    return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    a = derivative(model, data, q, v, act, t)
    b = derivative(model, data, q + h / 2 * a[0], v + h / 2 * a[1], act + h / 2 * a[2], t + h / 2)
    c = derivative(model, data, q + h / 2 * b[0], v + h / 2 * b[1], act + h / 2 * b[2], t + h / 2)
    d = derivative(model, data, q + h * c[0], v + h * c[1], act + h * c[2], t + h)
    data.qpos[:] = q + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
    data.qvel[:] = v + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    data.act[:] = act + h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2])
    data.time = t + h
