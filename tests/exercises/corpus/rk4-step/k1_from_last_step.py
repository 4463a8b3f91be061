# mistake: The first slope takes the acceleration that the last step left behind; mj_forward is not called at the start of the step.
# next: Call mj_forward at the start of the step, before reading data.qacc.
# status: incorrect
# told: Your first acceleration is data.qacc as it stood before the step: nothing has computed it
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    # qacc of the current state is already there, saves one mj_forward per step
    k1 = (v, data.qacc.copy(), data.act_dot.copy())

    def next_slope(k, c):
        data.qpos[:] = q + c * h * k[0]
        data.qvel[:] = v + c * h * k[1]
        data.act[:] = w + c * h * k[2]
        data.time = t + c * h
        mujoco.mj_forward(model, data)
        return (data.qvel.copy(), data.qacc.copy(), data.act_dot.copy())

    k2 = next_slope(k1, 0.5)
    k3 = next_slope(k2, 0.5)
    k4 = next_slope(k3, 1.0)
    data.qpos[:] = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = w + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t + h
