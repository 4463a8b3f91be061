# mistake: It integrates data.qacc_smooth, the acceleration without constraint forces, so joint limits have no effect.
# next: Use data.qacc, the acceleration after the constraint stage.
# status: partial
# told: Your accelerations are data.qacc_smooth, which leaves out constraint
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q = data.qpos.copy(); v = data.qvel.copy(); z = data.act.copy(); t = data.time

    def forward(qq, vv, zz, tt):
        data.qpos[:] = qq
        data.qvel[:] = vv
        data.act[:] = zz
        data.time = tt
        mujoco.mj_forward(model, data)
        # the acceleration stage gives qacc_smooth (see the table in the lesson)
        return data.qacc_smooth.copy(), data.act_dot.copy()

    a1, z1 = forward(q, v, z, t)
    v2 = v + h / 2 * a1
    a2, z2 = forward(q + h / 2 * v, v2, z + h / 2 * z1, t + h / 2)
    v3 = v + h / 2 * a2
    a3, z3 = forward(q + h / 2 * v2, v3, z + h / 2 * z2, t + h / 2)
    v4 = v + h * a3
    a4, z4 = forward(q + h * v3, v4, z + h * z3, t + h)
    data.qpos[:] = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = z + h / 6 * (z1 + 2 * z2 + 2 * z3 + z4)
    data.time = t + h
