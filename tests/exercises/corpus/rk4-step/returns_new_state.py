# mistake: The new position and velocity are returned instead of being written into data, which is left at the last stage.
# next: Write the result into data.qpos[:], data.qvel[:], data.act[:] and data.time; return nothing.
# status: incorrect
# told: After your step data stands at your last stage: the weighted sum
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0 = data.qpos.copy(), data.qvel.copy()

    def f(q, v):
        data.qpos[:] = q
        data.qvel[:] = v
        mujoco.mj_forward(model, data)
        return v.copy(), data.qacc.copy()

    k1 = f(q0, v0)
    k2 = f(q0 + h / 2 * k1[0], v0 + h / 2 * k1[1])
    k3 = f(q0 + h / 2 * k2[0], v0 + h / 2 * k2[1])
    k4 = f(q0 + h * k3[0], v0 + h * k3[1])
    q_new = q0 + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    v_new = v0 + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    return q_new, v_new
