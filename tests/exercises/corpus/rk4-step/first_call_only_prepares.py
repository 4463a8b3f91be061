# mistake: The first call computes the accelerations and returns without a step, so the run is one step behind.
# next: Take a whole step in every call.
# status: incorrect
# told: You are one step behind: the first call does not advance the state. Advance it once
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    t = data.time
    if t == 0:
        mujoco.mj_forward(model, data)
        data.time = h
        return
    q = data.qpos.copy()
    v = data.qvel.copy()
    act = data.act.copy()
    ks = []
    for c in (0, h / 2, h / 2, h):
        if ks:
            data.qpos[:] = q + c * ks[-1][0]
            data.qvel[:] = v + c * ks[-1][1]
            data.act[:] = act + c * ks[-1][2]
        data.time = t + c
        mujoco.mj_forward(model, data)
        ks.append([data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()])
    data.qpos[:] = q + h / 6 * sum(w * k[0] for w, k in zip((1, 2, 2, 1), ks))
    data.qvel[:] = v + h / 6 * sum(w * k[1] for w, k in zip((1, 2, 2, 1), ks))
    data.act[:] = act + h / 6 * sum(w * k[2] for w, k in zip((1, 2, 2, 1), ks))
    data.time = t + h
