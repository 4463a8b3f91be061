# diagnosis: that of a clock or counter of your own
import mujoco


class RungeKutta:
    def __init__(self):
        self.n = 0

    def __call__(self, model, data):
        h = model.opt.timestep
        t = self.n * h
        q, v, w = data.qpos.copy(), data.qvel.copy(), data.act.copy()

        def f(dt, dq, dv, dw):
            data.time = t + dt
            data.qpos[:] = q + dt * dq
            data.qvel[:] = v + dt * dv
            data.act[:] = w + dt * dw
            mujoco.mj_forward(model, data)
            return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

        k1 = f(0, 0, 0, 0)
        k2 = f(h / 2, *k1)
        k3 = f(h / 2, *k2)
        k4 = f(h, *k3)
        data.qpos[:] = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        data.act[:] = w + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
        self.n += 1
        data.time = self.n * h


_stepper = RungeKutta()


def rk4_step(model, data):
    _stepper(model, data)
