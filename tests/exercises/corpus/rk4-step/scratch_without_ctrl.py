# mistake: the stages run on a scratch MjData to which ctrl was not copied: the actuators get no input there
# status: partial
# told: data.ctrl differs in your calls of mj_forward from before the step: data.ctrl must
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    tmp = mujoco.MjData(model)  # so that data stays untouched until the end

    def slopes(q, v, w, t):
        tmp.qpos[:] = q
        tmp.qvel[:] = v
        tmp.act[:] = w
        tmp.time = t
        mujoco.mj_forward(model, tmp)
        return tmp.qvel.copy(), tmp.qacc.copy(), tmp.act_dot.copy()

    q, v, w, t = data.qpos, data.qvel, data.act, data.time
    a = slopes(q, v, w, t)
    b = slopes(q + h / 2 * a[0], v + h / 2 * a[1], w + h / 2 * a[2], t + h / 2)
    c = slopes(q + h / 2 * b[0], v + h / 2 * b[1], w + h / 2 * b[2], t + h / 2)
    d = slopes(q + h * c[0], v + h * c[1], w + h * c[2], t + h)
    data.qpos[:] += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
    data.qvel[:] += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    data.act[:] += h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2])
    data.time += h
