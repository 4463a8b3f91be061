# mistake: The state is put back and mj_forward called again before qacc is copied, so every slope is that of the start.
# next: Copy data.qacc before the state is restored.
# status: incorrect
# told: mj_forward is called again after a stage's state has been put back
import mujoco


class RungeKutta4:
    def __init__(self, model, data):
        self.model, self.data = model, data

    def slope(self, q, v, act, t):
        d = self.data
        saved = d.qpos.copy(), d.qvel.copy(), d.act.copy(), d.time
        d.qpos[:], d.qvel[:], d.act[:], d.time = q, v, act, t
        mujoco.mj_forward(self.model, d)
        # leave no side effects behind
        d.qpos[:], d.qvel[:], d.act[:], d.time = saved
        mujoco.mj_forward(self.model, d)
        return v, d.qacc.copy(), d.act_dot.copy()

    def step(self):
        d, h = self.data, self.model.opt.timestep
        q, v, a, t = d.qpos.copy(), d.qvel.copy(), d.act.copy(), d.time
        k1 = self.slope(q, v, a, t)
        k2 = self.slope(q + h / 2 * k1[0], v + h / 2 * k1[1], a + h / 2 * k1[2], t + h / 2)
        k3 = self.slope(q + h / 2 * k2[0], v + h / 2 * k2[1], a + h / 2 * k2[2], t + h / 2)
        k4 = self.slope(q + h * k3[0], v + h * k3[1], a + h * k3[2], t + h)
        dq, dv, da = ((w + 2 * x + 2 * y + z) / 6 for w, x, y, z in zip(k1, k2, k3, k4))
        d.qpos[:] = q + h * dq
        d.qvel[:] = v + h * dv
        d.act[:] = a + h * da
        d.time = t + h


def rk4_step(model, data):
    RungeKutta4(model, data).step()
