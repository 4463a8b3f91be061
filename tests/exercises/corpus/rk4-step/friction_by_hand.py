# mistake: Friction of the student's own is subtracted from data.qacc; mj_forward has counted all the model has.
# next: Take data.qacc as it is.
# status: incorrect
# told: Your accelerations are data.qacc minus 1/10 times the velocity
import mujoco


def acceleration(model, data):
    mujoco.mj_forward(model, data)
    # mj_forward does not know about the friction in the joints
    return data.qacc - (model.dof_damping + 0.1) * data.qvel


def rk4_step(model, data):
    h = model.opt.timestep
    x0, v0, s0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    dx, dv, ds = [], [], []
    for part in (0, 0.5, 0.5, 1):
        data.qpos[:] = x0 + (part * h * dx[-1] if dx else 0)
        data.qvel[:] = v0 + (part * h * dv[-1] if dv else 0)
        data.act[:] = s0 + (part * h * ds[-1] if ds else 0)
        data.time = t0 + part * h
        dv.append(acceleration(model, data))
        dx.append(data.qvel.copy())
        ds.append(data.act_dot.copy())
    data.qpos[:] = x0 + h / 6 * (dx[0] + 2 * dx[1] + 2 * dx[2] + dx[3])
    data.qvel[:] = v0 + h / 6 * (dv[0] + 2 * dv[1] + 2 * dv[2] + dv[3])
    data.act[:] = s0 + h / 6 * (ds[0] + 2 * ds[1] + 2 * ds[2] + ds[3])
    data.time = t0 + h
