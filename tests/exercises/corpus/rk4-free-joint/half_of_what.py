# mistake: mj_integratePos gets 0.5 and 1 as its dt in the stages, the fractions of the step without h.
# next: Pass h/2 and h.
# status: incorrect
# told: The position of your stage 2 moves by a slope without h: a stage moves by a fraction
import mujoco
import numpy as np

C = [0, 0.5, 0.5, 1]
B = np.array([1, 2, 2, 1]) / 6


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, w0, t0 = data.qpos.copy(), data.qvel.copy(), data.act.copy(), data.time
    vel, acc, act = np.zeros((4, model.nv)), np.zeros((4, model.nv)), np.zeros((4, model.na))
    for i, c in enumerate(C):
        q = q0.copy()
        if i > 0:
            mujoco.mj_integratePos(model, q, vel[i - 1], c)
            data.qvel[:] = v0 + c * h * acc[i - 1]
            data.act[:] = w0 + c * h * act[i - 1]
        data.qpos[:] = q
        data.time = t0 + c * h
        mujoco.mj_forward(model, data)
        vel[i], acc[i], act[i] = data.qvel, data.qacc, data.act_dot
    q = q0.copy()
    mujoco.mj_integratePos(model, q, B @ vel, h)
    data.qpos[:] = q
    data.qvel[:] = v0 + h * B @ acc
    data.act[:] = w0 + h * B @ act
    data.time = t0 + h
