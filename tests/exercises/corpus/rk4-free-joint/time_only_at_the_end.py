# mistake: data.time is moved at the end only; the stages see the time of the start.
# next: Set data.time before each mj_forward: t, t + h/2, t + h/2, t + h.
# status: partial
# told: data.time stands at the start of the step in all four calls of mj_forward: set data.time
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, act = data.qpos.copy(), data.qvel.copy(), data.act.copy()

    def stage(dt, k):
        data.qpos[:] = q
        mujoco.mj_integratePos(model, data.qpos, k[0], dt)
        data.qvel[:] = v + dt * k[1]
        data.act[:] = act + dt * k[2]

    def slope():
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = slope()
    stage(h / 2, k1)
    k2 = slope()
    stage(h / 2, k2)
    k3 = slope()
    stage(h, k3)
    k4 = slope()
    stage(h, [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)])
    data.time += h
