# mistake: This is the midpoint method: two slopes a step, so it is of second order.
# next: Compute all four slopes and sum them with weights 1, 2, 2, 1 over 6.
# status: incorrect
# told: This is the midpoint method: second order, two slopes a
import mujoco


def rk4_step(m, d):
    h = m.opt.timestep
    q = d.qpos.copy()
    v = d.qvel.copy()
    u = d.act.copy()
    t = d.time
    mujoco.mj_forward(m, d)
    # half a step
    d.qpos[:] = q + 0.5 * h * v
    d.qvel[:] = v + 0.5 * h * d.qacc
    d.act[:] = u + 0.5 * h * d.act_dot
    d.time = t + 0.5 * h
    mujoco.mj_forward(m, d)
    # full step with the middle slope
    d.qpos[:] = q + h * d.qvel
    d.qvel[:] = v + h * d.qacc
    d.act[:] = u + h * d.act_dot
    d.time = t + h
