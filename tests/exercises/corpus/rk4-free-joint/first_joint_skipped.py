# mistake: The loop over the joints begins at 1, so the first joint never moves.
# next: Loop over range(model.njnt).
# status: incorrect
# told: No position changes, neither in the stages nor at the end, although the velocities
import mujoco
import numpy as np


class Stepper:
    def __init__(self, model, data):
        self.model = model
        self.data = data
        self.h = model.opt.timestep

    def displaced(self, q, u, dt):
        m, out = self.model, np.array(q)
        for j in range(1, m.njnt):
            a, b = m.jnt_qposadr[j], m.jnt_dofadr[j]
            if m.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE:
                out[a : a + 3] += dt * u[b : b + 3]
                a, b = a + 3, b + 3
            if m.jnt_type[j] in (0, 1):
                quat = out[a : a + 4].copy()
                mujoco.mju_quatIntegrate(quat, u[b : b + 3], dt)
                out[a : a + 4] = quat
            else:
                out[a] += dt * u[b]
        return out

    def forward(self, q, v, s, t):
        self.data.qpos[:] = q
        self.data.qvel[:] = v
        self.data.act[:] = s
        self.data.time = t
        mujoco.mj_forward(self.model, self.data)
        return np.array(self.data.qvel), np.array(self.data.qacc), np.array(self.data.act_dot)

    def step(self):
        d, h = self.data, self.h
        q, v, s, t = np.array(d.qpos), np.array(d.qvel), np.array(d.act), d.time
        v1, a1, s1 = self.forward(q, v, s, t)
        v2, a2, s2 = self.forward(self.displaced(q, v1, h / 2), v + h / 2 * a1, s + h / 2 * s1, t + h / 2)
        v3, a3, s3 = self.forward(self.displaced(q, v2, h / 2), v + h / 2 * a2, s + h / 2 * s2, t + h / 2)
        v4, a4, s4 = self.forward(self.displaced(q, v3, h), v + h * a3, s + h * s3, t + h)
        d.qpos[:] = self.displaced(q, (v1 + 2 * v2 + 2 * v3 + v4) / 6, h)
        d.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        d.act[:] = s + h / 6 * (s1 + 2 * s2 + 2 * s3 + s4)
        d.time = t + h


def rk4_step(model, data):
    Stepper(model, data).step()
