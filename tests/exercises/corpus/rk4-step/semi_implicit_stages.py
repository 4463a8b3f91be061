# mistake: Inside each stage the position moves with the velocity just updated, as in semi-implicit Euler.
# next: Move the position of a stage with the velocity of the stage before it.
# status: incorrect
# told: Your stages move the position with their own new velocity; use the velocity of the stage
import mujoco


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0 = data.qpos.copy(), data.qvel.copy()
    act0, t0 = data.act.copy(), data.time

    def evaluate(k, dt):
        # k = (vel slope, acc slope, act slope) of the last evaluation
        if k is not None:
            data.qvel[:] = v0 + dt * k[1]
            data.qpos[:] = q0 + dt * data.qvel      # new velocity is more accurate, like MuJoCo's Euler
            data.act[:] = act0 + dt * k[2]
            data.time = t0 + dt
        mujoco.mj_forward(model, data)
        return [data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()]

    k1 = evaluate(None, 0)
    k2 = evaluate(k1, h / 2)
    k3 = evaluate(k2, h / 2)
    k4 = evaluate(k3, h)
    data.qpos[:] = q0 + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
    data.qvel[:] = v0 + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
    data.act[:] = act0 + h / 6 * (k1[2] + 2 * k2[2] + 2 * k3[2] + k4[2])
    data.time = t0 + h
