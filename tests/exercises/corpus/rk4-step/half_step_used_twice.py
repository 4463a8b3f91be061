# mistake: The middle slopes are halved twice: h/2 is already in the name `half`, and it is divided by two again at the stages.
# next: Reach the middle stages with h/2 times the slope, not h/4.
# status: incorrect
# told: Your stages 2 and 3 lie 1/2 times as far from the start as they should
import mujoco

def rk4_step(model, data):
    h = model.opt.timestep
    half = h / 2
    q, v, act, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def slope():
        mujoco.mj_forward(model, data)
        return data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()

    def go(dt, k):
        data.qpos[:] = q + dt * k[0]
        data.qvel[:] = v + dt * k[1]
        data.act[:] = act + dt * k[2]

    k1 = slope()
    go(half / 2, k1); data.time = t + half
    k2 = slope()
    go(half / 2, k2)
    k3 = slope()
    go(h, k3); data.time = t + h
    k4 = slope()
    mean = [(a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4)]
    go(h, mean)
    data.time = t + h
