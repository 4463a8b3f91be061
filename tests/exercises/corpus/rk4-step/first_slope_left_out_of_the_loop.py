# mistake: The loop that sums the slopes begins at 1, so the first slope is missing from the sum.
# next: Let the loop begin at 0.
# status: incorrect
# told: Your weights are 0, 1/3, 1/3, 1/6 and sum to 5/6, not to 1; the classical weights are
import mujoco


class Rk4:
    b = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
    c = (0.0, 0.5, 0.5, 1.0)

    def __init__(self, model, data):
        self.m, self.d = model, data
        self.q, self.v, self.w, self.t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
        self.k = []

    def stage(self, i):
        h = self.m.opt.timestep
        if i:
            dq, dv, dw = self.k[i - 1]
            self.d.qpos[:] = self.q + self.c[i] * h * dq
            self.d.qvel[:] = self.v + self.c[i] * h * dv
            self.d.act[:] = self.w + self.c[i] * h * dw
        self.d.time = self.t + self.c[i] * h
        mujoco.mj_forward(self.m, self.d)
        self.k.append((self.d.qvel.copy(), self.d.qacc.copy(), self.d.act_dot.copy()))

    def finish(self):
        h = self.m.opt.timestep
        for i in range(1, len(self.k)):
            self.q += h * self.b[i] * self.k[i][0]
            self.v += h * self.b[i] * self.k[i][1]
            self.w += h * self.b[i] * self.k[i][2]
        self.d.qpos[:], self.d.qvel[:], self.d.act[:] = self.q, self.v, self.w
        self.d.time = self.t + h


def rk4_step(model, data):
    step = Rk4(model, data)
    for i in range(4):
        step.stage(i)
    step.finish()
