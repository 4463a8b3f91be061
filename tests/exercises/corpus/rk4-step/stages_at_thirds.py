# mistake: The four stages lie at 0, 1/3, 2/3 and 1 of the step, but the weights are those for 0, 1/2, 1/2 and 1.
# next: Put the second and the third stage at half the step.
# status: incorrect
# told: Your stage 2 moves by h/3 k1; it should move by h/2 k1 from the start of the
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, a, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def stages(i, slope=None):
        """the slopes from stage i on, recursively"""
        if i == 4:
            return []
        part = i / 3 * h
        if slope is not None:
            data.qpos[:] = q + part * slope[0]
            data.qvel[:] = v + part * slope[1]
            data.act[:] = a + part * slope[2]
        data.time = t + part
        mujoco.mj_forward(model, data)
        own = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
        return [own] + stages(i + 1, own)

    k1, k2, k3, k4 = stages(0)
    for target, s, i in ((data.qpos, q, 0), (data.qvel, v, 1), (data.act, a, 2)):
        target[:] = s + h * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]) / 6
    data.time = t + h
