# mistake: The middle slopes are reached with the whole h, so k2 and k3 stand at the end of the step.
# next: Reach k2 and k3 with h/2.
# status: incorrect
# told: Your stages 2 and 3 are evaluated at the end of the step; evaluate them at half the
import mujoco

def rk4_step(model, data):
    h = model.opt.timestep
    q = data.qpos.copy()
    v = data.qvel.copy()
    act = data.act.copy()
    t = data.time
    ks = []
    for i in range(4):
        if i > 0:
            dq, dv, da = ks[i - 1]
            data.qpos[:] = q + h * dq
            data.qvel[:] = v + h * dv
            data.act[:] = act + h * da
            data.time = t + h
        mujoco.mj_forward(model, data)
        ks.append((data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()))
    k1, k2, k3, k4 = ks
    data.qpos[:] = q + h * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0]) / 6
    data.qvel[:] = v + h * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1]) / 6
    data.act[:] = act + h * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2]) / 6
    data.time = t + h
