# mistake: the rate of the activation is written by hand as ctrl - act; the time constant is forgotten. Read data.act_dot
# status: partial
# told: In your stage 3 data.act cannot be read as its value at the start of the step plus multiples of
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco


def slopes(model, data):
    mujoco.mj_forward(model, data)
    # first-order filter: the activation follows the control
    rate = data.ctrl - data.act if model.na else data.act.copy()
    return data.qvel.copy(), data.qacc.copy(), rate


def goto(model, data, start, k, dt):
    q, v, w, t = start
    data.qpos[:] = q
    mujoco.mj_integratePos(model, data.qpos, k[0], dt)
    data.qvel[:] = v + dt * k[1]
    data.act[:] = w + dt * k[2]
    data.time = t + dt


def rk4_step(model, data):
    h = model.opt.timestep
    start = (data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time)
    k1 = slopes(model, data)
    goto(model, data, start, k1, h / 2)
    k2 = slopes(model, data)
    goto(model, data, start, k2, h / 2)
    k3 = slopes(model, data)
    goto(model, data, start, k3, h)
    k4 = slopes(model, data)
    goto(model, data, start, [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)], h)
