# mistake: One call runs the whole second of 500 steps, instead of one step.
# next: Advance by one timestep in each call; the loop belongs to the caller.
# status: timed_out
# told: The script used up its CPU time of 20 s.
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    for _ in range(500):
        q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
        mujoco.mj_forward(model, data)
        k1 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
        data.qpos[:] = q + h / 2 * k1[0]
        data.qvel[:] = v + h / 2 * k1[1]
        data.act[:] = w + h / 2 * k1[2]
        data.time = t + h / 2
        mujoco.mj_forward(model, data)
        k2 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
        data.qpos[:] = q + h / 2 * k2[0]
        data.qvel[:] = v + h / 2 * k2[1]
        data.act[:] = w + h / 2 * k2[2]
        mujoco.mj_forward(model, data)
        k3 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
        data.qpos[:] = q + h * k3[0]
        data.qvel[:] = v + h * k3[1]
        data.act[:] = w + h * k3[2]
        data.time = t + h
        mujoco.mj_forward(model, data)
        k4 = data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()
        data.qpos[:] = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
        data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        data.act[:] = w + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
