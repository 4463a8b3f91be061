# mistake: The activation slopes are summed with the right weights, but data.act is not moved to the stages, so all four slopes are those of the start.
# next: Before each mj_forward set data.act to its start plus the stage's fraction of the slope before.
# status: partial
# told: data.act stands at the start of the step in all your stages: write it before every
import mujoco


def stage(model, data, q, v, t):
    data.qpos[:] = q
    data.qvel[:] = v
    data.time = t
    mujoco.mj_forward(model, data)
    return data.qacc.copy(), data.act_dot.copy()


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q = data.qpos.copy()
    v = data.qvel.copy()
    a1, d1 = stage(model, data, q, v, t)
    v2 = v + 0.5 * h * a1
    a2, d2 = stage(model, data, q + 0.5 * h * v, v2, t + 0.5 * h)
    v3 = v + 0.5 * h * a2
    a3, d3 = stage(model, data, q + 0.5 * h * v2, v3, t + 0.5 * h)
    v4 = v + h * a3
    a4, d4 = stage(model, data, q + h * v3, v4, t + h)
    data.qpos[:] = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] += h / 6 * (d1 + 2 * d2 + 2 * d3 + d4)
    data.time = t + h
