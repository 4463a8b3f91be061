# mistake: The quaternion is looked for behind three numbers of a place, which a ball joint does not have.
# next: Take jnt_qposadr itself for a ball joint.
# status: partial
# told: its quaternion stands alone in qpos, without a position before it
import mujoco
import numpy as np
# quaternion rates: q' = q*w/2 integrated componentwise, normalised
def qmul(a, b):
    r = np.empty(4); mujoco.mju_mulQuat(r, np.ascontiguousarray(a), np.ascontiguousarray(b)); return r
class Layout:
    def __init__(self, m):
        self.quats = []; self.lin = []
        for j in range(m.njnt):
            qa, da = m.jnt_qposadr[j], m.jnt_dofadr[j]
            ty = m.jnt_type[j]
            if ty == mujoco.mjtJoint.mjJNT_FREE:
                self.lin += [(qa+i, da+i) for i in range(3)]; self.quats.append((qa+3, da+3))
            elif ty == mujoco.mjtJoint.mjJNT_BALL: self.quats.append((qa+3, da+3))
            else: self.lin.append((qa, da))
    def qdot(self, q, v):
        out = np.zeros_like(q)
        for a, b in self.lin: out[a] = v[b]
        for a, b in self.quats: out[a:a+4] = .5*qmul(q[a:a+4], np.r_[0, v[b:b+3]])
        return out
    def norm(self, q):
        q = q.copy()
        for a, _ in self.quats: q[a:a+4] /= np.linalg.norm(q[a:a+4])
        return q
def rk4_step(model, data):
    L = Layout(model); h = model.opt.timestep
    y0 = (data.qpos.copy(), data.qvel.copy(), data.act.copy()); t0 = data.time
    def f(y, t):
        data.qpos[:] = L.norm(y[0]); data.qvel[:] = y[1]; data.act[:] = y[2]; data.time = t
        mujoco.mj_forward(model, data)
        return L.qdot(y[0], y[1]), data.qacc.copy(), data.act_dot.copy()
    add = lambda k, s: tuple(a + s*b for a, b in zip(y0, k))
    k1 = f(y0, t0); k2 = f(add(k1, h/2), t0+h/2); k3 = f(add(k2, h/2), t0+h/2); k4 = f(add(k3, h), t0+h)
    k = [(a+2*b+2*c+d)/6 for a, b, c, d in zip(k1, k2, k3, k4)]
    y = add(k, h)
    data.qpos[:] = L.norm(y[0]); data.qvel[:] = y[1]; data.act[:] = y[2]; data.time = t0 + h
