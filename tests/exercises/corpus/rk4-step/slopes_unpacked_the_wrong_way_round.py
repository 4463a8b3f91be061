# mistake: The helper returns (qvel, qacc), and the caller unpacks them as (dv, dq): positions move with accelerations and velocities with velocities.
# next: Unpack them in the order in which they are returned.
# status: incorrect
# told: Your positions move by accelerations and your velocities move by velocities: the
import mujoco


def f(model, data, q, v, a, t):
    data.qpos[:], data.qvel[:], data.act[:], data.time = q, v, a, t
    mujoco.mj_forward(model, data)
    return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, a, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    dv1, dq1, da1 = f(model, data, q, v, a, t)
    dv2, dq2, da2 = f(model, data, q + h / 2 * dq1, v + h / 2 * dv1, a + h / 2 * da1, t + h / 2)
    dv3, dq3, da3 = f(model, data, q + h / 2 * dq2, v + h / 2 * dv2, a + h / 2 * da2, t + h / 2)
    dv4, dq4, da4 = f(model, data, q + h * dq3, v + h * dv3, a + h * da3, t + h)
    data.qpos[:] = q + h / 6 * (dq1 + 2 * dq2 + 2 * dq3 + dq4)
    data.qvel[:] = v + h / 6 * (dv1 + 2 * dv2 + 2 * dv3 + dv4)
    data.act[:] = a + h / 6 * (da1 + 2 * da2 + 2 * da3 + da4)
    data.time = t + h
