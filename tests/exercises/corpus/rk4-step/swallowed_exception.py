# mistake: A bare except hides an error: act and act_dot are addressed by joint, the error is swallowed, and the activations never move.
# next: Remove the try, and advance the whole of data.act with data.act_dot.
# status: partial
# told: Some activations never change, while others do: data.act has model.na entries
import mujoco


def advance_act(data, act, slope, dt, njnt):
    try:
        for j in range(njnt):
            data.act[j] = act[j] + dt * slope[j]
    except:
        pass  # no actuators


def rk4_step(model, data):
    h = model.opt.timestep
    q, v, t = data.qpos.copy(), data.qvel.copy(), data.time
    act = data.act.copy()

    def f(dt, k):
        if k:
            data.qpos[:] = q + dt * k[0]
            data.qvel[:] = v + dt * k[1]
            advance_act(data, act, k[2], dt, model.njnt)
        data.time = t + dt
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    k1 = f(0, None)
    k2 = f(h / 2, k1)
    k3 = f(h / 2, k2)
    k4 = f(h, k3)
    data.qpos[:] = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel[:] = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    advance_act(data, act, (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2]) / 6, h, model.njnt)
    data.time = t + h
