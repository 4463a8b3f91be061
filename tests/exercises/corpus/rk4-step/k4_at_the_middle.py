# mistake: The fourth slope is taken at the middle of the step, because the loop uses h/2 for every stage.
# next: Take k4 at the end of the step, reached with h times k3.
# status: incorrect
# told: Your last stage is evaluated at half the step; evaluate it at the
import mujoco


class State:
    def __init__(self, q, v, a):
        self.q, self.v, self.a = q, v, a

    def plus(self, dt, d):
        return State(self.q + dt * d.q, self.v + dt * d.v, self.a + dt * d.a)


class RungeKutta4:
    def __init__(self, model, data):
        self.m = model
        self.d = data

    def read(self):
        return State(self.d.qpos.copy(), self.d.qvel.copy(), self.d.act.copy())

    def write(self, s):
        self.d.qpos[:] = s.q
        self.d.qvel[:] = s.v
        self.d.act[:] = s.a

    def slope(self, s, t):
        self.write(s)
        self.d.time = t
        mujoco.mj_forward(self.m, self.d)
        return State(s.v.copy(), self.d.qacc.copy(), self.d.act_dot.copy())

    def step(self):
        h = self.m.opt.timestep
        t = self.d.time
        start = self.read()
        k = [self.slope(start, t)]
        for _ in range(3):
            k.append(self.slope(start.plus(h / 2, k[-1]), t + h / 2))
        end = start
        for w, s in zip((1, 2, 2, 1), k):
            end = end.plus(h * w / 6, s)
        self.write(end)
        self.d.time = t + h


def rk4_step(model, data):
    RungeKutta4(model, data).step()
