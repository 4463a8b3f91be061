# mistake: ctrl is treated as the state of the actuators and advanced with act_dot, while act stands still.
# next: Advance data.act with data.act_dot, and leave data.ctrl as it is.
# status: partial
# told: data.ctrl differs in your calls of mj_forward from before the step: data.ctrl must
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    na = model.na
    q, v, u, t = data.qpos.copy(), data.qvel.copy(), data.ctrl.copy(), data.time

    def F(k, dt):
        if k is not None:
            data.qpos[:] = q + dt * k[0]
            data.qvel[:] = v + dt * k[1]
            data.ctrl[:na] = u[:na] + dt * k[2]
            data.time = t + dt
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = F(None, 0)
    k2 = F(k1, h / 2)
    k3 = F(k2, h / 2)
    k4 = F(k3, h)
    data.qpos[:] = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.ctrl[:na] = u[:na] + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
