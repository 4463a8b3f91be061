# mistake: This is Kutta's third-order method with three slopes and weights 1, 4, 1.
# next: Use four slopes with weights 1, 2, 2, 1.
# status: incorrect
# told: This is Kutta's third-order
import mujoco

def rk4_step(model, data):
    h, t = model.opt.timestep, data.time
    s0 = [data.qpos.copy(), data.qvel.copy(), data.act.copy()]
    def put(s):
        data.qpos[:] = s[0]
        data.qvel[:] = s[1]
        data.act[:] = s[2]
    def slope(s, t):
        put(s)
        data.time = t
        mujoco.mj_forward(model, data)
        return [data.qvel.copy(), data.qacc.copy(), data.act_dot.copy()]
    k1 = slope(s0, t)
    k2 = slope([x + h/2*k for x, k in zip(s0, k1)], t + h/2)
    k3 = slope([x - h*a + 2*h*b for x, a, b in zip(s0, k1, k2)], t + h)
    put([x + h/6*(a + 4*b + c) for x, a, b, c in zip(s0, k1, k2, k3)])
    data.time = t + h
