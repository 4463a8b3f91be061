# mistake: The final move of the position starts at the fourth stage, because data.qpos is not set back to the start of the step.
# next: Set data.qpos[:] to the copy of the start before the last mj_integratePos.
# status: incorrect
# told: For the position: the weighted sum is added to the state of your last stage: restore the
import mujoco


def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    q0, v0, w0 = data.qpos.copy(), data.qvel.copy(), data.act.copy()
    k = []
    for c in (0, 0.5, 0.5, 1):
        if k:
            vp, ap, wp = k[-1]
            data.qpos[:] = q0
            mujoco.mj_integratePos(model, data.qpos, vp, c * h)
            data.qvel[:] = v0 + c * h * ap
            data.act[:] = w0 + c * h * wp
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        k.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    mean = [(a + 2 * b + 2 * c_ + d) / 6 for a, b, c_, d in zip(*k)]
    mujoco.mj_integratePos(model, data.qpos, mean[0], h)
    data.qvel[:] = v0 + h * mean[1]
    data.act[:] = w0 + h * mean[2]
    data.time = t + h
