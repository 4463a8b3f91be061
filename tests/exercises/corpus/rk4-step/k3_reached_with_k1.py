# mistake: The third slope starts with k1 instead of k2, so it is the second slope over again (a copied line).
# next: Reach k3 with k2.
# status: incorrect
# told: Your stage 3 uses the first slope again: it moves by h/2 k1, not by h/2
import mujoco
def rk4_step(model, data):
    dt = model.opt.timestep
    x0 = data.qpos.copy(); v0 = data.qvel.copy(); u0 = data.act.copy(); T = data.time

    def F(x, v, u, t):
        data.qpos[:] = x; data.qvel[:] = v; data.act[:] = u; data.time = t
        mujoco.mj_forward(model, data)
        return v, data.qacc.copy(), data.act_dot.copy()

    a1, b1, c1 = F(x0, v0, u0, T)
    a2, b2, c2 = F(x0 + dt*a1/2, v0 + dt*b1/2, u0 + dt*c1/2, T + dt/2)
    a3, b3, c3 = F(x0 + dt*a1/2, v0 + dt*b1/2, u0 + dt*c1/2, T + dt/2)
    a4, b4, c4 = F(x0 + dt*a3, v0 + dt*b3, u0 + dt*c3, T + dt)
    data.qpos[:] = x0 + dt*(a1 + 2*a2 + 2*a3 + a4)/6
    data.qvel[:] = v0 + dt*(b1 + 2*b2 + 2*b3 + b4)/6
    data.act[:] = u0 + dt*(c1 + 2*c2 + 2*c3 + c4)/6
    data.time = T + dt
