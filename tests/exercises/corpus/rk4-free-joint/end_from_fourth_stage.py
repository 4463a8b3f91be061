# mistake: the final mj_integratePos starts at the fourth stage's position, not at the start of the step: set data.qpos[:] = q before it
# status: incorrect
# told: For the position: the weighted sum is added to the state of your last stage: restore
import mujoco


def rk4_step(model, data):
    """Advance data by model.opt.timestep, with accelerations from mujoco.mj_forward alone."""
    h = model.opt.timestep
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    k = []
    for c in (0, 0.5, 0.5, 1):
        data.qpos[:] = q
        data.qvel[:] = v
        data.act[:] = act
        if k:
            mujoco.mj_integratePos(model, data.qpos, k[-1][0], c * h)
            data.qvel[:] += c * h * k[-1][1]
            data.act[:] += c * h * k[-1][2]
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        k.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(*k)]
    mujoco.mj_integratePos(model, data.qpos, mean[0], h)
    data.qvel[:] = v + h * mean[1]
    data.act[:] = act + h * mean[2]
    data.time = t + h
