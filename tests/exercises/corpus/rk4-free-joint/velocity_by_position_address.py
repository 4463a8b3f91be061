# mistake: Velocities are looked up with model.jnt_qposadr, which counts positions; behind a free joint that is one place too far.
# next: Use model.jnt_dofadr for qvel and model.jnt_qposadr for qpos.
# status: partial
# told: hidden case 3: TypeError, in line 25 of your
# told from MuJoCo 4.0.0: incorrect: of second order on rotations only
import mujoco

FREE = int(mujoco.mjtJoint.mjJNT_FREE)
BALL = int(mujoco.mjtJoint.mjJNT_BALL)


class Positions:
    """moves qpos of any joint"""

    def __init__(self, model):
        self.model = model

    def move(self, q, v, dt):
        q = q.copy()
        for j in range(self.model.njnt):
            adr = self.model.jnt_qposadr[j]
            kind = int(self.model.jnt_type[j])
            if kind == FREE:
                q[adr:adr + 3] += dt * v[adr:adr + 3]
                mujoco.mju_quatIntegrate(q[adr + 3:adr + 7], v[adr + 3:adr + 6], dt)
            elif kind == BALL:
                mujoco.mju_quatIntegrate(q[adr:adr + 4], v[adr:adr + 3], dt)
            else:
                q[adr] += dt * v[adr]
        return q


def rk4_step(model, data):
    pos = Positions(model)
    h = model.opt.timestep
    q, v, w, t = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time

    def acc(q_, v_, w_, t_):
        data.qpos[:] = q_
        data.qvel[:] = v_
        data.act[:] = w_
        data.time = t_
        mujoco.mj_forward(model, data)
        return data.qacc.copy(), data.act_dot.copy()

    a1, d1 = acc(q, v, w, t)
    v2 = v + h / 2 * a1
    a2, d2 = acc(pos.move(q, v, h / 2), v2, w + h / 2 * d1, t + h / 2)
    v3 = v + h / 2 * a2
    a3, d3 = acc(pos.move(q, v2, h / 2), v3, w + h / 2 * d2, t + h / 2)
    v4 = v + h * a3
    a4, d4 = acc(pos.move(q, v3, h), v4, w + h * d3, t + h)
    data.qpos[:] = pos.move(q, (v + 2 * v2 + 2 * v3 + v4) / 6, h)
    data.qvel[:] = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    data.act[:] = w + h / 6 * (d1 + 2 * d2 + 2 * d3 + d4)
    data.time = t + h
