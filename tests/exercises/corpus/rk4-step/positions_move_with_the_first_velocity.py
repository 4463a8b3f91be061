# mistake: The middle positions all move with the velocity of the start, not with the velocity of the stage before.
# next: Move the position of k3 with the velocity of k2, and that of k4 with the velocity of k3.
# status: incorrect
# told: Your stages all move the position with the velocity at the start of the step; use the
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0 = data.qpos.copy()
    v0 = data.qvel.copy()
    z0 = data.act.copy()
    t0 = data.time
    vs, accs, zs = [v0], [], []
    mujoco.mj_forward(model, data)
    accs.append(data.qacc.copy())
    zs.append(data.act_dot.copy())
    for c in (0.5, 0.5, 1.0):
        data.qpos[:] = q0 + c * h * v0
        data.qvel[:] = v0 + c * h * accs[-1]
        data.act[:] = z0 + c * h * zs[-1]
        data.time = t0 + c * h
        vs.append(data.qvel.copy())
        mujoco.mj_forward(model, data)
        accs.append(data.qacc.copy())
        zs.append(data.act_dot.copy())

    def rk_mean(k):
        return (k[0] + 2 * k[1] + 2 * k[2] + k[3]) / 6

    data.qpos[:] = q0 + h * rk_mean(vs)
    data.qvel[:] = v0 + h * rk_mean(accs)
    data.act[:] = z0 + h * rk_mean(zs)
    data.time = t0 + h
